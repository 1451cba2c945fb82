//! The motion of a plan as `formation plan` prints it.

use formation_model::text::counted;
use formation_model::{ModuleId, ModuleMotion, MotionPlan, UnitMotion, Variant};
use formation_motion::PlannedMotion;
use serde::Serialize;

/// How the modules of a plan move.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum MotionSummary {
    /// Along paths without contact.
    Paths(Paths),
    /// Not at all.
    None {
        /// `none`.
        mode: &'static str,
        collision_free: bool,
        /// Why there are no paths.
        error: String,
    },
}

/// Paths without contact; plan time counts steps.
#[derive(Debug, Serialize)]
pub struct Paths {
    /// `paths`.
    mode: &'static str,
    collision_free: bool,
    /// When the last step ends.
    makespan: u32,
    /// No plan ends earlier: the most steps that any unit needs.
    bound: u32,
    /// The same as `bound`, for programs that read this key.
    longest_path: u32,
    /// `edges`: each unit docks along an edge of the target. For programs that read this key.
    order: &'static str,
    /// `lazy`, `eager` or `serial`.
    variant: &'static str,
    /// Blocks that move as single modules.
    taken_apart: Vec<Vec<ModuleId>>,
    modules: Vec<ModulePath>,
}

/// The path of one module, and what the steps of its unit wait for.
#[derive(Debug, Serialize)]
struct ModulePath {
    module: ModuleId,
    /// The lowest module of its unit.
    unit: ModuleId,
    /// `[x, y, theta, t]`: the start, then the pose after each step.
    waypoints: Vec<[f64; 4]>,
    /// `[step, unit, steps_done]`: the step, counted from 1, begins when that unit has done this number of steps.
    waits: Vec<[u32; 3]>,
}

impl MotionSummary {
    /// What to print as JSON.
    pub fn of(motion: &PlannedMotion) -> Self {
        match motion {
            PlannedMotion::Paths(plan) => Self::Paths(Paths::of(plan)),
            PlannedMotion::Refused(error) => Self::None {
                mode: "none",
                collision_free: false,
                error: error.to_string(),
            },
        }
    }
}

/// What people should know before anything moves, if anything.
pub fn warning(motion: &PlannedMotion) -> Option<String> {
    match motion {
        PlannedMotion::Paths(_) => None,
        PlannedMotion::Refused(error) => {
            let cure = error.cure();
            Some(format!("no module will move: {error}; {cure}"))
        }
    }
}

/// What is added to the outcome of a plan that no module can carry out.
pub fn mark(motion: &PlannedMotion) -> String {
    match motion {
        PlannedMotion::Paths(_) => String::new(),
        PlannedMotion::Refused(_) => ", and none can move".to_owned(),
    }
}

/// The motion in one line.
pub fn line(motion: &PlannedMotion) -> String {
    match motion {
        PlannedMotion::Paths(plan) => {
            let steps: usize = plan.units.iter().map(|unit| unit.steps.len()).sum();
            format!(
                "motion: paths, {} until the last module arrives (bound {}), {} in all",
                counted(plan.makespan as usize, "step"),
                plan.bound,
                counted(steps, "step"),
            )
        }
        PlannedMotion::Refused(_) => "motion: none".to_owned(),
    }
}

impl Paths {
    fn of(plan: &MotionPlan) -> Self {
        let modules = |unit| ModulePath::of_unit(unit);
        let mut modules: Vec<ModulePath> = plan.units.iter().flat_map(modules).collect();
        modules.sort_by_key(|path| path.module);
        Self {
            mode: "paths",
            collision_free: true,
            makespan: plan.makespan,
            bound: plan.bound,
            longest_path: plan.bound,
            order: "edges",
            variant: match plan.variant {
                Variant::Lazy => "lazy",
                Variant::Eager => "eager",
                Variant::Swapping => "swapping",
                Variant::Serial => "serial",
            },
            taken_apart: plan.taken_apart.clone(),
            modules,
        }
    }
}

impl ModulePath {
    fn of_unit(unit: &UnitMotion) -> impl Iterator<Item = Self> {
        let waits = unit.waits.iter();
        let waits: Vec<[u32; 3]> = waits
            .map(|wait| [wait.step, wait.unit.0, wait.steps_done])
            .collect();
        unit.modules.iter().map(move |module| Self {
            module: module.module,
            unit: unit.lead,
            waypoints: waypoints(module),
            waits: waits.clone(),
        })
    }
}

fn waypoints(module: &ModuleMotion) -> Vec<[f64; 4]> {
    let points = module.waypoints.iter();
    points
        .map(|point| {
            let pose = &point.pose;
            let time = f64::from(point.time);
            [
                pose.x.to_units(),
                pose.y.to_units(),
                pose.theta.to_units(),
                time,
            ]
        })
        .collect()
}
