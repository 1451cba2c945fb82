//! The messages of one planning, in the protocol or in an auction.

use serde::{Deserialize, Serialize};

use super::{POINTS, point_at, rounded};
use crate::sample::Sample;

/// The messages of one planning, and what the modules had selected in the course of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Talk {
    /// The number of modules.
    pub modules: usize,
    /// The number of spots that can be filled.
    pub fillable_spots: usize,
    /// How long the planning takes: simulated microseconds in the protocol, bids in an auction.
    pub duration: u64,
    /// Messages published: claims and eviction notices in the protocol, bids and new prices in an auction.
    pub samples: usize,
    /// Claims in the protocol, bids in an auction.
    pub steps: usize,
    /// Pearson's coefficient between pairs and selected spots, over the state after each step.
    pub correlation: f64,
    /// The state after each twentieth of the time: the selected spots, those that their final module selects, and the (spot,
    /// selector) pairs in the messages so far.
    pub course: Vec<[usize; 3]>,
}

/// The state after one claim or one bid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// The time since the begin, in the unit of [`Talk::duration`].
    pub at: u64,
    /// (Spot, selector) pairs in the messages so far; each bid and each new price names one.
    pub pairs: usize,
    /// The number of spots that are selected.
    pub selected: usize,
    /// The number of spots that are selected by their final module.
    pub settled: usize,
}

/// What [`Talk::counted_after`] counts.
#[derive(Clone, Copy)]
pub(crate) enum Count {
    Selected,
    Settled,
    Pairs,
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
        self.pairs_delivered_after(100.0)
    }

    /// The same after `percent` of the planning time, a multiple of 5.
    pub(crate) fn pairs_delivered_after(&self, percent: f64) -> usize {
        self.count(percent, Count::Pairs) * self.receivers()
    }

    /// Per cent of the spots that are counted after `percent` of the planning time, a multiple of 5.
    pub(crate) fn counted_after(&self, percent: f64, count: Count) -> f64 {
        100.0 * self.count(percent, count) as f64 / self.fillable_spots as f64
    }

    fn count(&self, percent: f64, count: Count) -> usize {
        let moment = self.course.get(point_at(percent));
        moment.map_or(0, |moment| moment[count as usize])
    }
}

/// The states of [`Talk::course`] from those after each step.
pub(super) fn course(moments: &[Moment], duration: u64) -> Vec<[usize; 3]> {
    let at = |point: u32| {
        // A state at the very end of a twentieth belongs to it.
        let passed = moments.partition_point(|moment| {
            moment.at * u64::from(POINTS - 1) <= duration * u64::from(point)
        });
        let last = moments[..passed].last().copied().unwrap_or_default();
        [last.selected, last.settled, last.pairs]
    };
    (0..POINTS).map(at).collect()
}

/// [`Talk::correlation`].
pub(super) fn correlation(moments: &[Moment]) -> f64 {
    let points = moments.iter();
    let points = points.map(|moment| (moment.selected as f64, moment.pairs as f64));
    let xs = Sample::of(points.clone().map(|point| point.0));
    let ys = Sample::of(points.clone().map(|point| point.1));
    let products = points.map(|(x, y)| (x - xs.mean) * (y - ys.mean));
    let covariance = products.sum::<f64>() / (moments.len().saturating_sub(1)).max(1) as f64;
    rounded(covariance / (xs.deviation * ys.deviation).max(f64::MIN_POSITIVE))
}
