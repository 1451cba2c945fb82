//! Ending when told to, and in time.

use std::io;
use std::panic;
use std::process;
use std::thread;
use std::time::Duration;

use async_channel::{Receiver, bounded};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::outcome::STATUS_FAILED;

/// A process that was told to end has so long to leave the graph before it ends without.
pub const EXIT_GRACE: Duration = Duration::from_millis(1_500);

/// A request to end; yields once, on the first SIGINT or SIGTERM.
///
/// From then on the process has [`EXIT_GRACE`] to end by itself; a second signal ends it at once.
///
/// # Errors
/// The operating system did not let the signals be caught.
pub fn stop_requested() -> io::Result<Receiver<()>> {
    let (sender, receiver) = bounded(1);
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for (count, _) in signals.forever().enumerate() {
                if count > 0 {
                    process::exit(STATUS_FAILED.into());
                }
                // A full channel means that the request is there already.
                let _ = sender.try_send(());
                limit_exit(EXIT_GRACE, STATUS_FAILED);
            }
        })?;
    Ok(receiver)
}

/// Ends the process with `status` after this time, if it has not ended by itself, whatever the libraries below it still
/// wait for.
pub fn limit_exit(after: Duration, status: u8) {
    let watch = move || {
        thread::sleep(after);
        tracing::warn!("could not leave the ROS 2 graph in time; ending without");
        process::exit(status.into());
    };
    // Without a thread to watch there is no limit, which is no reason not to end.
    let _ = thread::Builder::new()
        .name("exit limit".to_owned())
        .spawn(watch);
}

/// From now on a panic in any thread, the DDS library's included, ends the process: one that lives on without a part of
/// itself would be deaf or dumb, and nobody would know why.
pub fn end_on_panic() {
    let tell = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        tell(panic);
        process::exit(STATUS_FAILED.into());
    }));
}

/// From now on the process is told to end when the one that started it ends, in whatever way.
///
/// # Errors
/// The operating system cannot do that.
pub fn end_with_parent() -> io::Result<()> {
    let parent = getppid();
    set_parent_process_death_signal(Some(Signal::TERM))?;
    if getppid() != parent {
        process::exit(STATUS_FAILED.into());
    }
    Ok(())
}
