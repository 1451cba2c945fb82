//! The DDS deadlock watchdog: restarts a process whose DDS library has locked itself up.
//!
//! RustDDS 0.15.1 can do so while endpoints are created and other participants are discovered. Its discovery thread
//! holds the read lock on what is discovered while it waits for room in the queue to the event loop. The event loop,
//! which alone makes room, waits for the read lock as well, behind the thread that waits for the write lock: the one that
//! creates the next endpoint. None of the three ever continues, and no thread can be taken out of a lock, so the process
//! executes itself again, under its own number. It does the same when the library's threads end while an endpoint is
//! created, which then waits for their answer.

use std::env;
use std::fs;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{self, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use crate::dds_liveness::{ParticipantThreads, library_threads};
use crate::exit::STATUS_FAILED;

/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(500);

/// How many looks in a row must find no change.
const LOOKS: u32 = 4;

/// Watches the creation of endpoints, and the library's threads meanwhile.
pub(crate) struct DeadlockWatchdog {
    /// How often something was begun or ended: odd while it lasts.
    steps: Arc<AtomicU64>,
}

impl DeadlockWatchdog {
    /// Watches until it is dropped; `threads` are those of the participant, once it is created.
    ///
    /// # Errors
    /// The machine has no thread left.
    pub(crate) fn start(threads: Arc<ParticipantThreads>) -> io::Result<Self> {
        let steps = Arc::new(AtomicU64::new(0));
        let watched = Arc::downgrade(&steps);
        let watch = move || {
            let mut looks = Looks::default();
            loop {
                thread::sleep(INTERVAL);
                let Some(steps) = watched.upgrade() else {
                    return;
                };
                // A call that the library's threads cannot answer any more never returns, whatever the others do.
                let activity = || {
                    if threads.all_run() {
                        activity()
                    } else {
                        Some(Activity::new())
                    }
                };
                if looks.find_deadlock(steps.load(Ordering::Relaxed), activity) {
                    tracing::warn!("the DDS library has locked itself up; restarting");
                    let error = restart();
                    tracing::error!("could not restart: {error}");
                    process::exit(STATUS_FAILED.into());
                }
            }
        };
        thread::Builder::new()
            .name("deadlock".to_owned())
            .spawn(watch)?;
        Ok(Self { steps })
    }

    /// Calls what may wait for a lock of the library.
    pub(crate) fn watch<T>(&self, call: impl FnOnce() -> T) -> T {
        self.steps.fetch_add(1, Ordering::Relaxed);
        let result = call();
        self.steps.fetch_add(1, Ordering::Relaxed);
        result
    }
}

/// The threads of the library, and how often each was given the processor.
type Activity = Vec<(PathBuf, String)>;

#[derive(Default)]
struct Looks {
    last: Option<(u64, Activity)>,
    alike: u32,
}

impl Looks {
    /// Whether the same call has been waiting in [`LOOKS`] looks while all of the library slept, or had ended.
    fn find_deadlock(&mut self, steps: u64, activity: impl FnOnce() -> Option<Activity>) -> bool {
        let waits = steps % 2 == 1;
        let seen = waits.then(activity).flatten().map(|seen| (steps, seen));
        self.alike = if seen.is_some() && seen == self.last {
            self.alike + 1
        } else {
            0
        };
        self.last = seen;
        self.alike >= LOOKS
    }
}

/// What the library's threads did so far; `None` if one of them runs, or the system does not show it.
fn activity() -> Option<Activity> {
    let activity: Option<Activity> = library_threads()
        .into_iter()
        .map(|thread| {
            let status = fs::read_to_string(thread.join("status")).ok()?;
            let lines = |name: &str| {
                let lines = status.lines();
                lines.filter(|line| line.contains(name)).collect::<String>()
            };
            lines("State:")
                .contains("S (sleeping)")
                .then(|| (thread, lines("ctxt_switches:")))
        })
        .collect();
    activity.filter(|threads| !threads.is_empty())
}

/// Becomes the same program again, with the same arguments; returns only what prevents that.
fn restart() -> io::Error {
    let mut arguments = env::args_os();
    let name = arguments.next().unwrap_or_default();
    match env::current_exe() {
        Ok(program) => Command::new(program).arg0(name).args(arguments).exec(),
        Err(error) => error,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::PoisonError;
    use std::sync::mpsc::channel;

    use super::*;
    use crate::dds_liveness::NAMED_LIKE_THE_LIBRARY;

    fn seen(switches: &str) -> Option<Activity> {
        Some(vec![(PathBuf::from("7"), switches.to_owned())])
    }

    /// How many looks it takes to find a deadlock, of those that see this.
    fn looks_until_found(
        sights: impl IntoIterator<Item = (u64, Option<Activity>)>,
    ) -> Option<usize> {
        let mut looks = Looks::default();
        sights
            .into_iter()
            .position(|(steps, activity)| looks.find_deadlock(steps, || activity))
    }

    #[test]
    fn only_a_long_wait_in_which_nothing_runs_is_a_deadlock() {
        let still = (0..10).map(|_| (3, seen("5")));
        assert_eq!(looks_until_found(still), Some(4));
        let nothing_waits = (0..10).map(|_| (4, seen("5")));
        assert_eq!(looks_until_found(nothing_waits), None);
        let others_wait = (0..10).map(|look| (2 * look + 1, seen("5")));
        assert_eq!(looks_until_found(others_wait), None);
        let library_works = (0..10).map(|look| (3, seen(&look.to_string())));
        assert_eq!(looks_until_found(library_works), None);
        let library_runs = (0..10).map(|look| (3, seen("5").filter(|_| look % 4 != 3)));
        assert_eq!(looks_until_found(library_runs), None);
    }

    #[test]
    fn what_a_thread_of_the_library_does_is_seen() {
        let _alone = NAMED_LIKE_THE_LIBRARY
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let (wake, woken) = channel::<()>();
        let (ready, is_ready) = channel();
        let library = thread::Builder::new()
            .name("RustDDS discovery 99".to_owned())
            .spawn(move || {
                while woken.recv().is_ok() {
                    ready.send(()).unwrap();
                }
            })
            .unwrap();
        let switches = || {
            loop {
                if let Some(seen) = activity() {
                    break seen;
                }
                thread::sleep(Duration::from_millis(1));
            }
        };
        wake.send(()).unwrap();
        is_ready.recv().unwrap();
        let before = switches();
        wake.send(()).unwrap();
        is_ready.recv().unwrap();
        assert_ne!(switches(), before);
        drop(wake);
        library.join().unwrap();
    }
}
