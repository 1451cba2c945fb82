//! Whether the DDS library still works for this process.
//!
//! RustDDS ends its threads when the wait for sockets is interrupted, and the kernel interrupts that wait whenever a process
//! goes on after having been stopped (signal(7), "Interruption of system calls and library functions by stop signals"), or
//! the machine after having slept. The process would then go on talking, and never hear anything again.

use std::cell::{Cell, RefCell};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How the names of the library's threads begin, as far as the kernel keeps them.
const LIBRARY: &str = "RustDDS";

/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(500);

/// Watches the threads that the DDS library has started for one participant.
pub struct Pulse {
    before: Vec<PathBuf>,
    threads: RefCell<Vec<PathBuf>>,
    looked_at: Cell<Instant>,
}

impl Pulse {
    /// To be made before the participant, so that its threads can be told from those of others.
    pub fn before_start() -> Self {
        Self {
            before: library_threads(),
            threads: RefCell::default(),
            looked_at: Cell::new(Instant::now()),
        }
    }

    /// The participant was made.
    pub fn started(&self) {
        let mut threads = library_threads();
        threads.retain(|thread| !self.before.contains(thread));
        *self.threads.borrow_mut() = threads;
    }

    /// Whether all threads of the library still run; looks now and then only.
    pub fn is_there(&self) -> bool {
        if self.looked_at.get().elapsed() < INTERVAL {
            return true;
        }
        self.looked_at.set(Instant::now());
        self.threads
            .borrow()
            .iter()
            .all(|thread| is_library(thread))
    }
}

/// The threads of this process that belong to the library; none where the system does not show them.
pub fn library_threads() -> Vec<PathBuf> {
    let Ok(threads) = fs::read_dir("/proc/self/task") else {
        return Vec::new();
    };
    threads
        .filter_map(|thread| Some(thread.ok()?.path()))
        .filter(|thread| is_library(thread))
        .collect()
}

fn is_library(thread: &Path) -> bool {
    fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.starts_with(LIBRARY))
}

/// Held by tests whose threads pass for the library's, so that they do not see each other's.
#[cfg(test)]
pub static PRETENDING: std::sync::Mutex<()> = std::sync::Mutex::new(());

#[cfg(test)]
mod tests {
    use std::sync::PoisonError;
    use std::sync::mpsc::channel;
    use std::thread;

    use super::*;

    #[test]
    fn a_thread_that_ends_is_missed() {
        let _alone = PRETENDING.lock().unwrap_or_else(PoisonError::into_inner);
        let pulse = Pulse::before_start();
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
        pulse.started();
        assert_eq!(pulse.threads.borrow().len(), 1);
        pulse.looked_at.set(Instant::now() - INTERVAL);
        assert!(pulse.is_there());
        drop(end);
        library.join().unwrap();
        assert!(pulse.is_there(), "it was looked at just now");
        pulse.looked_at.set(Instant::now() - INTERVAL);
        assert!(!pulse.is_there());
    }
}
