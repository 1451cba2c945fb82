//! The plans of an agent: jobs that its host may run on another thread, and share between agents.
//!
//! A plan can take seconds, in which a process must go on sending heartbeats. An agent therefore asks for its plan
//! ([`Output::Compute`](super::Output::Compute)) and continues when the plan comes ([`Input::Computed`]); meanwhile it shows the phase COMPUTING.
//! The alternative, planning in slices between heartbeats, would have to interrupt every search of the planner, and its
//! slices would still have to be short against the heartbeats of the slowest machine.
//!
//! A plan follows from its problem alone, and only [`PlanJob::run`] makes a [`ComputedPlan`]. What an agent takes from a
//! host therefore equals what it would have computed, and one computation serves all agents of a process
//! ([`Replica::next_job`](super::Replica::next_job)). An agent takes no other plan than the one that it asked for.
//!
//! [`Input::Computed`]: super::Input::Computed

use std::sync::{Arc, OnceLock};

use formation_model::{ClosedRoster, Plan, PlanningProblem, digest};
use formation_motion::PlannedMotion;
use formation_planner::{PlannedTurns, plan_releasing_pins};

use super::indexed_motion::IndexedMotion;
use super::roster_plan::RosterPlan;

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

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::AgentParameters;
    use formation_generate::{GeneratorParameters, Grouping, generate};
    use formation_model::{
        BodyReport, Epoch, Incarnation, ModuleId, Polyline, Pose, Roster, RosterMember, Scenario,
        Service, TargetAnnouncement, Voters, Whereabouts, standing_bodies,
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
    fn a_release_of_pins_answers_for_the_pins_that_stay() {
        let job = PlanJob::release(problem(3));
        let computed = job.clone().run();
        assert!(computed.answers(&job));
        let kept = Arc::clone(computed.turns.problem());
        assert!(computed.answers(&PlanJob::plan(kept)));
        assert!(!computed.answers(&PlanJob::plan(problem(4))));
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
