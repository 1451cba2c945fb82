//! A latched topic over DDS whose late subscribers get the present sample only.
//!
//! A writer of RustDDS 0.15.1 keeps replaced samples until a timer of 6 s ends, and gives them to late subscribers first. So each
//! change gets a writer of its own, and the former one leaves the graph.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use ros2_client::WriteError;

/// The least time between two writers: a change that comes sooner waits, and a newer one takes its place.
const INTERVAL: Duration = Duration::from_millis(200);

/// How many writers a topic may have, one after the other. The library never removes a writer from what its node announces in
/// `ros_discovery_info`, 16 bytes each; the last one stays, with the library's behaviour.
const WRITERS_MAX: u32 = 500;

/// Writes each sample with a writer of its own, as often as it may.
pub(crate) struct StateWriter<W, C> {
    create: C,
    writer: RefCell<W>,
    /// When the present writer wrote its sample.
    written: Cell<Option<Instant>>,
    writers: Cell<u32>,
}

impl<W, C: Fn() -> Option<W>> StateWriter<W, C> {
    /// Begins with `writer`; `create` makes another one, or none where the library refuses.
    pub(crate) fn new(writer: W, create: C) -> Self {
        Self {
            create,
            writer: RefCell::new(writer),
            written: Cell::new(None),
            writers: Cell::new(1),
        }
    }

    /// Writes a sample at `now` by `write`.
    ///
    /// # Errors
    /// It is too soon after the last one, or as `write`.
    pub(crate) fn write<M>(
        &self,
        now: Instant,
        sample: M,
        write: impl FnOnce(&W, M) -> Result<(), WriteError<M>>,
    ) -> Result<(), WriteError<M>> {
        if let Some(last) = self.written.get()
            && self.writers.get() < WRITERS_MAX
        {
            if now.saturating_duration_since(last) < INTERVAL {
                return Err(WriteError::WouldBlock { data: sample });
            }
            if let Some(next) = (self.create)() {
                // The former writer takes its sample with it.
                self.writer.replace(next);
                self.writers.set(self.writers.get() + 1);
            }
        }
        write(&self.writer.borrow(), sample)?;
        self.written.set(Some(now));
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

    /// Writes at `ms`; the number of the writer that wrote, if one did.
    fn write_at(writer: &StateWriter<u32, impl Fn() -> Option<u32>>, ms: u64) -> Option<u32> {
        thread_local!(static START: Instant = Instant::now());
        let now = START.with(|start| *start + Duration::from_millis(ms));
        let mut by = None;
        let written = writer.write(now, (), |&number, ()| {
            by = Some(number);
            Ok(())
        });
        assert_eq!(written.is_ok(), by.is_some());
        by
    }

    #[test]
    fn each_change_gets_a_writer_of_its_own_and_waits_if_it_comes_too_soon() {
        let writer = numbered();
        let by = [0, 199, 200, 250, 1_000].map(|ms| write_at(&writer, ms));
        assert_eq!(by, [Some(0), None, Some(1), None, Some(2)]);
    }

    #[test]
    fn the_last_writer_that_a_topic_may_have_writes_on() {
        let writer = numbered();
        let by: Vec<_> = (0..510)
            .filter_map(|n| write_at(&writer, n * 1_000))
            .collect();
        assert_eq!(by.len(), 510);
        assert_eq!(by.last(), Some(&(WRITERS_MAX - 1)));
        assert_eq!(write_at(&writer, 509_001), Some(WRITERS_MAX - 1));
    }

    #[test]
    fn where_no_writer_can_be_created_the_present_one_writes() {
        let writer = StateWriter::new(7, || None);
        assert_eq!([0, 300].map(|ms| write_at(&writer, ms)), [Some(7), Some(7)]);
    }
}
