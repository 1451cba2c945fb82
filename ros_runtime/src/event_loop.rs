//! The event loop that every node runs.

use std::time::{Duration, Instant};

use async_channel::Receiver;

use crate::inputs::{Inputs, Wake};
use crate::node::Node;
use crate::node_interfaces::{InterfaceInput, NodeInterfaces};
use crate::ros_context::{RosContext, RosContextError};

/// After this many inputs the node acts on them before more are taken in.
const INPUTS_PER_TURN: usize = 256;

/// Samples that found no room in the library are offered again after this.
const RETRY_AFTER: Duration = Duration::from_millis(20);

/// The longest time between two looks at the DDS liveness watchdog.
const LIVENESS_INTERVAL: Duration = Duration::from_secs(1);

enum Arrival<I> {
    Input(I),
    Interface(InterfaceInput),
}

impl RosContext {
    /// Runs a node until it ends, or until `stop` yields. Serves its parameters, its log and its diagnostics meanwhile.
    ///
    /// # Errors
    /// An endpoint cannot be created, the node cannot go on, or the DDS library no longer receives.
    pub fn run<N: Node>(
        &mut self,
        node: &mut N,
        inputs: Inputs<N::Input>,
        stop: &Receiver<()>,
    ) -> Result<(), RosContextError>
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
                self.graph.attend()?;
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
