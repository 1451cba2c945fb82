//! The plans of an agent: jobs that its host may run on another thread, and share between agents.
//!
//! A plan can take seconds, in which a process must go on sending heartbeats. An agent therefore asks for its plan
//! ([`Output::Compute`](super::Output::Compute)) and continues when the plan comes ([`Input::Computed`]); meanwhile it shows the phase COMPUTING.
//! The alternative, planning in slices between heartbeats, would have to interrupt every search of the planner, and its
//! slices would still have to be short against the heartbeats of the slowest machine.
//!
//! A plan follows from its problem alone, and only [`PlanJob::run`] makes a [`ComputedPlan`]. What an agent takes from a
//! host therefore equals what it would have computed, and one computation serves all agents of a process
//! ([`SharedPlans`]). An agent takes no other plan than the one that it asked for.
//!
//! [`Input::Computed`]: super::Input::Computed

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, OnceLock};

use formation_model::{ClosedRoster, ModuleId, Plan, PlanningProblem, digest};
use formation_motion::PlannedMotion;
use formation_planner::{PlannedTurns, plan_releasing_pins};

use super::indexed_motion::IndexedMotion;
use super::roster_plan::RosterPlan;

/// The number of plans that are kept for other agents and for the next epoch.
const PLANS_KEPT: usize = 3;

/// A plan that an agent needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanJob {
    problem: Arc<PlanningProblem>,
    /// Whether the pins that wall in spots are released first.
    releases_pins: bool,
}

/// The result of a job.
#[derive(Clone, Debug)]
pub struct ComputedPlan {
    job: PlanJob,
    turns: PlannedTurns,
    motion: Arc<IndexedMotion>,
    plan: Arc<Plan>,
    /// What follows with the first roster that it was computed for.
    for_roster: OnceLock<(Arc<ClosedRoster>, Arc<RosterPlan>)>,
}

impl PlanJob {
    /// The plan for a problem as it is.
    pub(super) fn plan(problem: Arc<PlanningProblem>) -> Self {
        Self {
            problem,
            releases_pins: false,
        }
    }

    /// The plan for a problem after the release of the pins that wall in spots.
    pub(super) fn release(problem: Arc<PlanningProblem>) -> Self {
        Self {
            problem,
            releases_pins: true,
        }
    }

    /// Computes the plan. Depends on nothing else, so it may run on any thread.
    #[must_use]
    pub fn run(self) -> ComputedPlan {
        let problem = Arc::clone(&self.problem);
        let turns = if self.releases_pins {
            plan_releasing_pins(problem)
        } else {
            PlannedTurns::of(problem)
        };
        let plan = Plan::clone(turns.plan());
        let (motion, plan) = PlannedMotion::of(turns.problem(), plan);
        ComputedPlan {
            job: self,
            turns: turns.with_swaps(&plan.swaps),
            motion: Arc::new(IndexedMotion::of(motion)),
            plan: Arc::new(plan),
            for_roster: OnceLock::new(),
        }
    }
}

impl ComputedPlan {
    /// Every turn.
    pub(super) fn turns(&self) -> &PlannedTurns {
        &self.turns
    }

    /// How the modules move.
    pub(super) fn motion(&self) -> &Arc<IndexedMotion> {
        &self.motion
    }

    /// The plan after the last turn, with the acting order of the motion.
    pub(super) fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// What follows with a roster. All agents of a process need the same, and its digest alone takes some milliseconds with a
    /// thousand modules.
    /// Enforces T5.
    pub(super) fn for_roster(&self, roster: &Arc<ClosedRoster>) -> Arc<RosterPlan> {
        let compute = || {
            let digest = digest::of_plan(
                roster,
                self.turns.decisions(),
                self.motion.planned().paths(),
            );
            Arc::new(RosterPlan::of(roster, &self.plan, digest))
        };
        let (known, shared) = self
            .for_roster
            .get_or_init(|| (Arc::clone(roster), compute()));
        if Arc::ptr_eq(known, roster) {
            Arc::clone(shared)
        } else {
            compute()
        }
    }

    /// Whether this is the plan of a job. After a release of pins it is also the plan for the pins that stay.
    pub(super) fn answers(&self, job: &PlanJob) -> bool {
        let is_for_rest = !job.releases_pins && *self.turns.problem() == job.problem;
        is_for_rest || self.job == *job
    }
}

/// The plans of a host: what its agents wait for, what runs, and what was computed lately.
#[derive(Debug, Default)]
pub struct SharedPlans {
    /// The job that each agent waits for.
    waiting: BTreeMap<ModuleId, PlanJob>,
    /// The modules that asked for a job that no other had asked for, in this order.
    queue: VecDeque<ModuleId>,
    running: Option<PlanJob>,
    computed: VecDeque<Arc<ComputedPlan>>,
}

impl SharedPlans {
    /// Takes the request of an agent, in the place of its last one. Returns the plan if it is known.
    /// Enforces T5.
    pub fn ask(&mut self, module: ModuleId, job: PlanJob) -> Option<Arc<ComputedPlan>> {
        self.waiting.remove(&module);
        let mut computed = self.computed.iter();
        if let Some(known) = computed.find(|computed| computed.answers(&job)) {
            return Some(Arc::clone(known));
        }
        self.waiting.insert(module, job);
        self.queue.retain(|&other| other != module);
        self.queue.push_back(module);
        None
    }

    /// The next job to run; `None` while another runs, or if no agent waits.
    pub fn next_job(&mut self) -> Option<PlanJob> {
        if self.running.is_some() {
            return None;
        }
        let module = self.queue.pop_front()?;
        self.running = self.waiting.get(&module).cloned();
        self.running.clone()
    }

