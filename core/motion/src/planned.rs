//! How the modules of a plan move: along paths, or not at all.

use formation_model::{
    ActingUnit, AssemblyWarning, ModuleId, MotionPlan, Plan, PlanningProblem, Policy, SpotId,
    UnitMotion,
};

use super::paths::{
    MotionError, MotionParameters, MotionRequest, plan_motion, plan_shorter, plan_with_swaps,
};

/// How the modules of a plan move. It follows from the problem and the plan alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlannedMotion {
    /// All units at the same time, along paths without contact.
    Paths(MotionPlan),
    /// There are no paths: no module moves.
    Refused(MotionError),
}

impl PlannedMotion {
    /// Plans the motion, and gives the plan the units that the motion has. Where a unit cannot get to the spots that it was
    /// claimed, or only far later than the ways are long, equal units swap theirs, except under the policies `paper` and `given`.
    /// Enforces X7.
    #[must_use]
    pub fn of(problem: &PlanningProblem, plan: Plan) -> (Self, Plan) {
        let all = (!problem.making_room().is_empty()).then(|| problem.of_all_that_move());
        match all {
            Some(Ok(all)) => {
                // Those that make room for others take no spot themselves.
                let is_right = |plan: &Plan| {
                    let mut holders = plan.assignments.keys();
                    holders.all(|&module| problem.position_of(module).is_some())
                };
                Self::of_all(&all, plan, is_right)
            }
            _ => Self::of_all(problem, plan, |_| true),
        }
    }

    /// The motion, with a plan after swaps if that is right.
    fn of_all(
        problem: &PlanningProblem,
        plan: Plan,
        is_right: impl Fn(&Plan) -> bool,
    ) -> (Self, Plan) {
        let surroundings = problem.target().surroundings();
        let request = MotionRequest {
            problem,
            plan: &plan,
            obstacles: &[surroundings.obstacles(), problem.bodies()].concat(),
            walls: surroundings.arena(),
            parameters: MotionParameters::default(),
        };
        let may_swap = !matches!(problem.parameters().policy, Policy::Paper | Policy::Given);
        let found = match plan_motion(&request) {
            Err(error @ MotionError::Unreachable { .. }) if may_swap => {
                let swapped = plan_with_swaps(&request);
                let swapped = swapped.filter(|(_, plan)| is_right(plan));
                let swapped = swapped.ok_or(error);
                swapped.map(|(motion, plan)| (motion, Some(plan)))
            }
            Ok(motion) if may_swap => match plan_shorter(&request, &motion) {
                Some((shorter, plan)) if is_right(&plan) => Ok((shorter, Some(plan))),
                _ => Ok((motion, None)),
            },
            found => found.map(|motion| (motion, None)),
        };
        match found {
            Ok((motion, swapped)) => {
                let plan = reordered(problem, swapped.unwrap_or(plan), &motion);
                (Self::Paths(motion), plan)
            }
            Err(error) => (Self::Refused(error), plan),
        }
    }

    /// Why no module moves, and the cure, if so.
    ///
    /// # Errors
    /// Names the modules or spots for which there are no paths.
    pub fn check(&self) -> Result<(), String> {
        let refusal = self.refusal();
        refusal.map_or(Ok(()), |error| Err(format!("{error}: {}", error.cure())))
    }

    /// Why no module moves, if so.
    #[must_use]
    pub fn refusal(&self) -> Option<&MotionError> {
        match self {
            Self::Refused(error) => Some(error),
            Self::Paths(_) => None,
        }
    }

    /// The motion plan, if modules move.
    #[must_use]
    pub fn paths(&self) -> Option<&MotionPlan> {
        match self {
            Self::Paths(motion) => Some(motion),
            Self::Refused(_) => None,
        }
    }
}

/// The plan with the units and the order of its motion.
fn reordered(problem: &PlanningProblem, mut plan: Plan, motion: &MotionPlan) -> Plan {
    let filled: Vec<(ModuleId, SpotId)> = plan.assembly.placements().collect();
    let unit_of = |unit: &UnitMotion| {
        let is_member = |module: ModuleId| unit.modules.iter().any(|one| one.module == module);
        let placements: Vec<_> = filled
            .iter()
            .filter(|(module, _)| is_member(*module))
            .copied()
            .collect();
        let lead = problem.module(unit.lead);
        (!placements.is_empty()).then(|| ActingUnit {
            lead: unit.lead,
            placements,
            pinned: lead.is_some_and(|lead| lead.pin.is_some()),
        })
    };
    let units = motion.units.iter().filter_map(unit_of).collect();
    plan.assembly.units = units;
    // Along paths no spot is walled in.
    plan.assembly
        .warnings
        .retain(|warning| matches!(warning, AssemblyWarning::Disconnected(_)));
    plan.blocks
        .retain(|block| !motion.taken_apart.contains(block));
    let is_apart = |&(one, other): &(ModuleId, ModuleId)| {
        let mut apart = motion.taken_apart.iter();
        apart.any(|block| block.contains(&one) && block.contains(&other))
    };
    plan.kept_links.retain(|link| !is_apart(link));
    plan
}
