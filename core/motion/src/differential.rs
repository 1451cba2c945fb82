//! What robots can carry out that drive along their heading only, and turn in place.

use formation_model::text::listed_in_full;
use formation_model::{MicroUnits, PlanningProblem};

/// The greatest width of a square body whose corners stay within its cell while it turns: about 1/sqrt(2) units.
pub const TURNING_BODY_WIDTH_MAX: MicroUnits = MicroUnits(700_000);

/// Whether robots with differential drives can carry out the motion of a problem.
///
/// # Errors
/// Names what they cannot move, and the cure.
pub fn check_differential_drives(problem: &PlanningProblem) -> Result<(), String> {
    if let Some(block) = problem.configurations().first() {
        let modules = listed_in_full(block.modules.iter().copied());
        return Err(format!(
            "{modules} are docked, and a block cannot move sideways with differential drives; use --drive holonomic"
        ));
    }
    let surroundings = problem.target().surroundings();
    let width = surroundings.body_width();
    if !surroundings.body().is_round() && width > TURNING_BODY_WIDTH_MAX {
        return Err(format!(
            "body_width: is {} units, but a robot with a differential drive turns in place, and its corners stay within its \
             cell only up to {} units; use --drive holonomic, or give narrower or round bodies",
            width.to_units(),
            TURNING_BODY_WIDTH_MAX.to_units()
        ));
    }
    Ok(())
}
