//! A plan as a solution of the CG:SHOP Challenge 2021: in each step, some robots move by one cell at the same time.

use std::collections::BTreeMap;

use formation_model::{MICRO_PER_UNIT, ModuleMotion, Pose, StepKind, UnitMotion};
use formation_motion::PlannedMotion;
use serde::Serialize;
use thiserror::Error;

use crate::CheckedPlan;

/// What the contest's format cannot say.
#[derive(Debug, Error)]
#[error("the plan is no solution of CG:SHOP: {0}")]
pub struct NoCgshopSolution(String);

/// A solution as the contest's checker reads it.
#[derive(Debug, Serialize)]
pub struct CgshopSolution {
    /// The name of the instance.
    pub instance: String,
    /// The direction of each robot that moves, by its number, in each step.
    pub steps: Vec<BTreeMap<u32, &'static str>>,
}

impl CgshopSolution {
    /// The steps of a plan at their planned times; module r is robot r. In a plan a step begins after the one that leaves its cell, so no
    /// two robots contend for a cell within a step.
    ///
    /// # Errors
    /// There are no paths, or a step is none from a cell to the next.
    pub fn of(instance: &str, plan: &CheckedPlan) -> Result<Self, NoCgshopSolution> {
        let paths = match &plan.motion {
            PlannedMotion::Paths(paths) => paths,
            PlannedMotion::Refused(error) => return Err(NoCgshopSolution(error.to_string())),
        };
        let mut steps = vec![BTreeMap::new(); paths.makespan as usize];
        for unit in &paths.units {
            for module in &unit.modules {
                add(&mut steps, unit, module)?;
            }
        }
        Ok(Self {
            instance: instance.to_owned(),
            steps,
        })
    }
}

fn add(
    steps: &mut [BTreeMap<u32, &'static str>],
    unit: &UnitMotion,
    module: &ModuleMotion,
) -> Result<(), NoCgshopSolution> {
    let legs = module.waypoints.windows(2).zip(&unit.steps);
    for (number, (ends, step)) in (1..).zip(legs) {
        let direction = match step.kind {
            StepKind::Move => direction(ends[0].pose, ends[1].pose),
            _ => None,
        };
        let at = steps.get_mut(step.begin as usize);
        let (Some(direction), Some(at)) = (direction, at) else {
            let reason = format!(
                "step {number} of {} leads from no cell to the next",
                module.module
            );
            return Err(NoCgshopSolution(reason));
        };
        at.insert(module.module.0, direction);
    }
    Ok(())
}

/// North is up: the direction of y.
fn direction(from: Pose, to: Pose) -> Option<&'static str> {
    let is_on_cell = |pose: &Pose| pose.x.0 % MICRO_PER_UNIT == 0 && pose.y.0 % MICRO_PER_UNIT == 0;
    if !is_on_cell(&from) || !is_on_cell(&to) || from.theta != to.theta {
        return None;
    }
    let by = (to.x.0 - from.x.0, to.y.0 - from.y.0);
    match (by.0 / MICRO_PER_UNIT, by.1 / MICRO_PER_UNIT) {
        (0, 1) => Some("N"),
        (1, 0) => Some("E"),
        (0, -1) => Some("S"),
        (-1, 0) => Some("W"),
        _ => None,
    }
}
