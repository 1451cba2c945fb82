//! The progress of a formation, and the agreement on its plan.

use super::end_state::EndState;
use super::observation::Observer;
use super::verdict::{Agreement, Progress};
use crate::Missing;
use formation_model::{FormationStage, ModuleId};

impl Observer {
    /// The progress of the formation.
    pub fn progress(&self) -> Progress {
        let target = self
            .target()
            .and_then(|announced| announced.target.as_ref());
        let without_plan = if target.is_some() {
            FormationStage::Gathering
        } else {
            FormationStage::WaitingForTarget
        };
        let mut progress = Progress {
            stage: without_plan,
            epoch: None,
            joined: self.received.modules.len(),
            expected: self.expected_count(),
            planned: 0,
            agreed: 0,
            settled: 0,
            to_fill: 0,
            stopped: self.is_stopped(),
            waiting_for: self.absent().collect(),
        };
        let Some(planned) = self.received.newest() else {
            return progress;
        };
        let end = EndState::new(&self.received, planned);
        let missing = end.missing();
        progress.epoch = Some(planned.epoch);
        progress.planned = end.claimed.replay.spots.len();
        progress.agreed = end.agreed();
        progress.settled = end.assignments().len();
        progress.to_fill = planned.problem.fillable_count();
        progress.stage = if self.received.is_outdated(planned.roster) {
            without_plan
        } else if missing.is_empty() {
            FormationStage::Done
        } else if !end.claims_are_whole() {
            FormationStage::Planning
        } else if end.is_agreed() {
            FormationStage::Acting
        } else {
            FormationStage::Agreeing
        };
        let is_acting = progress.stage >= FormationStage::Acting;
        let waiting_for = |missing: &Missing| -> Option<ModuleId> {
            match *missing {
                Missing::Agreement { module, .. } => Some(module),
                Missing::Settled { module, .. } | Missing::Spare { module, .. } => {
                    is_acting.then_some(module)
                }
                _ => None,
            }
        };
        let members = missing.iter().filter_map(waiting_for);
        progress.waiting_for.extend(members);
        progress.waiting_for.sort_unstable();
        progress.waiting_for.dedup();
        progress
    }

    /// The newest plan, once all its members agree on it; `None` before, and once a newer target is announced.
    pub fn agreement(&self) -> Option<Agreement> {
        let planned = self.received.current()?;
        let end = EndState::new(&self.received, planned);
        if !end.is_agreed() || !end.claims_are_whole() {
            return None;
        }
        let roster_received = planned.roster.received;
        let last_claim = end.claimed.last_received.unwrap_or(roster_received);
        Some(Agreement {
            epoch: planned.epoch,
            planning: last_claim.saturating_sub(roster_received),
            violations: self.received.violations_in(planned.epoch, planned.record),
            assignments: end.claimed.replay.spots,
        })
    }

    /// The number of modules that the announcement or the parameters expect.
    pub(super) fn expected_count(&self) -> Option<usize> {
        let announced = self.target().and_then(|target| target.expected_modules);
        let announced = announced.and_then(|count| usize::try_from(count).ok());
        let named = self.parameters.expected.len();
        announced.or((named > 0).then_some(named))
    }

    /// The expected modules of which no message was received.
    pub(super) fn absent(&self) -> impl Iterator<Item = ModuleId> + '_ {
        let expected = self.parameters.expected.iter().copied();
        expected.filter(|module| !self.received.modules.contains_key(module))
    }
}
