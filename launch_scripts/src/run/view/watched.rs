//! What is known of a run while it is watched.

use std::collections::{BTreeMap, VecDeque};

use formation::event_log::{Entry, Scene};
use formation::model::text::ranges;
use formation::model::{Identifier, ModuleId, ModulePhase, SpotId};
use formation::verify::Progress;

use crate::checked_plan::CheckedPlan;

/// How many of the last steps are kept.
pub const LOG_MAX: usize = 20;

/// The state of a spot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotStatus {
    /// No module holds it.
    Free,
    /// A module holds it by the claims.
    Claimed(ModuleId),
    /// Its module moves.
    Awaited(ModuleId),
    /// Its module has settled.
    Filled(ModuleId),
}

/// A unit that is next, and the modules that come before it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Waiting {
    /// The modules of the unit.
    pub modules: Vec<ModuleId>,
    /// The modules for which they wait.
    pub waits_for: Vec<ModuleId>,
}

/// A run as far as the verifier reported it.
pub struct Watched<'a> {
    pub name: &'a str,
    pub plan: &'a CheckedPlan,
    pub progress: Option<Progress>,
    pub scene: Scene,
    /// The position of the initial configuration of each module that is in one.
    configurations: BTreeMap<ModuleId, usize>,
    /// The last steps in words, each with its time in milliseconds.
    pub log: VecDeque<(u64, String)>,
}

impl<'a> Watched<'a> {
    pub fn new(name: &'a str, plan: &'a CheckedPlan) -> Self {
        let configurations = plan.problem.configurations().into_iter().zip(0..);
        Self {
            name,
            plan,
            progress: None,
            scene: Scene::default(),
            configurations: configurations
                .flat_map(|(configuration, position)| {
                    let modules = configuration.modules.into_iter();
                    modules.map(move |module| (module, position))
                })
                .collect(),
            log: VecDeque::new(),
        }
    }

    pub fn take(&mut self, entry: &Entry) {
        for step in self.scene.apply(entry).steps {
            if self.log.len() == LOG_MAX {
                self.log.pop_front();
            }
            self.log.push_back((entry.at_ms, step.to_string()));
        }
    }

    /// The position of a module's initial configuration, if it is in one.
    pub fn configuration_of(&self, module: ModuleId) -> Option<usize> {
        self.configurations.get(&module).copied()
    }

    /// The state of a spot.
    pub fn spot(&self, spot: SpotId) -> SpotStatus {
        let Some(&holder) = self.scene.holders().get(&spot) else {
            return SpotStatus::Free;
        };
        match self.scene.phase_of(holder) {
            Some(ModulePhase::Settled) => SpotStatus::Filled(holder),
            Some(ModulePhase::Moving) => SpotStatus::Awaited(holder),
            _ => SpotStatus::Claimed(holder),
        }
    }

    /// The units whose turn or motion is still to come, in their order; empty where the run does not follow the offline
    /// plan.
    pub fn queue(&self) -> Vec<Waiting> {
        if self.scene.epoch().is_none() || !self.is_as_planned() {
            return Vec::new();
        }
        let turns = &self.plan.outcome.decisions;
        let is_settled =
            |module: &ModuleId| self.scene.phase_of(*module) == Some(ModulePhase::Settled);
        let units: Vec<Vec<ModuleId>> = if self.is_acting() {
            let units = self.plan.outcome.plan.assembly.units.iter();
            units
                .map(|unit| {
                    let placements = unit.placements.iter();
                    let mut modules: Vec<ModuleId> =
                        placements.map(|&(module, _)| module).collect();
                    modules.sort_unstable();
                    modules
                })
                .skip_while(|unit| unit.iter().all(is_settled))
                .collect()
        } else {
            let left = turns.iter().skip(self.scene.decisions().len());
            left.map(|(turn, _)| turn.modules.clone()).collect()
        };
        let mut before = Vec::new();
        units
            .into_iter()
            .map(|modules| Waiting {
                waits_for: std::mem::replace(&mut before, modules.clone()),
                modules,
            })
            .collect()
    }

    /// Whether the epoch began as the offline plan does and every decision so far is the one that the plan has.
    fn is_as_planned(&self) -> bool {
        let planned = &self.plan.outcome.decisions;
        let made = self.scene.decisions();
        let mut pairs = made.iter().zip(planned);
        self.scene.is_fresh_start()
            && made.len() <= planned.len()
            && pairs.all(|((claimant, decision), (turn, planned))| {
                turn.claimant == *claimant && planned == decision
            })
    }

    /// Whether the turns are over and units move.
    pub fn is_acting(&self) -> bool {
        self.scene.decisions().len() >= self.plan.outcome.decisions.len()
    }

    /// The spots of some modules by the claims so far, ascending.
    pub fn spots_of(&self, modules: &[ModuleId]) -> Vec<SpotId> {
        let holders = self.scene.holders().iter();
        holders
            .filter(|(_, holder)| modules.contains(holder))
            .map(|(&spot, _)| spot)
            .collect()
    }
}

/// Numbers for a narrow terminal: `1-4, 7`.
pub fn numbers<I: Identifier>(ids: &[I]) -> String {
    ranges(ids.iter().copied()).replace(',', ", ")
}
