//! The messages of one planning, in the protocol or in an auction.

use serde::{Deserialize, Serialize};

/// The messages of one planning, and what the modules had selected in the course of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Talk {
    /// The number of modules.
    pub modules: usize,
    /// The number of spots that can be filled.
    pub fillable_spots: usize,
    /// How long the planning takes: simulated microseconds in the protocol, hundredths of the bids in an auction.
    pub duration: u64,
    /// Messages published: claims and eviction notices in the protocol, bids and new prices in an auction.
    pub samples: usize,
    /// Bids; 0 in the protocol.
    pub bids: usize,
    /// One entry for each claim in the order of publication, or for each hundredth of the bids.
    pub course: Vec<Moment>,
}

/// The state after one claim, or after one hundredth of the bids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moment {
    /// The time since the begin, in the unit of [`Talk::duration`].
    pub at: u64,
    /// Messages published so far.
    pub samples: usize,
    /// (Spot, selector) pairs in the messages so far; each bid and each new price names one.
    pub pairs: usize,
    /// The number of spots that are selected.
    pub selected: usize,
    /// The number of spots that are selected by their final module.
    pub settled: usize,
}

impl Talk {
    /// The number of modules that receive each message.
    pub(crate) fn receivers(&self) -> usize {
        self.modules.saturating_sub(1)
    }

    /// Messages published, times their receivers.
    pub(crate) fn deliveries(&self) -> usize {
        self.samples * self.receivers()
    }

    /// (Spot, selector) pairs in messages, times their receivers.
    pub(crate) fn pairs_delivered(&self) -> usize {
        self.course.last().map_or(0, |last| last.pairs) * self.receivers()
    }

    /// Per cent of the spots that are counted after `percent` of the planning time.
    pub(crate) fn counted_after(&self, percent: f64, count: fn(&Moment) -> usize) -> f64 {
        let time = percent / 100.0 * self.duration as f64;
        let passed = self
            .course
            .partition_point(|moment| moment.at as f64 <= time);
        let last = self.course[..passed].last();
        100.0 * last.map_or(0, count) as f64 / self.fillable_spots as f64
    }
}
