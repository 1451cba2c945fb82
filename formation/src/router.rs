//! `formation router`: a Zenoh router.

use ros_runtime::exit::Failure;

use crate::arguments::RouterArguments;

/// Routes until a signal asks the process to end.
///
/// # Errors
/// An endpoint or `RUST_LOG` cannot be used.
#[cfg(feature = "zenoh")]
pub fn run(arguments: &RouterArguments) -> Result<(), Failure> {
    use ros_runtime::exit::{end_with_parent, stop_requested};
    use ros_runtime::router::{Router, log_refusals};

    if arguments.stop_with_parent {
        end_with_parent()?;
    }
    log_refusals()?;
    let stop = stop_requested()?;
    let router = Router::start(&arguments.listen, &arguments.connect)?;
    crate::console::note(&format!("routing on {}", router.listening()));
    // A channel without a sender can never ask, so its owner is gone and the process with it.
    let _ = stop.recv_blocking();
    Ok(router.stop()?)
}

/// Refuses.
///
/// # Errors
/// Names the command that builds the program with Zenoh.
#[cfg(not(feature = "zenoh"))]
pub fn run(_: &RouterArguments) -> Result<(), Failure> {
    Err(Failure::bad_input(ros_runtime::middleware::NOT_BUILT))
}
