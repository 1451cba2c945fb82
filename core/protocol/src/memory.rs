//! What outlives every stage: the rosters that count, the epochs that were seen, the targets that were announced.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use formation_model::{Epoch, ModuleId, ModuleState, QuorumBasis, TargetAnnouncement, Voter};

use super::quorum::{Founders, Quorum, Shortfall};

/// What a module remembers of agreements and epochs.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Memory {
    pub quorum: Quorum,
    /// The founders of the session; empty while they are not named. Once they are, they stay the same.
    pub founders: Vec<ModuleId>,
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

    pub fn highest_epoch(&self) -> Option<Epoch> {
        self.highest_epoch
    }

    /// The founders that are known, or else those of an announcement, which a roster may have shown to a module that stands
    /// aside.
    fn founders<'a>(known: &'a [ModuleId], target: Option<&'a TargetAnnouncement>) -> Founders<'a> {
        let named = target.map_or(&[][..], |target| &target.founders);
        let named = if known.is_empty() { named } else { known };
        match target.and_then(|target| target.expected_modules) {
            _ if !named.is_empty() => Founders::Named(named),
            Some(number) => Founders::Number(number as usize),
            None => Founders::Unknown,
        }
    }

    /// The first majority that these modules lack.
    /// Enforces Q4.
    pub fn shortfall(
        &self,
        present: &[Voter],
        target: Option<&TargetAnnouncement>,
    ) -> Option<Shortfall> {
        let founders = Self::founders(&self.founders, target);
        self.quorum.shortfall(present, founders)
    }

    /// Adds the quorum bases that frozen modules report, as far as they are credible in a gathering for this epoch.
    pub fn learn_from(
        &mut self,
        frozen: &[Arc<ModuleState>],
        epoch: Epoch,
        target: Option<&TargetAnnouncement>,
    ) {
        let precedes = |state: &&Arc<ModuleState>| {
            let mut bases = state.quorum_bases.iter();
            bases.all(|basis| basis.epoch < epoch)
        };
        let reports: Vec<(Voter, &[QuorumBasis])> = frozen
            .iter()
            .filter(precedes)
            .map(|state| (state.voter(), state.quorum_bases.as_slice()))
            .collect();
        let founders = Self::founders(&self.founders, target);
        self.quorum.learn_from(&reports, founders);
    }

    /// Whether an announcement names other founders than are known.
    pub fn contradicts_founders(&self, announcement: &TargetAnnouncement) -> bool {
        let named = &announcement.founders;
        !named.is_empty() && !self.founders.is_empty() && *named != self.founders
    }

    /// Takes over the founders that an announcement names, unless they are known.
    pub fn note_founders(&mut self, announcement: &TargetAnnouncement) {
        if self.founders.is_empty() {
            self.founders.clone_from(&announcement.founders);
        }
    }

    /// Records an epoch that exists.
    pub fn note_epoch(&mut self, epoch: Epoch) {
        self.highest_epoch = self.highest_epoch.max(Some(epoch));
    }

    /// An epoch that is higher than every known one.
    pub fn next_epoch(&self, convener: ModuleId) -> Epoch {
        Epoch {
            number: self.highest_number() + 1,
            convener,
        }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{Incarnation, PlanningProblem, Scenario};

    fn problem() -> PlanningProblem {
        let yaml = "
target: {spots: [{id: 1, x: 0.0, y: 0.0}], edges: []}
singletons: [{id: 1, x: 5.0, y: 0.0}]
";
        Scenario::from_yaml(yaml).unwrap().problem().clone()
    }

    /// Shows Q4.
    #[test]
    fn founders_whom_an_announcement_names_count_while_none_are_known() {
        let voter = |id| Voter::new(ModuleId(id).run(Incarnation(1)), None);
        let three: Vec<Voter> = (1..=3).map(voter).collect();
        let all: Vec<Voter> = (1..=5).map(voter).collect();
        let by_number = TargetAnnouncement {
            expected_modules: Some(5),
            ..TargetAnnouncement::new(&problem(), 1)
        };
        let by_name = TargetAnnouncement {
            founders: (1..=5).map(ModuleId).collect(),
            ..by_number.clone()
        };
        let memory = Memory::default();
        assert_eq!(memory.shortfall(&three, Some(&by_number)), None);
        assert!(memory.shortfall(&three, Some(&by_name)).is_some());
        assert_eq!(memory.shortfall(&all, Some(&by_name)), None);
        let memory = Memory {
            founders: vec![ModuleId(1), ModuleId(2)],
            ..Memory::default()
        };
        assert_eq!(memory.shortfall(&three, Some(&by_name)), None, "the known");
    }
}
