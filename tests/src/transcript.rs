//! What a process writes, line by line, while it runs.

use std::io::{BufRead, BufReader, Read};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// A line and when it came.
#[derive(Clone, Debug)]
pub struct Line {
    /// When it was read.
    pub at: Instant,
    /// What it says, without the end of the line.
    pub text: String,
}

#[derive(Default)]
struct Lines {
    lines: Vec<Line>,
    ended: bool,
}

#[derive(Default)]
struct Shared {
    lines: Mutex<Lines>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Everything that came from one stream so far.
pub struct Transcript {
    shared: Arc<Shared>,
    reader: Option<JoinHandle<()>>,
}

impl Transcript {
    /// Reads a stream to its end in a thread of its own.
    #[must_use]
    pub fn of(stream: impl Read + Send + 'static) -> Self {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let reader = thread::spawn(move || {
            let mut stream = BufReader::new(stream);
            let mut bytes = Vec::new();
            while stream
                .read_until(b'\n', &mut bytes)
                .is_ok_and(|read| read > 0)
            {
                let text = String::from_utf8_lossy(&bytes)
                    .trim_end_matches('\n')
                    .to_owned();
                bytes.clear();
                let at = Instant::now();
                theirs.lock().lines.push(Line { at, text });
                theirs.changed.notify_all();
            }
            theirs.lock().ended = true;
            theirs.changed.notify_all();
        });
        Self {
            shared,
            reader: Some(reader),
        }
    }

    /// The lines from the `from`th on.
    pub(crate) fn since(&self, from: usize) -> Vec<Line> {
        let lines = self.shared.lock();
        lines.lines.get(from..).unwrap_or_default().to_vec()
    }

    /// How many lines there are.
    pub(crate) fn len(&self) -> usize {
        self.shared.lock().lines.len()
    }

    /// Waits until `find` yields something from the lines after the `from`th; `None` when the time is up or no more
    /// lines will come.
    pub fn wait_for<T>(
        &self,
        from: usize,
        limit: Duration,
        mut find: impl FnMut(&Line) -> Option<T>,
    ) -> Option<T> {
        let deadline = Instant::now() + limit;
        let mut next = from;
        let mut lines = self.shared.lock();
        loop {
            while let Some(line) = lines.lines.get(next) {
                next += 1;
                if let Some(found) = find(line) {
                    return Some(found);
                }
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if lines.ended || left.is_zero() {
                return None;
            }
            (lines, _) = self
                .shared
                .changed
                .wait_timeout(lines, left)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Everything, once the stream has ended.
    pub(crate) fn into_text(mut self) -> String {
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        self.since(0)
            .into_iter()
            .map(|line| line.text + "\n")
            .collect()
    }
}
