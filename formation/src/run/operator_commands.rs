//! The commands by which a run gives orders to its modules.

use std::process::Command;

/// Makes a command from options of the target publisher.
type OrderCommand<'a> = Box<dyn Fn(&[String]) -> Command + 'a>;

/// Orders to the modules of a run.
pub struct Orders<'a> {
    /// Makes the command that gives an order, in the options of the target publisher.
    pub command: OrderCommand<'a>,
    /// Whether robots vanish with their processes, so that their bodies are reported as removed.
    pub bodies_vanish: bool,
}
