//! The event loop that every node runs.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use async_io::Timer;
use futures::stream::{LocalBoxStream, SelectAll};
use futures::{FutureExt, Stream, StreamExt, select_biased};

use crate::diagnostics::Report;
use crate::node_interfaces::{InterfaceInput, NodeInterfaces};
use crate::parameters::{ParameterError, Values};
use crate::session::{Session, SessionError};

/// Even when something is due already, the processor is left to other processes for this long: a mistake that makes
/// something always due costs time, but not the whole machine.
const PAUSE_MIN: Duration = Duration::from_millis(1);

/// After this many inputs the node acts on them before more are taken in.
const INPUTS_PER_TURN: usize = 256;

/// Samples that found no room in the library are offered again after this.
const RETRY_AFTER: Duration = Duration::from_millis(20);

/// The longest time between two looks at the DDS liveness watchdog.
const LIVENESS_INTERVAL: Duration = Duration::from_secs(1);

/// What a node does: with its inputs, and when time has passed.
pub trait Node {
    /// What its subscriptions, services and actions give it.
    type Input;

    /// Takes in one input.
    fn handle(&mut self, input: Self::Input);

    /// Acts on what was taken in and on the time, and publishes; called once after every batch of inputs, and when
    /// [`Self::due`] has come. `Break` ends the event loop.
    ///
    /// # Errors
    /// The node cannot go on.
    fn advance(&mut self, session: &mut Session) -> Result<ControlFlow<()>, SessionError>;

    /// When [`Self::advance`] has something to do next, if no input comes.
    fn due(&self) -> Option<Instant>;

    /// Uses these values of its parameters from now on.
    ///
    /// # Errors
    /// The values exclude each other; the node then keeps those that it has.
    fn set_parameters(&mut self, values: &Values) -> Result<(), ParameterError>;

    /// The status of the parts of the node, for `/diagnostics`; the topic statistics are added to it.
    fn reports(&self) -> Vec<Report> {
        Vec::new()
    }
}

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
    fn ready(&mut self) -> Option<I> {
        self.0.next().now_or_never().flatten()
    }
}

enum Arrival<I> {
    Input(I),
    Interface(InterfaceInput),
}

impl Session {
    /// Runs a node until it ends, or until `stop` yields. Serves its parameters, its log and its diagnostics meanwhile.
    ///
    /// # Errors
    /// An endpoint cannot be created, the node cannot go on, or the DDS library no longer receives.
    pub fn run<N: Node>(
        &mut self,
        node: &mut N,
        inputs: Inputs<N::Input>,
        stop: &Receiver<()>,
    ) -> Result<(), SessionError>
    where
        N::Input: 'static,
    {
        let mut requests = Inputs::default();
        let mut interfaces = NodeInterfaces::open(self, &mut requests)?;
        let mut arrivals = Inputs::default();
        arrivals.append(inputs, Arrival::Input);
        arrivals.append(requests, Arrival::Interface);
        let ended = async_io::block_on(async {
            loop {
                if node.advance(self)?.is_break() {
                    return Ok(());
                }
                self.check_liveness()?;
                interfaces.report(self, || node.reports())?;
                let retry = self.flush().then_some(RETRY_AFTER);
                let latest = Instant::now() + retry.unwrap_or(LIVENESS_INTERVAL);
                let due = [node.due(), interfaces.due()].into_iter().flatten();
                let first = match arrivals.wait(due.chain([latest]).min(), stop).await {
                    Wake::Stop => return Ok(()),
                    Wake::Due => continue,
                    Wake::Input(first) => first,
                };
                let more = std::iter::from_fn(|| arrivals.ready()).take(INPUTS_PER_TURN);
                for arrival in std::iter::once(first).chain(more) {
                    match arrival {
                        Arrival::Input(input) => node.handle(input),
                        Arrival::Interface(input) => interfaces.handle(input, self, node),
                    }
                }
            }
        });
        tracing::info!("topic statistics: {}", self.statistics().borrow());
        ended
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
