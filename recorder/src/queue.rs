//! The bounded queue between the node and the thread that writes.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ros_runtime::RawSample;

use crate::file::{RecordedTopic, RecordingFile, Written};

/// The most bytes that wait to be written.
const WAITING_BYTES_MAX: usize = 64 << 20;
/// What a sample counts beyond its payload.
const SAMPLE_BYTES: usize = 128;

/// After a crash, samples that arrived within this time are missing.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);

/// A sample with its topic.
#[derive(Clone, Debug)]
pub struct Item {
    /// The topic.
    pub topic: Arc<RecordedTopic>,
    /// The sample.
    pub sample: RawSample,
}

impl Item {
    fn size(&self) -> usize {
        self.sample.bytes.len() + SAMPLE_BYTES
    }
}

/// Hands samples to a thread that writes them.
pub struct WriteQueue {
    /// `None` once the recording is finished.
    items: Option<Sender<Item>>,
    thread: Option<JoinHandle<io::Result<Written>>>,
    state: Arc<State>,
}

/// What the node and the thread share.
#[derive(Debug, Default)]
struct State {
    waiting_bytes: AtomicUsize,
    lost: AtomicU64,
}

impl WriteQueue {
    /// Starts the thread that writes into `file`.
    ///
    /// # Errors
    /// The operating system refuses a thread.
    pub fn start(file: RecordingFile) -> io::Result<Self> {
        let (items, arriving) = channel();
        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        let thread = thread::Builder::new()
            .name("writer".to_owned())
            .spawn(move || write(file, &arriving, &shared))?;
        Ok(Self {
            items: Some(items),
            thread: Some(thread),
            state,
        })
    }

    /// Has a sample written, or counts it as lost if there is no room; `false` if the thread has ended.
    pub fn put(&self, item: Item) -> bool {
        let size = item.size();
        let waiting = self.state.waiting_bytes.fetch_add(size, Ordering::Relaxed);
        if waiting.saturating_add(size) > WAITING_BYTES_MAX {
            self.state.waiting_bytes.fetch_sub(size, Ordering::Relaxed);
            self.state.lost.fetch_add(1, Ordering::Relaxed);
            return true;
        }
        self.items
            .as_ref()
            .is_some_and(|items| items.send(item).is_ok())
    }

    /// How many samples found no room.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.state.lost.load(Ordering::Relaxed)
    }

    /// Writes what waits, and the end of the file; `None` if that was done before.
    ///
    /// # Errors
    /// The file could not be written.
    pub fn finish(&mut self) -> io::Result<Option<Written>> {
        self.items = None;
        let ended = self.thread.take().map(JoinHandle::join);
        match ended {
            Some(Ok(written)) => written.map(Some),
            // A panic ends the process.
            Some(Err(_)) | None => Ok(None),
        }
    }
}

/// Writes until the queue is dropped.
fn write(mut file: RecordingFile, arriving: &Receiver<Item>, state: &State) -> io::Result<Written> {
    let mut flush_at = Instant::now() + FLUSH_INTERVAL;
    loop {
        match arriving.recv_timeout(flush_at.saturating_duration_since(Instant::now())) {
            Ok(item) => {
                file.write(&item.topic, &item.sample)?;
                state
                    .waiting_bytes
                    .fetch_sub(item.size(), Ordering::Relaxed);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return file.finish(state.lost.load(Ordering::Relaxed));
            }
        }
        if Instant::now() >= flush_at {
            file.flush()?;
            flush_at = Instant::now() + FLUSH_INTERVAL;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::tests::{interfaces, sample, topic};

    fn item(sequence: u64, length: usize) -> Item {
        let mut sample = sample(sequence);
        sample.bytes.resize(length, 0);
        let topic = Arc::new(topic());
        Item { topic, sample }
    }

    #[test]
    fn what_finds_no_room_is_counted() {
        let folder = tempfile::tempdir().unwrap();
        let file = RecordingFile::create(&folder.path().join("out.mcap"), interfaces()).unwrap();
        let mut queue = WriteQueue::start(file).unwrap();
        assert!(queue.put(item(1, 12)));
        assert!(queue.put(item(2, WAITING_BYTES_MAX)));
        assert_eq!(queue.lost(), 1);
        assert!(queue.put(item(3, 12)));
        let written = queue.finish().unwrap().unwrap();
        assert_eq!((written.samples, written.lost), (2, 1));
        assert_eq!(written.missing.values().sum::<u64>(), 1);
        assert_eq!(queue.finish().unwrap(), None);
    }
}
