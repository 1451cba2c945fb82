//! This module's part in a motion plan: the steps of its unit, and what each step waits for.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use formation_model::{
    MICRO_PER_UNIT, MicroUnits, ModuleId, ModuleMotion, Pose, StepKind, UnitMotion,
};
use formation_motion::MotionGoal;

use super::off_path::OffPath;
use crate::indexed_motion::IndexedMotion;

/// How the modules of a plan move, and what this module does.
#[derive(Clone)]
pub(super) struct HeldMotion {
    pub paths: Arc<IndexedMotion>,
    /// This module's part, if there are paths.
    pub route: Option<Route>,
    /// The other members that are measured off their ways.
    pub off_path: BTreeMap<ModuleId, OffPath>,
}

impl HeldMotion {
    /// The motion of a plan, for one of the members.
    pub fn of(own: ModuleId, paths: &Arc<IndexedMotion>) -> Self {
        Self {
            route: Route::of(own, paths),
            off_path: BTreeMap::new(),
            paths: Arc::clone(paths),
        }
    }
}

/// The part of one module in a motion plan. Steps count from 1.
#[derive(Clone)]
pub(super) struct Route {
    motion: Arc<IndexedMotion>,
    unit: usize,
    member: usize,
    /// The steps of this module's unit for whose end other units wait.
    awaited_ends: BTreeSet<u32>,
}

impl Route {
    /// The part of a module; `None` if the plan has no paths, or none for this module.
    pub fn of(own: ModuleId, motion: &Arc<IndexedMotion>) -> Option<Self> {
        let (unit, member) = motion.position_of(own)?;
        let lead = motion.units().get(unit)?.lead;
        let waits = motion.units().iter().flat_map(|unit| &unit.waits);
        Some(Self {
            unit,
            member,
            awaited_ends: waits
                .filter(|wait| wait.unit == lead)
                .map(|wait| wait.steps_done)
                .collect(),
            motion: Arc::clone(motion),
        })
    }

    /// All units of the plan.
    pub fn units(&self) -> &[UnitMotion] {
        self.motion.units()
    }

    /// The unit of this module.
    fn own(&self) -> &UnitMotion {
        &self.units()[self.unit]
    }

    /// The modules of the unit to which this module's unit docks.
    pub fn parents(&self) -> impl Iterator<Item = ModuleId> {
        let lead = self.own().parent.as_ref();
        let unit = lead.and_then(|&lead| self.motion.unit(lead));
        let modules = unit.into_iter().flat_map(|unit| &unit.modules);
        modules.map(|module| module.module)
    }

    /// The number of its steps.
    pub fn steps(&self) -> u32 {
        u32::try_from(self.own().steps.len()).unwrap_or(u32::MAX)
    }

    /// Whether the module has undocked from other units before this step begins: all steps but the joint ones.
    pub fn is_apart(&self, step: u32) -> bool {
        step > self.own().joint_steps
    }

    /// The modules that take a step as one body, with this one.
    pub fn companions(&self, step: u32) -> BTreeSet<ModuleId> {
        let own = self.own();
        let joint =
            |unit: &&UnitMotion| !self.is_apart(step) && own.joint_with.contains(&unit.lead);
        let units = self.units().iter().filter(joint).chain([own]);
        let modules = units.flat_map(|unit| &unit.modules);
        modules.map(|one| one.module).collect()
    }

    /// Whether other modules wait for the end of this step.
    pub fn is_awaited(&self, step: u32) -> bool {
        let unit = self.own();
        let is_joint = step <= unit.joint_steps && !unit.joint_with.is_empty();
        is_joint || unit.modules.len() > 1 || self.awaited_ends.contains(&step)
    }

    /// Whether a step waits for steps of other units.
    pub fn has_waits(&self, step: u32) -> bool {
        self.own().waits.iter().any(|wait| wait.step == step)
    }

