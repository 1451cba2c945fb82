//! The inputs of a node: the streams of its subscriptions, services and actions.

use std::future::{pending, poll_fn};
use std::task::Poll;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use async_io::Timer;
use futures::stream::{LocalBoxStream, SelectAll};
use futures::{FutureExt, Stream, StreamExt, select_biased};

/// Even when something is due already, the processor is left to other processes for this long: a mistake that makes
/// something always due costs time, but not the whole machine.
const PAUSE_MIN: Duration = Duration::from_millis(1);

/// Why [`Inputs::wait`] returned.
pub enum Wake<I> {
    /// An input came.
    Input(I),
    /// The time has come.
    Due,
    /// The process is to end.
    Stop,
}

type Streams<I> = SelectAll<LocalBoxStream<'static, I>>;

/// All streams of inputs of a node.
pub struct Inputs<I> {
    urgent: Streams<I>,
    others: Streams<I>,
}

impl<I> Default for Inputs<I> {
    fn default() -> Self {
        Self {
            urgent: SelectAll::new(),
            others: SelectAll::new(),
        }
    }
}

impl<I: 'static> Inputs<I> {
    /// Adds a stream, of whose items `wrap` makes inputs.
    pub fn add<T: 'static>(
        &mut self,
        stream: impl Stream<Item = T> + 'static,
        wrap: impl FnMut(T) -> I + 'static,
    ) {
        self.others.push(stream.map(wrap).boxed_local());
    }

    /// Adds a stream whose items go before those of all other streams. It must not have items without end.
    pub fn add_urgent<T: 'static>(
        &mut self,
        stream: impl Stream<Item = T> + 'static,
        wrap: impl FnMut(T) -> I + 'static,
    ) {
        self.urgent.push(stream.map(wrap).boxed_local());
    }

    /// Adds all streams of `added`.
    pub fn append<T: 'static>(&mut self, added: Inputs<T>, wrap: fn(T) -> I) {
        for stream in added.urgent {
            self.add_urgent(stream, wrap);
        }
        for stream in added.others {
            self.add(stream, wrap);
        }
    }

    /// Waits for the first of these: the request to stop, an input, `due`; in this order if several have come.
    pub async fn wait(&mut self, due: Option<Instant>, stop: &Receiver<()>) -> Wake<I> {
        let timer = due.map_or_else(Timer::never, |due| {
            Timer::at(due.max(Instant::now() + PAUSE_MIN))
        });
        let mut timer = FutureExt::fuse(timer);
        let mut stop = std::pin::pin!(stop.recv().fuse());
        // Without a stream there are only the other two to wait for.
        let mut inputs = std::pin::pin!(
            async {
                match self.next().await {
                    Some(input) => input,
                    None => pending().await,
                }
            }
            .fuse()
        );
        select_biased! {
            // A channel without a sender can never ask, so its owner is gone and the process with it.
            _ = stop => Wake::Stop,
            input = inputs => Wake::Input(input),
            _ = timer => Wake::Due,
        }
    }

    /// An input that has come already.
    pub(crate) fn ready(&mut self) -> Option<I> {
        self.next().now_or_never().flatten()
    }

    /// The next input; `None` once all streams have ended.
    async fn next(&mut self) -> Option<I> {
        poll_fn(|context| {
            let urgent = self.urgent.poll_next_unpin(context);
            if let Poll::Ready(Some(_)) = urgent {
                return urgent;
            }
            match self.others.poll_next_unpin(context) {
                Poll::Ready(None) => urgent,
                other => other,
            }
        })
        .await
    }
}

#[cfg(test)]
mod tests {
    use async_channel::bounded;
    use futures::future::join;
    use futures::stream;

    use super::*;

    fn samples(count: usize) -> Inputs<usize> {
        let mut inputs = Inputs::default();
        inputs.add(stream::iter(0..count), |sample| sample);
        inputs
    }

    #[test]
    fn a_flood_of_samples_delays_neither_the_request_to_stop_nor_the_end_of_its_sender() {
        let (sender, stop) = bounded(1);
        let mut inputs = samples(1_000);
        async_io::block_on(async {
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Input(_)));
            sender.try_send(()).unwrap();
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Stop));
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Input(_)));
            drop(sender);
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Stop));
        });
    }

    #[test]
    fn an_urgent_input_goes_before_what_waits_already() {
        let (_sender, stop) = bounded(1);
        let (results, urgent) = bounded(1);
        let mut inputs = samples(3);
        inputs.add_urgent(urgent, |result| result);
        async_io::block_on(async {
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Input(0)));
            results.try_send(10).unwrap();
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Input(10)));
            results.try_send(11).unwrap();
            let rest = std::iter::from_fn(|| inputs.ready());
            assert_eq!(rest.collect::<Vec<_>>(), [11, 1, 2]);
            // Also when no other stream is left.
            let (wake, sent) = join(inputs.wait(None, &stop), results.send(12)).await;
            assert!(matches!(wake, Wake::Input(12)));
            sent.unwrap();
        });
    }

    #[test]
    fn time_passes_without_inputs() {
        let (_sender, stop) = bounded(1);
        let mut inputs = samples(2);
        async_io::block_on(async {
            assert!(matches!(inputs.wait(None, &stop).await, Wake::Input(_)));
            assert!(inputs.ready().is_some());
            assert!(inputs.ready().is_none());
            let past = Instant::now();
            assert!(matches!(inputs.wait(Some(past), &stop).await, Wake::Due));
        });
    }
}
