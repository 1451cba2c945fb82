//! The states of one run of a module, in the order in which it published them.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use super::geometry::{Leg, Placed};
use formation_model::{DriveState, Epoch, Incarnation, ModuleId, ModuleState};

/// The greatest number of segments of one module that are kept, the latest ones.
const SEGMENTS_MAX: usize = 32;
/// The greatest number of ends of steps of one module that are kept, the latest ones.
const ENDS_MAX: usize = 16;

/// A module that changes its place publishes states more often than this. One that did not was stopped with its process, and its drive
/// halted by itself somewhere on the way.
const UNSEEN_MAX: Duration = Duration::from_secs(5);

/// What the checks need of a state.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    sequence: u64,
    pub(super) at: Duration,
    pub(super) placed: Placed,
    pub(super) drive: DriveState,
    pub(super) epoch: Option<Epoch>,
    pub(super) steps: Option<u32>,
    pub(super) links: Arc<BTreeSet<ModuleId>>,
    /// The modules to which it may have been docked: a state names the links of when it was published, which is after its pose while the
    /// module moves, so those of the state before may have lasted until then.
    pub(super) may_be_docked: Arc<BTreeSet<ModuleId>>,
}

impl Sample {
    fn of(state: &ModuleState, before: Option<&Self>) -> Self {
        let moves = |drive| matches!(drive, DriveState::Moving | DriveState::Folding);
        let same = before.filter(|before| *before.links == state.links);
        let links = same.map(|before| Arc::clone(&before.links));
        let links = links.unwrap_or_else(|| Arc::new(state.links.clone()));
        let lasting = before.filter(|before| {
            moves(before.drive) && moves(state.drive) && !before.links.is_subset(&state.links)
        });
        let may_be_docked = lasting.map(|before| Arc::new(&*before.links | &*links));
        Self {
            may_be_docked: may_be_docked.unwrap_or_else(|| Arc::clone(&links)),
            links,
            sequence: state.sequence,
            at: state.at.0,
            placed: state.pose.into(),
            drive: state.drive,
            epoch: state.epoch,
            steps: state.steps_done,
        }
    }
}

/// What a module did between two states that follow each other.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) module: ModuleId,
    pub(super) leg: Leg,
    /// The epoch by whose plan it moved.
    pub(super) epoch: Option<Epoch>,
    /// How many steps of its path it had done at the begin; `None` where it carries out no plan.
    pub(super) steps: Option<u32>,
    /// The modules to which it may have been docked.
    pub(super) links: Arc<BTreeSet<ModuleId>>,
}

/// The end of a step, as published.
#[derive(Clone, Debug)]
pub(super) struct StepEnd {
    pub(super) epoch: Epoch,
    /// The number of steps done.
    pub(super) steps: u32,
    pub(super) at: Duration,
    pub(super) placed: Placed,
    pub(super) links: Arc<BTreeSet<ModuleId>>,
    /// Whether the step was a part of a fold.
    pub(super) folded: bool,
    /// When the next step began.
    pub(super) began: Option<Duration>,
}

/// The states of one run of a module.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pub(super) incarnation: Incarnation,
    pub(super) last: Sample,
    pub(super) segments: VecDeque<Segment>,
    pub(super) ends: VecDeque<StepEnd>,
    /// How many states were published that did not arrive.
    pub(super) missed: u64,
    /// Whether a run of a lower number has published since, so that the module may stand elsewhere.
    pub(super) is_doubtful: bool,
}

/// What a state adds to a track.
pub(super) struct Added {
    /// What the module did until then.
    pub(super) segment: Option<Segment>,
    /// The number of steps done, if the state shows that a step has ended, or that one begins.
    pub(super) step: Option<(Epoch, u32)>,
}

impl Track {
    pub(super) fn new(state: &ModuleState) -> Self {
        let last = Sample::of(state, None);
        let mut track = Self {
            incarnation: state.incarnation,
            last,
            segments: VecDeque::new(),
            ends: VecDeque::new(),
            missed: 0,
            is_doubtful: false,
        };
        track.note_step(None);
        track
    }

