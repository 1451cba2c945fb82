//! Waiting for whatever comes first: a sample or request, a time, or the request to end.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use async_io::Timer;
use futures::stream::{LocalBoxStream, SelectAll, select_all};
use futures::{FutureExt, StreamExt, select_biased};

/// Even when something is due already, the processor is left to others for so long: a mistake that makes a thing
/// due for ever costs time, but not the whole machine.
const PAUSE_MIN: Duration = Duration::from_millis(1);

/// Why [`Inbox::wait`] came back.
pub enum Wake<T> {
    /// Something came in: a sample, or a request.
    Arrival(T),
    /// The time has come.
    Due,
    /// The process is to end.
    Stop,
}

/// All that a loop waits for.
pub struct Inbox<'a, T> {
    arrivals: SelectAll<LocalBoxStream<'a, T>>,
    stop: Receiver<()>,
}

impl<'a, T> Inbox<'a, T> {
    /// An inbox of all these streams, which ends when `stop` yields.
    pub fn new(
        arrivals: impl IntoIterator<Item = LocalBoxStream<'a, T>>,
        stop: Receiver<()>,
    ) -> Self {
        Self {
            arrivals: select_all(arrivals),
            stop,
        }
    }

    /// Waits for the next thing; the request to end comes before all else.
    pub async fn wait(&mut self, due: Option<Instant>) -> Wake<T> {
        let timer = due.map_or_else(Timer::never, |due| {
            Timer::at(due.max(Instant::now() + PAUSE_MIN))
        });
        let mut timer = FutureExt::fuse(timer);
        let mut stop = std::pin::pin!(self.stop.recv().fuse());
        // A loop without subscriptions has only the other two to wait for.
        let mut arrivals = std::pin::pin!(
            async {
                match self.arrivals.next().await {
                    Some(arrival) => arrival,
                    None => std::future::pending().await,
                }
            }
            .fuse()
        );
        select_biased! {
            // A channel without a sender can never ask, so its owner is gone and the process with it.
            _ = stop => Wake::Stop,
            arrival = arrivals => Wake::Arrival(arrival),
            _ = timer => Wake::Due,
        }
    }

    /// What came in already, without waiting.
    pub fn ready(&mut self) -> Option<T> {
        self.arrivals.next().now_or_never().flatten()
    }
}

#[cfg(test)]
mod tests {
    use async_channel::bounded;
    use futures::stream;

    use super::*;

    fn samples(count: usize) -> LocalBoxStream<'static, usize> {
        stream::iter(0..count).boxed_local()
    }

    #[test]
    fn a_flood_of_samples_holds_up_neither_the_request_to_end_nor_the_owner_going_away() {
        let (sender, stop) = bounded(1);
        let mut inbox = Inbox::new([samples(1_000)], stop);
        async_io::block_on(async {
            assert!(matches!(inbox.wait(None).await, Wake::Arrival(_)));
            sender.try_send(()).unwrap();
            assert!(matches!(inbox.wait(None).await, Wake::Stop));
            assert!(matches!(inbox.wait(None).await, Wake::Arrival(_)));
            drop(sender);
            assert!(matches!(inbox.wait(None).await, Wake::Stop));
        });
    }

    #[test]
    fn time_passes_when_nothing_comes() {
        let (_sender, stop) = bounded(1);
        let mut inbox = Inbox::new([samples(2)], stop);
        async_io::block_on(async {
            assert!(matches!(inbox.wait(None).await, Wake::Arrival(_)));
            assert!(inbox.ready().is_some());
            assert!(inbox.ready().is_none());
            let past = Instant::now();
            assert!(matches!(inbox.wait(Some(past)).await, Wake::Due));
        });
    }
}