    /// Takes the result of a job. Returns the modules that waited for it.
    pub fn finish(&mut self, computed: Arc<ComputedPlan>) -> Vec<ModuleId> {
        self.running.take_if(|job| *job == computed.job);
        let served: Vec<ModuleId> = self
            .waiting
            .iter()
            .filter(|(_, job)| computed.answers(job))
            .map(|(&module, _)| module)
            .collect();
        for module in &served {
            self.waiting.remove(module);
        }
        self.queue.retain(|module| !served.contains(module));
        self.computed.push_front(computed);
        self.computed.truncate(PLANS_KEPT);
        served
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::AgentParameters;
    use formation_generate::{GeneratorParameters, Grouping, generate};
    use formation_model::{
        BodyReport, Epoch, Incarnation, Polyline, Pose, Roster, RosterMember, Scenario, Service,
        TargetAnnouncement, Voters, Whereabouts, standing_bodies,
    };

    pub(crate) fn problem(seed: u64) -> Arc<PlanningProblem> {
        let parameters = GeneratorParameters::new(6, 6, seed).grouped(Grouping::Mixed);
        let raw = generate(&parameters).unwrap();
        Arc::new(Scenario::try_from(raw).unwrap().problem().clone())
    }

    /// The roster of the first epoch, which lists the modules of a problem.
    pub(crate) fn roster(problem: &PlanningProblem) -> Roster {
        let members = problem.modules().iter().map(|module| RosterMember {
            incarnation: Incarnation(1),
            knows: true,
            is_idle: true,
            service: Service::Active,
            module: module.clone(),
        });
        let mut target = TargetAnnouncement::new(problem, 1);
        target.expected_modules = None;
        Roster {
            epoch: Epoch {
                number: 1,
                convener: ModuleId(1),
            },
            target,
            members: members.collect(),
            voters: Voters::default(),
            timing: AgentParameters::default().timing(),
            bodies: Vec::new(),
        }
    }

    pub(crate) fn job(seed: u64) -> PlanJob {
        PlanJob::plan(problem(seed))
    }

    #[test]
    fn a_long_path_of_a_body_makes_few_obstacles() {
        let mut roster = roster(&problem(1));
        let corner = |units: f64| Pose::from_units(units, units, 0.0).unwrap();
        let mut of_path = |ends: &[f64]| {
            let path: Vec<Pose> = ends.iter().copied().map(corner).collect();
            roster.bodies = vec![BodyReport {
                module: ModuleId(9_000),
                incarnation: Incarnation(1),
                epoch: None,
                sequence: 1,
                whereabouts: Whereabouts::OnTheWay(Polyline::try_from(path).unwrap()),
            }];
            standing_bodies(&roster).len()
        };
        // 14.1 units long; a body each half unit, and at both ends.
        assert_eq!(of_path(&[0.0, 10.0]), 30);
        let far = [-1.0e6, 1.0e6];
        let ends: Vec<f64> = far.into_iter().cycle().take(255).collect();
        assert_eq!(of_path(&ends), 254);
    }

    #[test]
    fn agents_that_ask_for_the_same_share_one_plan() {
        let mut plans = SharedPlans::default();
        let modules: Vec<ModuleId> = (0..4).map(ModuleId).collect();
        for &module in &modules[..3] {
            assert!(plans.ask(module, job(1)).is_none());
        }
        assert!(plans.ask(modules[3], job(2)).is_none());
        let first = plans.next_job().unwrap();
        assert_eq!(plans.next_job(), None, "one runs already");
        // This one now needs another plan.
        assert!(plans.ask(modules[2], job(2)).is_none());
        let first = Arc::new(first.run());
        assert_eq!(plans.finish(Arc::clone(&first)), modules[..2]);
        let second = plans.next_job().unwrap();
        assert_eq!(plans.finish(Arc::new(second.run())), modules[2..]);
        assert_eq!(plans.next_job(), None);
        // The next epoch may have the same problem.
        let known = plans.ask(modules[3], job(1)).unwrap();
        assert!(Arc::ptr_eq(&known, &first));
        assert_eq!(
            known.turns,
            PlannedTurns::of(problem(1)),
            "what an agent would have computed"
        );
    }

    #[test]
    fn a_release_of_pins_answers_for_the_pins_that_stay() {
        let job = PlanJob::release(problem(3));
        let mut plans = SharedPlans::default();
        assert!(plans.ask(ModuleId(1), job.clone()).is_none());
        let computed = Arc::new(plans.next_job().unwrap().run());
        assert_eq!(plans.finish(Arc::clone(&computed)), [ModuleId(1)]);
        assert!(plans.ask(ModuleId(1), job).is_some());
        let kept = Arc::clone(computed.turns.problem());
        assert!(plans.ask(ModuleId(2), PlanJob::plan(kept)).is_some());
    }

    #[test]
    fn agents_of_one_process_share_what_follows_from_a_roster() {
        let computed = job(6).run();
        let problem = problem(6);
        let roster = roster(&problem);
        let mut later = roster.clone();
        later.epoch.number = 2;
        let [roster, later] = [roster, later].map(|roster| Arc::new(ClosedRoster::from(roster)));
        let problems = [roster.problem(), roster.problem()].map(|known| known.unwrap().unwrap());
        assert!(Arc::ptr_eq(&problems[0], &problems[1]));
        assert_eq!(problems[0], problem);
        let plans = [&roster, &roster, &later].map(|roster| computed.for_roster(roster));
        assert!(Arc::ptr_eq(&plans[0], &plans[1]));
        assert_ne!(plans[0].digest, plans[2].digest, "of another epoch");
        let holders = plans[0].places.iter();
        let spots: BTreeMap<_, _> = holders
            .map(|(&module, place)| (module, place.spot))
            .collect();
        assert_eq!(spots, computed.plan().assignments);
    }
}
