//! A latched topic over DDS whose late subscribers get the present sample only.
//!
//! A writer of RustDDS 0.15.1 keeps replaced samples until a timer of 6 s ends, and gives them to late subscribers first. So each
//! change is written by a writer of its own, and the former one leaves the graph. That writer is created after the change before, so
//! that all subscribers know it in time, volatile ones as well.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use ros2_client::WriteError;

/// The time in which subscribers learn of a writer. A change that comes sooner is written by the present one.
const DISCOVERY: Duration = Duration::from_millis(500);

/// How many writers a topic may have, one after the other. The library never removes a writer from what its node announces in
/// `ros_discovery_info`, 16 bytes each; the last one stays, with the library's behaviour.
const WRITERS_MAX: u32 = 500;

/// Writes each sample with a writer of its own, where changes are not too fast for that.
pub(crate) struct StateWriter<W, C> {
    create: C,
    present: RefCell<W>,
    /// The writer of the next change, and when it was created.
    next: RefCell<Option<(W, Instant)>>,
    writers: Cell<u32>,
}

impl<W, C: Fn() -> Option<W>> StateWriter<W, C> {
    /// Begins with `writer`; `create` makes another one, or none where the library refuses.
    pub(crate) fn new(writer: W, create: C) -> Self {
        Self {
            create,
            present: RefCell::new(writer),
            next: RefCell::new(None),
            writers: Cell::new(1),
        }
    }

    /// Writes a sample at `now` by `write`.
    ///
    /// # Errors
    /// As `write`.
    pub(crate) fn write<M>(
        &self,
        now: Instant,
        sample: M,
        write: impl FnOnce(&W, M) -> Result<(), WriteError<M>>,
    ) -> Result<(), WriteError<M>> {
        let mut next = self.next.borrow_mut();
        let is_known =
            |&(_, since): &(W, Instant)| now.saturating_duration_since(since) >= DISCOVERY;
        if next.as_ref().is_some_and(is_known) {
            if let Some((writer, _)) = &*next {
                write(writer, sample)?;
            }
            if let Some((writer, _)) = next.take() {
                // The former writer takes its sample with it.
                self.present.replace(writer);
            }
        } else {
            write(&self.present.borrow(), sample)?;
        }
        if next.is_none() && self.writers.get() < WRITERS_MAX {
            *next = (self.create)().map(|writer| (writer, now));
            self.writers
                .set(self.writers.get() + u32::from(next.is_some()));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered() -> StateWriter<u32, impl Fn() -> Option<u32>> {
        let created = Cell::new(0);
        StateWriter::new(0, move || {
            created.set(created.get() + 1);
            Some(created.get())
        })
    }

    /// Writes at `ms`; the number of the writer that wrote.
    fn write_at(writer: &StateWriter<u32, impl Fn() -> Option<u32>>, ms: u64) -> u32 {
        thread_local!(static START: Instant = Instant::now());
        let now = START.with(|start| *start + Duration::from_millis(ms));
        let mut by = None;
        let written = writer.write(now, (), |&number, ()| {
            by = Some(number);
            Ok(())
        });
        assert!(written.is_ok());
        by.unwrap()
    }

    #[test]
    fn each_change_gets_a_writer_that_subscribers_know() {
        let writer = numbered();
        let by = [0, 499, 500, 800, 1_000, 9_000].map(|ms| write_at(&writer, ms));
        assert_eq!(by, [0, 0, 1, 1, 2, 3]);
    }

    #[test]
    fn the_last_writer_that_a_topic_may_have_writes_on() {
        let writer = numbered();
        let by: Vec<_> = (0..510).map(|n| write_at(&writer, n * 1_000)).collect();
        assert_eq!(by.last(), Some(&(WRITERS_MAX - 1)));
    }

    #[test]
    fn where_no_writer_can_be_created_the_present_one_writes() {
        let writer = StateWriter::new(7, || None);
        assert_eq!([0, 900].map(|ms| write_at(&writer, ms)), [7, 7]);
    }

    #[test]
    fn a_writer_without_room_is_asked_again() {
        let writer = numbered();
        assert_eq!(write_at(&writer, 0), 0);
        for _ in 0..3 {
            let later = Instant::now() + Duration::from_secs(9);
            let refused = writer.write(later, (), |&number, ()| {
                assert_eq!(number, 1);
                Err(WriteError::WouldBlock { data: () })
            });
            assert!(refused.is_err());
        }
        assert_eq!(write_at(&writer, 9_000), 1);
        assert_eq!(writer.writers.get(), 3);
    }
}