    /// Takes in the next state of the run; `None` if it is not newer than the latest.
    pub(super) fn advance(&mut self, state: &ModuleState) -> Option<Added> {
        debug_assert_eq!(state.incarnation, self.incarnation);
        let skipped = state
            .sequence
            .checked_sub(self.last.sequence.saturating_add(1))?;
        let next = Sample::of(state, Some(&self.last));
        let before = std::mem::replace(&mut self.last, next);
        self.missed = self.missed.saturating_add(skipped);
        // Where states are missing, the module may have been anywhere; a clock that was set back says nothing, either.
        let stood = before.placed == self.last.placed;
        let passed = self.last.at.checked_sub(before.at);
        // A module that is measured off its way did not drive there, nor did one that stands and carries out no plan.
        let both = [&before, &self.last];
        let is_displaced = both.iter().any(|it| it.drive.is_off_way());
        let is_idle = |it: &&Sample| it.drive == DriveState::Standing && it.steps.is_none();
        let drove = !is_displaced && (stood || !both.iter().all(is_idle));
        let in_time = passed.is_some_and(|passed| stood || passed <= UNSEEN_MAX);
        let follows = skipped == 0 && drove && in_time;
        self.is_doubtful = false;
        let step = self.note_step(follows.then_some(&before));
        let segment = follows.then_some(Segment {
            module: state.module,
            leg: Leg {
                begin: before.at,
                end: self.last.at,
                from: before.placed,
                to: self.last.placed,
            },
            epoch: before.epoch,
            steps: before.steps,
            links: before.may_be_docked,
        });
        if let Some(segment) = &segment {
            self.segments.push_back(segment.clone());
            if self.segments.len() > SEGMENTS_MAX {
                self.segments.pop_front();
            }
        }
        Some(Added { segment, step })
    }

    /// Notes that a step ended, or that the next one began.
    fn note_step(&mut self, before: Option<&Sample>) -> Option<(Epoch, u32)> {
        let Sample {
            epoch,
            steps,
            at,
            placed,
            drive,
            ..
        } = self.last;
        let (epoch, steps) = (epoch?, steps?);
        if drive.is_off_way() {
            return None;
        }
        let drives = matches!(drive, DriveState::Moving | DriveState::Folding);
        let began = drives.then_some(at);
        let mut ends = self.ends.iter_mut().rev();
        if let Some(end) = ends.find(|end| (end.epoch, end.steps) == (epoch, steps)) {
            if end.began.is_some() || began.is_none() {
                return None;
            }
            end.began = began;
            return Some((epoch, steps));
        }
        let was = before.filter(|before| before.epoch == Some(epoch));
        let was = was.and_then(|before| Some((before.steps?, before.drive)));
        // Without the state before, the pose may lie anywhere within a step.
        let has_ended = match was {
            Some((before, _)) => before.checked_add(1) == Some(steps),
            None => steps == 0 && drive == DriveState::Standing,
        };
        if !has_ended {
            return None;
        }
        self.ends.push_back(StepEnd {
            epoch,
            steps,
            at,
            placed,
            links: Arc::clone(&self.last.links),
            folded: was.is_some_and(|(_, drive)| drive == DriveState::Folding),
            began,
        });
        if self.ends.len() > ENDS_MAX {
            self.ends.pop_front();
        }
        Some((epoch, steps))
    }

    /// The end of a step, if it was seen.
    pub(super) fn end(&self, epoch: Epoch, steps: u32) -> Option<&StepEnd> {
        let mut ends = self.ends.iter().rev();
        ends.find(|end| (end.epoch, end.steps) == (epoch, steps))
    }

    /// Whether all states of a time are known, up to the latest one.
    pub(super) fn is_whole(&self, begin: Duration, end: Duration) -> bool {
        let mut known = begin;
        for leg in self.segments.iter().map(|segment| &segment.leg) {
            if leg.begin <= known {
                known = known.max(leg.end);
            }
        }
        known >= end || self.last.at <= known && !self.is_doubtful
    }

    /// Where the module has stood since its last state, up to a time; `None` if it moves, or may have stood elsewhere.
    pub(super) fn rest(&self, module: ModuleId, until: Duration) -> Option<Segment> {
        let Sample {
            at, placed, drive, ..
        } = self.last;
        let stands = drive == DriveState::Standing && !self.is_doubtful;
        (stands && at < until).then_some(Segment {
            module,
            leg: Leg {
                begin: at,
                end: until,
                from: placed,
                to: placed,
            },
            epoch: self.last.epoch,
            steps: self.last.steps,
            links: Arc::clone(&self.last.links),
        })
    }
}
