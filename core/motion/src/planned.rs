//! How the modules of a plan move: along paths, in straight lines, or not at all.

use formation_model::{
    ActingUnit, Area, AssemblyWarning, ModuleId, MotionMode, MotionPlan, Plan, PlanningProblem,
    Policy, SpotId, UnitMotion,
};

use super::paths::{
    MotionError, MotionParameters, MotionRequest, plan_motion, plan_shorter, plan_with_swaps,
};

/// How the modules of a plan move. It follows from the problem, the plan and the obstacles alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlannedMotion {
    /// All units at the same time, along paths without contact.
    Paths(MotionPlan),
    /// One unit after another in straight lines, with the reason if paths were wanted. Modules may run into each other.
    Straight(Option<MotionError>),
    /// The problem demands paths, or has obstacles or walls, and there are none: no module moves.
    Refused(MotionError),
}

impl PlannedMotion {
    /// Plans the motion, and gives the plan the units that the motion has. Where a unit cannot get to the spots that it was
    /// claimed, or only far later than the ways are long, equal units swap theirs, except under the policies `paper` and `given`.
    ///
    /// Bodies of modules that take no part stand on `obstacles`.
    /// Enforces X7.
    #[must_use]
    pub fn of(problem: &PlanningProblem, plan: Plan, obstacles: &[Area]) -> (Self, Plan) {
        let mode = problem.parameters().motion;
        if mode == MotionMode::Straight {
            return (Self::Straight(None), plan);
        }
        let surroundings = problem.target().surroundings();
        let request = MotionRequest {
            problem,
            plan: &plan,
            obstacles: &[surroundings.obstacles(), obstacles].concat(),
            walls: surroundings.arena(),
            parameters: MotionParameters::default(),
        };
        let may_swap = !matches!(problem.parameters().policy, Policy::Paper | Policy::Given);
        let found = match plan_motion(&request) {
            Err(error @ MotionError::Unreachable { .. }) if may_swap => {
                let swapped = plan_with_swaps(&request).ok_or(error);
                swapped.map(|(motion, plan)| (motion, Some(plan)))
            }
            Ok(motion) if may_swap => match plan_shorter(&request, &motion) {
                Some((shorter, plan)) => Ok((shorter, Some(plan))),
                None => Ok((motion, None)),
            },
            found => found.map(|motion| (motion, None)),
        };
        match found {
            Ok((motion, swapped)) => {
                let plan = reordered(problem, swapped.unwrap_or(plan), &motion);
                (Self::Paths(motion), plan)
            }
            // Straight lines would lead through obstacles and walls, and no way leads two bodies into one place.
            Err(error)
                if mode == MotionMode::Auto
                    && surroundings.is_open()
                    && !matches!(error, MotionError::BodiesOverlap(..)) =>
            {
                (Self::Straight(Some(error)), plan)
            }
            Err(error) => (Self::Refused(error), plan),
        }
    }

    /// Whether robots may start: nothing is sure to bring them into contact unless the target demands it.
    ///
    /// # Errors
    /// Names the modules or spots for which there are no paths, and the cure.
    pub fn check_for_robots(&self) -> Result<(), String> {
        let Some(error) = self.refusal(true) else {
            return Ok(());
        };
        let cure = error.cure();
        Err(format!(
            "{error}; robots move along paths only, as they could run into each other in straight lines: {cure}, or demand \
             straight lines (planner.motion: straight)"
        ))
    }

    /// Why a module may not move, if so. A robot, which can be damaged, does not follow straight lines that replace paths.
    #[must_use]
    pub fn refusal(&self, is_robot: bool) -> Option<&MotionError> {
        match self {
            Self::Refused(error) => Some(error),
            Self::Straight(error) => error.as_ref().filter(|_| is_robot),
            Self::Paths(_) => None,
        }
    }

    /// The motion plan, if modules move along paths.
    #[must_use]
    pub fn paths(&self) -> Option<&MotionPlan> {
        match self {
            Self::Paths(motion) => Some(motion),
            Self::Straight(_) | Self::Refused(_) => None,
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
    // The others warn of straight lines: along paths no spot is walled in.
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
