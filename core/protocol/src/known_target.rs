//! The target as announced.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use formation_model::TargetAnnouncement;

/// The target as announced.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownTarget {
    announcement: Option<Arc<TargetAnnouncement>>,
}

impl KnownTarget {
    pub fn announcement(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.announcement.as_ref()
    }

    /// Takes over an announcement with a later revision.
    pub fn set(&mut self, announcement: Arc<TargetAnnouncement>) {
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

    /// The number of modules that take part, if it is announced.
    pub fn expected_modules(&self) -> Option<u32> {
        self.announcement.as_ref()?.expected_modules
    }
}

impl Hash for KnownTarget {
    /// A revision identifies its announcement.
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.revision().hash(state);
    }
}
