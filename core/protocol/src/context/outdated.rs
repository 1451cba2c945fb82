//! Runs that send under earlier numbers than former runs of their modules had, as a clock was set back in between.

use formation_model::{BodyReport, ModuleId, ModuleRun, Whereabouts};

use super::bodies::Bodies;
use crate::context::Context;

impl Bodies {
    /// A run has taken the place of a former one: what was reported of that one is about the same body, which the next report
    /// on the present run replaces; and a removal of that one is over.
    fn take_over(&mut self, run: ModuleRun) {
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
        if let Some(&former) = self.outdated.get(&report.module)
            && former > report.incarnation
        {
            report.incarnation = former;
            (report.epoch, report.sequence) = (None, 0);
        }
        report
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
    /// A run sends. If the body of a run with a later number is known, which is silent, the state of this module says so, and that run
    /// takes a later number itself.
    /// Enforces M7.
    pub fn note_run(&mut self, run: ModuleRun) {
        let liveness = self.liveness();
        let peer = self.peers.get(run.module);
        let is_let_in = peer.is_some_and(|peer| peer.incarnation == run.incarnation);
        let known = self.bodies.get(run.module).map(|known| known.incarnation);
        let told = self.bodies.outdated.get(&run.module).copied();
        let former = known.max(told).filter(|&former| former > run.incarnation);
        let Some(former) = former else {
            self.bodies.outdated.remove(&run.module);
            return;
        };
        if !is_let_in && peer.is_some_and(|peer| liveness.includes(peer)) {
            return;
        }
        if is_let_in && known > Some(run.incarnation) {
            self.bodies.take_over(run);
        }
        let is_news = self.bodies.outdated.insert(run.module, former) != Some(former);
        if is_news {
            self.mark_state_changed();
        }
    }

    /// Whether a module is to take a later number before it takes part.
    pub fn is_outdated(&self, module: ModuleId) -> bool {
        self.bodies.outdated.contains_key(&module)
    }
}
