//! The DDS liveness watchdog: whether the DDS library still receives for this process.
//!
//! RustDDS ends its threads when the wait for sockets is interrupted, and the kernel interrupts that wait whenever a
//! process continues after it was stopped (signal(7), "Interruption of system calls and library functions by stop
//! signals"), or the machine after it slept. The process would then go on sending, and never receive again.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// How the names of the library's threads begin, as far as the kernel keeps them.
const LIBRARY: &str = "RustDDS";

/// Between two looks at the threads.
const INTERVAL: Duration = Duration::from_millis(500);

/// From the moment at which a thread closes its channels to its end.
const ENDS_WITHIN: Duration = Duration::from_millis(500);

/// The threads that the DDS library has started for one participant, once it is created.
#[derive(Default)]
pub(crate) struct ParticipantThreads(OnceLock<Vec<PathBuf>>);

impl ParticipantThreads {
    /// Whether all of them still run.
    pub(crate) fn all_run(&self) -> bool {
        let mut threads = self.0.get().into_iter().flatten();
        threads.all(|thread| is_library(thread))
    }

    /// Whether one of them has ended, or is about to: a thread closes its channels, so that the library refuses, a moment
    /// before the system lists it no longer.
    pub(crate) fn has_one_ended(&self) -> bool {
        let deadline = Instant::now() + ENDS_WITHIN;
        while self.all_run() {
            if Instant::now() > deadline {
                return false;
            }
            thread::sleep(Duration::from_millis(5));
        }
        true
    }
}

/// Watches the threads of one participant.
pub(crate) struct LivenessWatchdog {
    /// The threads of other participants of this process.
    others: Vec<PathBuf>,
    pub threads: Arc<ParticipantThreads>,
    looked_at: Cell<Instant>,
}

impl LivenessWatchdog {
    /// To be called before the participant is created, so that its threads can be distinguished from others.
    pub(crate) fn before_participant() -> Self {
        Self {
            others: library_threads(),
            threads: Arc::default(),
            looked_at: Cell::new(Instant::now()),
        }
    }

    /// The participant was created.
    pub(crate) fn participant_created(&self) {
        let mut threads = library_threads();
        threads.retain(|thread| !self.others.contains(thread));
        // It is created once.
        let _ = self.threads.0.set(threads);
    }

    /// Whether all threads of the participant still run; looks at them every [`INTERVAL`] only.
    pub(crate) fn is_alive(&self) -> bool {
        if self.looked_at.get().elapsed() < INTERVAL {
            return true;
        }
        self.looked_at.set(Instant::now());
        self.threads.all_run()
    }
}

/// The threads of this process that belong to the library; none where the system does not show them.
pub(crate) fn library_threads() -> Vec<PathBuf> {
    let threads = fs::read_dir("/proc/self/task").into_iter().flatten();
    threads
        .filter_map(|thread| Some(thread.ok()?.path()))
        .filter(|thread| is_library(thread))
        .collect()
}

fn is_library(thread: &Path) -> bool {
    fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.starts_with(LIBRARY))
}

/// Held by tests whose threads have names like the library's, so that they do not see each other's.
#[cfg(test)]
pub(crate) static NAMED_LIKE_THE_LIBRARY: std::sync::Mutex<()> = std::sync::Mutex::new(());

#[cfg(test)]
mod tests {
    use std::sync::PoisonError;
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_thread_that_has_ended_is_noticed() {
        let _alone = NAMED_LIKE_THE_LIBRARY
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let watchdog = LivenessWatchdog::before_participant();
        let (ready, is_ready) = channel();
        let (end, is_over) = channel::<()>();
        let library = thread::Builder::new()
            .name("RustDDS Participant 0 event loop".to_owned())
            .spawn(move || {
                ready.send(()).unwrap();
                let _ = is_over.recv();
            })
            .unwrap();
        is_ready.recv().unwrap();
        watchdog.participant_created();
        assert_eq!(watchdog.threads.0.get().unwrap().len(), 1);
        assert!(!watchdog.threads.has_one_ended());
        watchdog.looked_at.set(Instant::now() - INTERVAL);
        assert!(watchdog.is_alive());
        drop(end);
        library.join().unwrap();
        assert!(watchdog.is_alive(), "it was looked at just now");
        watchdog.looked_at.set(Instant::now() - INTERVAL);
        assert!(!watchdog.is_alive());
        assert!(watchdog.threads.has_one_ended());
    }
}
