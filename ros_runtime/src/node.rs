//! What a node of a program is to the event loop.

use std::ops::ControlFlow;
use std::time::Instant;

use crate::diagnostics::Report;
use crate::parameters::{ParameterError, Values};
use crate::ros_context::{RosContext, RosContextError};

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
    fn advance(&mut self, ros: &mut RosContext) -> Result<ControlFlow<()>, RosContextError>;

    /// When [`Self::advance`] has something to do next, if no input comes.
    fn due(&self) -> Option<Instant>;

    /// Uses these values of its parameters from now on; by default it has none that can change at run time.
    ///
    /// # Errors
    /// The values exclude each other; the node then keeps those that it has.
    fn set_parameters(&mut self, _values: &Values) -> Result<(), ParameterError> {
        Ok(())
    }

    /// The status of the parts of the node, for `/diagnostics`; the topic statistics are added to it.
    fn reports(&self) -> Vec<Report> {
        Vec::new()
    }
}
