//! Executions of motion plans that are stopped on the way, and the problem that is left.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use formation_model::{
    ModuleId, ModuleMotion, MotionPlan, PlanningModule, PlanningProblem, Pose, StepKind, UnitMotion,
};

use super::Numbers;
use super::bodies::{Execution, turned_by};

/// A moment at which all modules of an execution stop.
pub struct Stop<'a> {
    pub problem: &'a PlanningProblem,
    pub plan: &'a MotionPlan,
    pub execution: &'a Execution,
    pub time: f64,
    /// By how much of a step the members of a unit are off its progress, at most: each has its own clock.
    pub unevenness: f64,
}

/// A step that is under way, and which part of it is done.
type Progress = Option<(usize, f64)>;

impl Stop<'_> {
    /// When the last step of the execution ends.
    pub fn last_end(execution: &Execution) -> f64 {
        let ends = execution.times.iter().flatten().map(|&(_, end)| end);
        ends.fold(0.0, f64::max)
    }

    /// How many steps a unit has done, and the one that it is doing.
    fn progress(&self, unit: usize) -> (usize, Progress) {
        let times = &self.execution.times[unit];
        let done = times.partition_point(|&(_, end)| end <= self.time);
        let doing = times.get(done).filter(|&&(begin, _)| begin < self.time);
        let share = |&(begin, end): &(f64, f64)| (done, (self.time - begin) / (end - begin));
        (done, doing.map(share))
    }

    /// Whether some unit is in the middle of a turn or a fold.
    pub fn is_in_mid_fold(&self) -> bool {
        (0..self.plan.units.len()).any(|unit| {
            let (_, doing) = self.progress(unit);
            doing.is_some_and(|(step, _)| {
                let kind = self.plan.units[unit].steps[step].kind;
                matches!(kind, StepKind::Turn { .. } | StepKind::Fold { .. })
            })
        })
    }

    /// The problem that is left: what has docked is pinned, and units that have come onto the lattice are docked to no others.
    pub fn problem_left(&self, numbers: &mut Numbers) -> Arc<PlanningProblem> {
        let mut modules = Vec::new();
        let mut docked: BTreeMap<ModuleId, bool> = BTreeMap::new();
        for (index, unit) in self.plan.units.iter().enumerate() {
            let (done, doing) = self.progress(index);
            let has_docked = unit.docked_at.is_some()
                && done == unit.steps.len()
                && unit.parent.is_none_or(|parent| docked[&parent]);
            docked.insert(unit.lead, has_docked);
            let ids: BTreeSet<ModuleId> = unit.modules.iter().map(|module| module.module).collect();
            for module in &unit.modules {
                let old = self.problem.module(module.module).unwrap();
                let is_joint = done < unit.joint_steps as usize;
                modules.push(PlanningModule {
                    pose: self.pose(unit, module, (done, doing), numbers),
                    pin: module.spot.filter(|_| has_docked),
                    links: if is_joint {
                        old.links.clone()
                    } else {
                        &old.links & &ids
                    },
                    ..old.clone()
                });
            }
        }
        let target = Arc::clone(self.problem.target());
        let parameters = *self.problem.parameters();
        Arc::new(PlanningProblem::new(target, parameters, modules).unwrap())
    }

    fn pose(
        &self,
        unit: &UnitMotion,
        module: &ModuleMotion,
        (done, doing): (usize, Progress),
        numbers: &mut Numbers,
    ) -> Pose {
        let from = module.waypoints[done].pose;
        let Some((step, share)) = doing else {
            return from;
        };
        let off = (numbers.below(2_001) as f64 / 1_000.0 - 1.0) * self.unevenness;
        let share = (share + off).clamp(0.0, 1.0);
        let to = module.waypoints[step + 1].pose;
        let between = |from: f64, to: f64| from + (to - from) * share;
        let (from_theta, to_theta) = (from.theta.to_units(), to.theta.to_units());
        let theta = from_theta + turned_by(from_theta, to_theta) * share;
        if let StepKind::Turn { centre, .. } = unit.steps[step].kind {
            let turned = centre.theta.to_units() * share;
            let (sine, cosine) = turned.sin_cos();
            let (x, y) = (centre.x.to_units(), centre.y.to_units());
            let (right, up) = (from.x.to_units() - x, from.y.to_units() - y);
            let x = x + right * cosine - up * sine;
            let y = y + right * sine + up * cosine;
            return Pose::from_units(x, y, from_theta + turned).unwrap();
        }
        let x = between(from.x.to_units(), to.x.to_units());
        let y = between(from.y.to_units(), to.y.to_units());
        Pose::from_units(x, y, theta).unwrap()
    }
}
