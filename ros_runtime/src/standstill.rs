//! A fresh start for a process whose DDS library has locked itself up.
//!
//! RustDDS 0.15.1 can do so while endpoints are made and other participants are being discovered. Its discovery thread
//! holds the lock on what is discovered, to read, while it waits for room in the queue to its event loop. The event loop,
//! which alone makes room, waits to read as well, behind whoever waits to write: the maker of the next endpoint. None
//! of the three ever goes on, and no thread can be taken out of a lock, so the process begins anew, under its own number.

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

use crate::outcome::STATUS_FAILED;
use crate::pulse::library_threads;

/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(500);

/// So many looks in a row must find that nothing has moved.
const LOOKS: u32 = 4;

/// Watches whoever makes endpoints, and the library's threads meanwhile.
pub struct Watch {
    /// How often something was begun or ended: odd while it lasts.
    steps: Arc<AtomicU64>,
}

impl Watch {
    /// Watches for as long as it lives.
    pub fn start() -> Self {
        let steps = Arc::new(AtomicU64::new(0));
        let watched = Arc::downgrade(&steps);
        let watch = move || {
            let mut looks = Looks::default();
            loop {
                thread::sleep(INTERVAL);
                let Some(steps) = watched.upgrade() else {
                    return;
                };
                if looks.find_standstill(steps.load(Ordering::Relaxed), activity) {
                    tracing::warn!("the DDS library has locked itself up; starting anew");
                    let error = start_anew();
                    tracing::error!("could not start anew: {error}");
                    process::exit(STATUS_FAILED.into());
                }
            }
        };
        // Without a thread to watch, the library is trusted, as it may be nearly always.
        let _ = thread::Builder::new()
            .name("standstill".to_owned())
            .spawn(watch);
        Self { steps }
    }

    /// Does what may wait for a lock of the library.
    pub fn over<T>(&self, make: impl FnOnce() -> T) -> T {
        self.steps.fetch_add(1, Ordering::Relaxed);
        let made = make();
        self.steps.fetch_add(1, Ordering::Relaxed);
        made
    }
}

/// Which threads the library has, and how often each was given the processor.
type Activity = Vec<(PathBuf, String)>;

#[derive(Default)]
struct Looks {
    last: Option<(u64, Activity)>,
    alike: u32,
}

impl Looks {
    /// Whether the same thing has been waiting for long while all of the library slept.
    fn find_standstill(&mut self, steps: u64, activity: impl FnOnce() -> Option<Activity>) -> bool {
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

/// What the library's threads did so far; `None` if one of them is at work, or the system does not tell.
fn activity() -> Option<Activity> {
    let activity: Option<Activity> = library_threads()
        .into_iter()
        .map(|thread| {
            let status = fs::read_to_string(thread.join("status")).ok()?;
            let lines = |name: &str| {
                status
                    .lines()
                    .filter(move |line| line.contains(name))
                    .collect::<String>()
            };
            lines("State:")
                .contains("S (sleeping)")
                .then(|| (thread, lines("ctxt_switches:")))
        })
        .collect();
    activity.filter(|threads| !threads.is_empty())
}

/// Becomes the same program again, with the same arguments; returns only what prevents that.
fn start_anew() -> io::Error {
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
    use crate::pulse::PRETENDING;

    fn seen(switches: &str) -> Option<Activity> {
        Some(vec![(PathBuf::from("7"), switches.to_owned())])
    }

    /// How many looks it takes to find a standstill, of those that see this.
    fn looks_until_found(
        sights: impl IntoIterator<Item = (u64, Option<Activity>)>,
    ) -> Option<usize> {
        let mut looks = Looks::default();
        sights
            .into_iter()
            .position(|(steps, activity)| looks.find_standstill(steps, || activity))
    }

    #[test]
    fn only_a_long_wait_in_which_nothing_moves_is_a_standstill() {
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
        let _alone = PRETENDING.lock().unwrap_or_else(PoisonError::into_inner);
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
