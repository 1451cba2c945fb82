//! Publishing without waiting, and without losing a sample uncounted.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use ros2_client::WriteError;

use crate::topic::Quality;
use crate::topic_statistics::SharedStatistics;

/// What a publisher does with a sample that it is offered: it takes it, or says at once that it does not.
pub(crate) type Sink<M> = Box<dyn Fn(M) -> Result<(), WriteError<M>>>;

/// A publisher with a bounded queue in front, for samples that the library has no room for. Clones share both.
pub struct PublisherQueue<M>(Rc<RefCell<Queue<M>>>);

struct Queue<M> {
    topic: &'static str,
    sink: Sink<M>,
    waiting: VecDeque<M>,
    /// At most as many samples wait as a late subscriber would get.
    capacity: usize,
    statistics: SharedStatistics,
}

/// A queue whose waiting samples can be offered again.
pub(crate) trait Flush {
    /// Offers the waiting samples again; returns whether any still wait.
    fn flush(&mut self) -> bool;
}

impl<M> Flush for Queue<M> {
    fn flush(&mut self) -> bool {
        while let Some(sample) = self.waiting.pop_front() {
            let mut statistics = self.statistics.borrow_mut();
            match (self.sink)(sample) {
                Ok(()) => statistics.on(self.topic).sent += 1,
                Err(WriteError::WouldBlock { data }) => {
                    self.waiting.push_front(data);
                    return true;
                }
                Err(error) => statistics.lose(self.topic, &error),
            }
        }
        false
    }
}

impl<M: 'static> PublisherQueue<M> {
    pub(crate) fn new(
        topic: &'static str,
        quality: Quality,
        sink: Sink<M>,
        statistics: SharedStatistics,
    ) -> Self {
        let capacity = match quality {
            Quality::TransientLocal { depth } | Quality::ReliableVolatile { depth } => depth.max(1),
            Quality::BestEffort => 1,
        };
        Self(Rc::new(RefCell::new(Queue {
            topic,
            sink,
            waiting: VecDeque::new(),
            capacity,
            statistics,
        })))
    }

    pub(crate) fn shared(&self) -> Rc<RefCell<dyn Flush>> {
        Rc::<RefCell<Queue<M>>>::clone(&self.0)
    }

    /// Publishes a sample after all samples that wait.
    pub fn publish(&self, sample: M) {
        let mut queue = self.0.borrow_mut();
        let (topic, capacity) = (queue.topic, queue.capacity);
        if queue.waiting.len() >= capacity {
            queue.waiting.pop_front();
            let mut statistics = queue.statistics.borrow_mut();
            // What a queue of one holds is repeated, or replaced by what is newer.
            if capacity == 1 {
                statistics.on(topic).superseded += 1;
            } else {
                statistics.lose(topic, &format_args!("{capacity} samples wait already"));
            }
        }
        queue.waiting.push_back(sample);
        if queue.flush() {
            queue.statistics.borrow_mut().on(topic).delayed += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::topic_statistics::TopicCounts;

    /// Takes as many samples as it has room for.
    #[derive(Default)]
    struct Narrow {
        room: Cell<usize>,
        taken: RefCell<Vec<u32>>,
        statistics: SharedStatistics,
    }

    impl Narrow {
        fn queue(self: &Rc<Self>, depth: usize) -> PublisherQueue<u32> {
            let narrow = Rc::clone(self);
            let sink = move |sample| {
                if sample == 0 {
                    let reason = "zero".to_owned();
                    return Err(WriteError::Serialization { reason, data: 0 });
                }
                if narrow.room.get() == 0 {
                    return Err(WriteError::WouldBlock { data: sample });
                }
                narrow.room.set(narrow.room.get() - 1);
                narrow.taken.borrow_mut().push(sample);
                Ok(())
            };
            let quality = Quality::TransientLocal { depth };
            PublisherQueue::new("test", quality, Box::new(sink), Rc::clone(&self.statistics))
        }

        fn counts(&self) -> TopicCounts {
            self.statistics.borrow().topics()["test"].clone()
        }
    }

    fn flush(queue: &PublisherQueue<u32>) -> bool {
        queue.shared().borrow_mut().flush()
    }

    #[test]
    fn samples_that_find_no_room_wait_in_order() {
        let narrow = Rc::new(Narrow::default());
        let queue = narrow.queue(8);
        narrow.room.set(1);
        for sample in 1..=4 {
            queue.publish(sample);
        }
        assert!(flush(&queue));
        narrow.room.set(10);
        assert!(!flush(&queue));
        queue.publish(5);
        assert!(!flush(&queue));
        assert_eq!(*narrow.taken.borrow(), [1, 2, 3, 4, 5]);
        let counts = narrow.counts();
        assert_eq!((counts.sent, counts.delayed, counts.lost), (5, 3, 0));
    }

    #[test]
    fn a_newer_state_replaces_the_one_that_waits() {
        let narrow = Rc::new(Narrow::default());
        let queue = narrow.queue(1);
        for sample in 1..=3 {
            queue.publish(sample);
        }
        narrow.room.set(10);
        assert!(!flush(&queue));
        assert_eq!(*narrow.taken.borrow(), [3]);
        assert_eq!((narrow.counts().superseded, narrow.counts().lost), (2, 0));
    }

    #[test]
    fn lost_samples_are_counted_and_hold_up_no_other() {
        let narrow = Rc::new(Narrow::default());
        let queue = narrow.queue(2);
        for sample in [1, 0, 2] {
            queue.publish(sample);
        }
        let lost = "the queue of two overflowed, and one sample was broken";
        assert_eq!(narrow.counts().lost, 2, "{lost}");
        narrow.room.set(10);
        assert!(!flush(&queue));
        assert_eq!(*narrow.taken.borrow(), [2]);
    }
}
