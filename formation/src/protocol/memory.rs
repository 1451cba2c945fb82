//! What outlives every stage: the rosters that count, the epochs that were seen, the targets that were announced.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::model::{Digest, Epoch, ModuleId, TargetAnnouncement, digest};

use super::quorum::Quorum;

/// An epoch further ahead of every known one than this is refused.
const EPOCH_STEP_MAX: u64 = 1 << 20;

/// The number of revisions of the target that are remembered, for conveners that have not received the latest.
const TARGETS_KEPT: usize = 16;

/// What a module remembers of agreements and epochs.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Memory {
    pub quorum: Quorum,
    highest_epoch: Option<Epoch>,
    /// Whether a roster ever listed all expected modules: a module that is absent later may be gone for good.
    pub number_was_met: bool,
    /// In how many epochs since the last agreement members were seen to hold different plans.
    pub mismatches: u32,
}

impl Memory {
    fn highest_number(&self) -> u64 {
        self.highest_epoch.map_or(0, |highest| highest.number)
    }

    /// Records an epoch that exists, unless it is too far ahead to be true.
    pub fn note_epoch(&mut self, epoch: Epoch) {
        if self.is_plausible(epoch) {
            self.highest_epoch = self.highest_epoch.max(Some(epoch));
        }
    }

    /// Whether an epoch is near enough to the highest known one to be true.
    pub fn is_plausible(&self, epoch: Epoch) -> bool {
        epoch.number <= self.highest_number().saturating_add(EPOCH_STEP_MAX)
    }

    /// An epoch that is higher than every known one.
    pub fn next_epoch(&self, convener: ModuleId) -> Epoch {
        Epoch {
            number: self.highest_number() + 1,
            convener,
        }
    }
}

/// The target as announced, and what its latest revisions were.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownTarget {
    announcement: Option<Arc<TargetAnnouncement>>,
    revisions: BTreeMap<u64, Digest>,
}

impl KnownTarget {
    pub fn announcement(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.announcement.as_ref()
    }

    /// Takes over an announcement with a later revision.
    pub fn set(&mut self, announcement: Arc<TargetAnnouncement>) {
        self.revisions
            .insert(announcement.revision, digest::of_target(&announcement));
        while self.revisions.len() > TARGETS_KEPT {
            self.revisions.pop_first();
        }
        self.announcement = Some(announcement);
    }

    /// Whether there is a target that is not withdrawn.
    pub fn is_set(&self) -> bool {
        let known = self.announcement.as_ref();
        known.is_some_and(|known| known.target.is_some())
    }

    pub fn revision(&self) -> Option<u64> {
        Some(self.announcement.as_ref()?.revision)
    }

    /// The target of a revision, if it is one of the latest.
    pub fn at_revision(&self, revision: u64) -> Option<Digest> {
        self.revisions.get(&revision).copied()
    }

    /// The number of modules that take part, if it is announced.
    pub fn expected_modules(&self) -> Option<u32> {
        self.announcement.as_ref()?.expected_modules
    }
}

impl Hash for KnownTarget {
    /// A revision identifies its announcement.
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.revision(), &self.revisions).hash(state);
    }
}
