//! Waiting for whatever comes first: a sample, a time, or the request to end.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use async_io::Timer;
use futures::stream::{LocalBoxStream, SelectAll, select_all};
use futures::{FutureExt, StreamExt, select_biased};

use crate::inlet::Delivery;

/// Even when something is due already, the processor is left to others for so long: a mistake that makes a thing
/// due for ever costs time, but not the whole machine.
const PAUSE_MIN: Duration = Duration::from_millis(1);

/// Why [`Inbox::wait`] came back.
pub(crate) enum Wake {
    /// A sample came in.
    Delivery(Delivery),
    /// The time has come.
    Due,
    /// The process is to end.
    Stop,
}

/// All that a loop waits for.
pub(crate) struct Inbox<'a> {
    deliveries: SelectAll<LocalBoxStream<'a, Delivery>>,
    stop: Receiver<()>,
}

impl<'a> Inbox<'a> {
    pub(crate) fn new(
        deliveries: impl IntoIterator<Item = LocalBoxStream<'a, Delivery>>,
        stop: Receiver<()>,
    ) -> Self {
        Self {
            deliveries: select_all(deliveries),
            stop,
        }
    }

    /// Waits for the next thing; the request to end comes before all else.
    pub(crate) async fn wait(&mut self, due: Option<Instant>) -> Wake {
        let timer = due.map_or_else(Timer::never, |due| {
            Timer::at(due.max(Instant::now() + PAUSE_MIN))
        });
        let mut timer = FutureExt::fuse(timer);
        let mut stop = std::pin::pin!(self.stop.recv().fuse());
        // A loop without subscriptions has only the other two to wait for.
        let mut deliveries = std::pin::pin!(
            async {
                match self.deliveries.next().await {
                    Some(delivery) => delivery,
                    None => std::future::pending().await,
                }
            }
            .fuse()
        );
        select_biased! {
            // A channel without a sender can never ask, so its owner is gone and the process with it.
            _ = stop => Wake::Stop,
            delivery = deliveries => Wake::Delivery(delivery),
            _ = timer => Wake::Due,
        }
    }

    /// A sample that came in already, without waiting.
    pub(crate) fn ready(&mut self) -> Option<Delivery> {
        self.deliveries.next().now_or_never().flatten()
    }
}

#[cfg(test)]
mod tests {
    use async_channel::bounded;
    use formation::agent::SourceId;
    use futures::stream;

    use super::*;

    fn samples(count: usize) -> LocalBoxStream<'static, Delivery> {
        stream::iter((0..count).map(|_| Delivery::empty(SourceId(1)))).boxed_local()
    }

    #[test]
    fn a_flood_of_samples_holds_up_neither_the_request_to_end_nor_the_owner_going_away() {
        let (sender, stop) = bounded(1);
        let mut inbox = Inbox::new([samples(1_000)], stop);
        async_io::block_on(async {
            assert!(matches!(inbox.wait(None).await, Wake::Delivery(_)));
            sender.try_send(()).unwrap();
            assert!(matches!(inbox.wait(None).await, Wake::Stop));
            assert!(matches!(inbox.wait(None).await, Wake::Delivery(_)));
            drop(sender);
            assert!(matches!(inbox.wait(None).await, Wake::Stop));
        });
    }

    #[test]
    fn time_passes_when_nothing_comes() {
        let (_sender, stop) = bounded(1);
        let mut inbox = Inbox::new([samples(2)], stop);
        async_io::block_on(async {
            assert!(matches!(inbox.wait(None).await, Wake::Delivery(_)));
            assert!(inbox.ready().is_some());
            assert!(inbox.ready().is_none());
            let past = Instant::now();
            assert!(matches!(inbox.wait(Some(past)).await, Wake::Due));
        });
    }
}
