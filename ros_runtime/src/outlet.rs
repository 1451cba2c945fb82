//! Publishing without ever waiting and without losing anything unnoticed.

use std::collections::VecDeque;

use ros2_client::{Publisher, WriteError};
use serde::Serialize;

use crate::session::{Session, SessionError};
use crate::topic::{Quality, Topic};
use crate::traffic::Traffic;

/// What a publisher said to a sample that it did not take.
#[derive(Debug)]
pub enum Declined<M> {
    /// Its send window is full; the sample may be offered again.
    Full(M),
    /// It will never take the sample.
    Broken(String),
}

/// Where samples go.
pub trait Sink<M> {
    /// Takes a sample, or says at once that it cannot.
    fn offer(&self, sample: M) -> Result<(), Declined<M>>;
}

impl<M: Serialize> Sink<M> for Publisher<M> {
    fn offer(&self, sample: M) -> Result<(), Declined<M>> {
        self.publish(sample).map_err(declined)
    }
}

/// What the library's refusal of a sample means.
pub fn declined<M>(error: WriteError<M>) -> Declined<M> {
    match error {
        WriteError::WouldBlock { data } => Declined::Full(data),
        other => Declined::Broken(other.forget_data().to_string()),
    }
}

/// A publisher with a bounded queue before it, for samples that the library has no room for.
#[derive(Debug)]
pub struct Outlet<M, S> {
    topic: &'static str,
    sink: S,
    waiting: VecDeque<M>,
    /// As many samples wait as a late subscriber would get, since older ones would be of no use to it either.
    capacity: usize,
    /// Whether a newer sample makes an older one pointless.
    replaces: bool,
}

impl<M: Serialize> Outlet<M, Publisher<M>> {
    /// Opens a publisher of a topic.
    ///
    /// # Errors
    /// Passes on what the DDS library refuses.
    pub fn open(session: &mut Session, topic: &Topic<M>) -> Result<Self, SessionError> {
        Ok(Self::new(topic, session.publisher(topic)?))
    }
}

impl<M, S: Sink<M>> Outlet<M, S> {
    /// A queue in front of a sink.
    pub fn new(topic: &Topic<M>, sink: S) -> Self {
        let (capacity, replaces) = match topic.quality() {
            Quality::TransientLocal { depth } | Quality::ReliableVolatile { depth } => {
                (depth.max(1), depth <= 1)
            }
            Quality::BestEffort => (1, true),
        };
        Self {
            topic: topic.name(),
            sink,
            waiting: VecDeque::new(),
            capacity,
            replaces,
        }
    }

    /// Whether samples wait to be offered again with [`Self::flush`].
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Publishes a sample after all that wait before it.
    pub fn publish(&mut self, sample: M, traffic: &mut Traffic) {
        if self.waiting.len() >= self.capacity {
            self.waiting.pop_front();
            if self.replaces {
                traffic.on(self.topic).superseded += 1;
            } else {
                traffic.lose(
                    self.topic,
                    &format_args!("{} samples wait already", self.capacity),
                );
            }
        }
        self.waiting.push_back(sample);
        self.offer(traffic, true);
    }

    /// Offers again what waits.
    pub fn flush(&mut self, traffic: &mut Traffic) {
        self.offer(traffic, false);
    }

    fn offer(&mut self, traffic: &mut Traffic, newest_is_new: bool) {
        while let Some(sample) = self.waiting.pop_front() {
            match self.sink.offer(sample) {
                Ok(()) => traffic.on(self.topic).sent += 1,
                Err(Declined::Full(sample)) => {
                    self.waiting.push_front(sample);
                    if newest_is_new {
                        traffic.on(self.topic).delayed += 1;
                    }
                    return;
                }
                Err(Declined::Broken(reason)) => traffic.lose(self.topic, &reason),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};

    use super::*;

    fn topic(depth: usize) -> Topic<u32> {
        Topic::new(
            "test",
            "std_msgs",
            "UInt32",
            Quality::TransientLocal { depth },
        )
    }

    /// Takes as many samples as it has room for.
    #[derive(Default)]
    struct Narrow {
        room: Cell<usize>,
        taken: RefCell<Vec<u32>>,
    }

    impl Sink<u32> for &Narrow {
        fn offer(&self, sample: u32) -> Result<(), Declined<u32>> {
            if sample == 0 {
                return Err(Declined::Broken("zero".to_owned()));
            }
            if self.room.get() == 0 {
                return Err(Declined::Full(sample));
            }
            self.room.set(self.room.get() - 1);
            self.taken.borrow_mut().push(sample);
            Ok(())
        }
    }

    #[test]
    fn what_finds_no_room_waits_in_order() {
        let narrow = Narrow::default();
        let mut traffic = Traffic::default();
        let mut outlet = Outlet::new(&topic(8), &narrow);
        narrow.room.set(1);
        for sample in 1..=4 {
            outlet.publish(sample, &mut traffic);
        }
        assert!(outlet.is_waiting());
        narrow.room.set(10);
        outlet.flush(&mut traffic);
        outlet.publish(5, &mut traffic);
        assert!(!outlet.is_waiting());
        assert_eq!(*narrow.taken.borrow(), [1, 2, 3, 4, 5]);
        let counts = traffic.on("test");
        assert_eq!((counts.sent, counts.delayed, counts.lost), (5, 3, 0));
    }

    #[test]
    fn a_newer_state_replaces_the_one_that_waits() {
        let narrow = Narrow::default();
        let mut traffic = Traffic::default();
        let mut outlet = Outlet::new(&topic(1), &narrow);
        for sample in 1..=3 {
            outlet.publish(sample, &mut traffic);
        }
        narrow.room.set(10);
        outlet.flush(&mut traffic);
        assert_eq!(*narrow.taken.borrow(), [3]);
        assert_eq!(traffic.on("test").superseded, 2);
        assert_eq!(traffic.on("test").lost, 0);
    }

    #[test]
    fn what_is_lost_is_counted_and_holds_up_nothing() {
        let narrow = Narrow::default();
        let mut traffic = Traffic::default();
        let mut outlet = Outlet::new(&topic(2), &narrow);
        for sample in [1, 0, 2] {
            outlet.publish(sample, &mut traffic);
        }
        assert_eq!(
            traffic.on("test").lost,
            2,
            "the queue of two overflowed, and one sample was broken"
        );
        narrow.room.set(10);
        outlet.flush(&mut traffic);
        assert_eq!(*narrow.taken.borrow(), [2]);
        assert!(!outlet.is_waiting());
    }
}
