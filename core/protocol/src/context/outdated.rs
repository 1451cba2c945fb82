//! Runs that send under earlier numbers than former runs of their modules had, as a clock was set back in between.

use std::time::Duration;

use formation_model::{BodyReport, Incarnation, ModuleId, ModuleRun, Whereabouts};

use super::bodies::{Bodies, Outdated};
use crate::context::Context;
use crate::peers::SILENCES_REMEMBERED;

impl Bodies {
    /// A run sends under a later number than all former ones that are known, or with a plan, so that it keeps its number.
    pub(crate) fn forget_outdated(&mut self, run: ModuleRun, holds_plan: bool) {
        let outdated = self.outdated.get(&run.module);
        if outdated.is_some_and(|outdated| holds_plan || outdated.former <= run.incarnation) {
            self.outdated.remove(&run.module);
        }
    }

    /// A run sends under an earlier number than the known one of its module. Returns whether that is news.
    pub(crate) fn note_outdated(
        &mut self,
        module: ModuleId,
        former: Incarnation,
        now: Duration,
    ) -> bool {
        let known = self.outdated.get(&module);
        let is_new = known.is_none_or(|known| known.former < former);
        if is_new {
            let outdated = Outdated { former, since: now };
            self.outdated.insert(module, outdated);
        }
        is_new
    }

    /// A run has taken the place of a former one: what was reported of that one is about the same body, which the next report
    /// on the present run replaces; and a removal of that one is over.
    pub(crate) fn take_over(&mut self, run: ModuleRun) {
        let Some(known) = self.known.get_mut(&run.module) else {
            return;
        };
        self.version += 1;
        if known.whereabouts == Whereabouts::Removed {
            self.known.remove(&run.module);
        } else {
            known.incarnation = run.incarnation;
            (known.epoch, known.sequence) = (None, 0);
        }
    }

    /// The report on a body, under the number of the former run if the present one has an earlier number: in a state of this
    /// module it makes the former one known to that run.
    pub(crate) fn under_former_number(&self, report: &BodyReport) -> BodyReport {
        let mut report = report.clone();
        if let Some(outdated) = self.outdated.get(&report.module)
            && outdated.former > report.incarnation
        {
            report.incarnation = outdated.former;
            (report.epoch, report.sequence) = (None, 0);
        }
        report
    }

    /// Whether what is known of a module's body is of a later run than this one.
    pub(crate) fn is_of_later_run(&mut self, run: ModuleRun) -> bool {
        if !self.risen.contains(&run.module) {
            return false;
        }
        let known = self.get(run.module);
        let is_later = known.is_some_and(|known| known.incarnation > run.incarnation);
        if !is_later {
            self.risen.remove(&run.module);
        }
        is_later
    }

    /// The reports that make former runs with later numbers known to those that send.
    pub fn of_outdated_runs(&self) -> Vec<BodyReport> {
        let modules = self.outdated.keys();
        let reports = modules.filter_map(|module| self.known.get(module));
        reports
            .map(|report| self.under_former_number(report))
            .collect()
    }
}

impl Context {
    /// A run sends, and holds a plan or not. If the report on its body is about a former run with a later number, which is
    /// silent, the state of this module says so. A run that holds no plan then takes a later number itself.
    /// Enforces M7.
    pub fn note_run(&mut self, run: ModuleRun, holds_plan: bool) {
        self.bodies.forget_outdated(run, holds_plan);
        let known = self.bodies.get(run.module);
        let Some(former) = known.map(|known| known.incarnation) else {
            return;
        };
        let liveness = self.liveness();
        let peer = self.peers.get(run.module);
        let later = peer.filter(|peer| peer.incarnation > run.incarnation);
        if former <= run.incarnation || later.is_some_and(|peer| liveness.includes(peer)) {
            return;
        }
        if peer.is_some_and(|peer| peer.incarnation == run.incarnation) {
            self.bodies.take_over(run);
        }
        if !holds_plan && self.bodies.note_outdated(run.module, former, self.now) {
            self.mark_state_changed();
        }
    }

    /// Whether a module is expected to take a later number soon. One that does not, because it has shown a plan, takes
    /// part as it is after the time for which it would be refused.
    pub fn is_outdated(&self, module: ModuleId) -> bool {
        let limit = self.parameters.suspicion * SILENCES_REMEMBERED;
        let outdated = self.bodies.outdated.get(&module);
        outdated.is_some_and(|outdated| self.now < outdated.since + limit)
    }
}
