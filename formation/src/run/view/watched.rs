//! What is known of a run while it is watched.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation_event_log::{Entry, Scene};
use formation_model::text::ranges;
use formation_model::{FormationStage, Identifier, ModuleId, ModulePhase, PlanningProblem, SpotId};
use formation_offline::CheckedPlan;
use formation_verify::Progress;

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

/// A run as far as the verifier reported it.
pub struct Watched {
    pub name: String,
    /// The modules and their target, once they are known.
    pub problem: Option<Arc<PlanningProblem>>,
    /// The plan that the run is to follow, if there is one.
    pub plan: Option<Arc<CheckedPlan>>,
    pub progress: Option<Progress>,
    pub scene: Scene,
    /// The position of the initial configuration of each module that is in one.
    configurations: BTreeMap<ModuleId, usize>,
    /// The last steps in words, each with the time for which the formation had been shown.
    pub log: VecDeque<(Duration, String)>,
}

impl Watched {
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            problem: None,
            plan: None,
            progress: None,
            scene: Scene::default(),
            configurations: BTreeMap::new(),
            log: VecDeque::new(),
        }
    }

    /// Takes in which modules form which target from now on. Until a plan is given there is none.
    pub fn set_problem(&mut self, problem: Arc<PlanningProblem>) {
        let configurations = problem.configurations().into_iter().zip(0..);
        self.configurations = configurations
            .flat_map(|(configuration, position)| {
                let modules = configuration.modules.into_iter();
                modules.map(move |module| (module, position))
            })
            .collect();
        self.problem = Some(problem);
        self.plan = None;
    }

    /// Takes in the plan that the run is to follow.
    pub fn set_plan(&mut self, plan: Arc<CheckedPlan>) {
        self.set_problem(Arc::clone(&plan.problem));
        self.plan = Some(plan);
    }

    /// Takes in something that happened, when the formation had been shown for `elapsed`. The time in the entry is that of another
    /// clock, such as the verifier's.
    pub fn take(&mut self, entry: &Entry, elapsed: Duration) {
        for step in self.scene.apply(entry).steps {
            if self.log.len() == LOG_MAX {
                self.log.pop_front();
            }
            self.log.push_back((elapsed, step.to_string()));
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

    /// The modules of the units whose turn is still to come. Each unit waits for the one before it. Empty once modules move, and where the
    /// run does not follow the offline plan.
    pub fn queue(&self) -> Vec<Vec<ModuleId>> {
        let followed = self.plan.as_ref();
        let Some(plan) = followed.filter(|plan| self.scene.epoch().is_some() && self.follows(plan))
        else {
            return Vec::new();
        };
        if self.is_acting() {
            return Vec::new();
        }
        let turns = plan.outcome.decisions.iter();
        let left = turns.skip(self.scene.decisions().len());
        left.map(|(turn, _)| turn.modules.clone()).collect()
    }

    /// The modules on their way and those that wait for others, while modules move.
    pub fn on_paths(&self) -> Option<(Vec<ModuleId>, Vec<ModuleId>)> {
        let plan = self.plan.as_ref().filter(|plan| self.follows(plan))?;
        if !self.is_acting() || plan.motion.paths().is_none() {
            return None;
        }
        let holders: BTreeSet<ModuleId> = self.scene.holders().values().copied().collect();
        let in_phase = |wanted| {
            let modules = holders.iter().copied();
            let modules = modules.filter(|&module| self.scene.phase_of(module) == Some(wanted));
            modules.collect()
        };
        Some((
            in_phase(ModulePhase::Moving),
            in_phase(ModulePhase::Waiting),
        ))
    }

    /// Whether the epoch began as a plan does and every decision so far is the one that the plan has.
    fn follows(&self, plan: &CheckedPlan) -> bool {
        let planned = &plan.outcome.decisions;
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
        match (&self.plan, &self.progress) {
            (Some(plan), _) => self.scene.decisions().len() >= plan.outcome.decisions.len(),
            (None, Some(progress)) => progress.stage >= FormationStage::Acting,
            (None, None) => false,
        }
    }
}

/// Numbers for a narrow terminal: `1-4, 7`.
pub fn numbers<I: Identifier>(ids: &[I]) -> String {
    ranges(ids.iter().copied()).replace(',', ", ")
}