    /// Whether the modules of the unit may overlap each other during a step.
    pub fn folds(&self, step: u32) -> bool {
        let step = step.checked_sub(1).map(|index| index as usize);
        let step = step.and_then(|index| self.own().steps.get(index));
        step.is_some_and(|step| matches!(step.kind, StepKind::Fold { .. } | StepKind::Regroup))
    }

    /// Whether a step leads on in the direction of the one before.
    pub fn goes_on(&self, step: u32) -> bool {
        let waypoints = &self.own().modules[self.member].waypoints;
        let step = step as usize;
        let Some(around) = step.checked_sub(2).and_then(|at| waypoints.get(at..=step)) else {
            return false;
        };
        let along = |from: usize| {
            let (from, to) = (around[from].pose, around[from + 1].pose);
            (
                to.x.0 - from.x.0,
                to.y.0 - from.y.0,
                to.theta.0 - from.theta.0,
            )
        };
        along(0) == along(1)
    }

    /// Where a step and all after it lead.
    pub fn poses_from(&self, step: u32) -> impl Iterator<Item = Pose> {
        let waypoints = self.own().modules[self.member].waypoints.iter();
        waypoints.skip(step as usize).map(|waypoint| waypoint.pose)
    }

    /// Where a step leads.
    pub fn goal(&self, step: u32) -> Option<MotionGoal> {
        let unit = self.own();
        let index = step.checked_sub(1)? as usize;
        let ends = |module: &ModuleMotion| {
            let pair = module.waypoints.get(index..=index + 1)?;
            Some((pair[0].pose, pair[1].pose))
        };
        let (_, pose) = ends(&unit.modules[self.member])?;
        let distances = unit.modules.iter().filter_map(ends);
        let distance = distances.map(|(from, to)| from.distance_to(&to)).max()?;
        let (pivot, distance) = match unit.steps.get(index)?.kind {
            StepKind::Turn { centre, radius } => {
                let arc = i128::from(centre.theta.0.abs()) * i128::from(radius.0);
                let arc = i64::try_from(arc / i128::from(MICRO_PER_UNIT)).unwrap_or(i64::MAX);
                (Some(centre), MicroUnits(arc))
            }
            _ => (None, distance),
        };
        Some(MotionGoal {
            pose,
            unit_distance: distance,
            pivot,
        })
    }

    /// The modules that have not done as many steps as the next step of this module waits for.
    pub fn awaited(&self, step: u32, done: impl Fn(ModuleId) -> u32) -> Vec<ModuleId> {
        self.awaited_by(self.own(), step, done)
    }

    /// The modules that have not done as many steps as a step of a unit waits for. All modules that do a step together
    /// must have done the one before.
    /// Enforces X8.
    pub fn awaited_by(
        &self,
        unit: &UnitMotion,
        step: u32,
        done: impl Fn(ModuleId) -> u32,
    ) -> Vec<ModuleId> {
        // What was docked at the start parts when all of it has done the last joint step.
        let team = self.team(unit, step.saturating_sub(1) <= unit.joint_steps);
        let before = step.saturating_sub(1);
        let mut awaited: Vec<ModuleId> = team.filter(|&module| done(module) < before).collect();
        for wait in unit.waits.iter().filter(|wait| wait.step == step) {
            let Some(other) = self.motion.unit(wait.unit) else {
                continue;
            };
            let team = self.team(other, wait.steps_done <= other.joint_steps);
            awaited.extend(team.filter(|&module| done(module) < wait.steps_done));
        }
        awaited
    }

    /// The modules of a unit, and of those that were docked to it at the start if it still moves with them.
    fn team<'a>(&'a self, unit: &'a UnitMotion, jointly: bool) -> impl Iterator<Item = ModuleId> {
        let others = unit.joint_with.iter().filter(move |_| jointly);
        let others = others.filter_map(|&lead| self.motion.unit(lead));
        let modules = std::iter::once(unit)
            .chain(others)
            .flat_map(|unit| &unit.modules);
        modules.map(|module| module.module)
    }
}
