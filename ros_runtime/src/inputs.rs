//! The inputs of a node: the streams of its subscriptions, services and actions.

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

/// All streams of inputs of a node.
pub struct Inputs<I>(SelectAll<LocalBoxStream<'static, I>>);

impl<I> Default for Inputs<I> {
    fn default() -> Self {
        Self(SelectAll::new())
    }
}

impl<I: 'static> Inputs<I> {
    /// Adds a stream, of whose items `wrap` makes inputs.
    pub fn add<T: 'static>(
        &mut self,
        stream: impl Stream<Item = T> + 'static,
        wrap: impl FnMut(T) -> I + 'static,
    ) {
        self.0.push(stream.map(wrap).boxed_local());
    }

    /// Adds all streams of `others`.
    pub fn append<T: 'static>(&mut self, others: Inputs<T>, wrap: fn(T) -> I) {
        for stream in others.0 {
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
                match self.0.next().await {
                    Some(input) => input,
                    None => std::future::pending().await,
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
        self.0.next().now_or_never().flatten()
    }
}

#[cfg(test)]
mod tests {
    use async_channel::bounded;
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
