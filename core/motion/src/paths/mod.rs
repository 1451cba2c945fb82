//! Paths: how all units move to their spots at the same time without contact.
//!
//! Modules are unit squares on the cells of the lattice that the target spans. A unit, a single module or a block of
//! docked ones, moves by steps of one cell; it holds the cells of a place from the begin of the step into it to the
//! end of the step out of it. A block that changes its layout folds within a disc that no other unit enters.
//!
//! [`plan_motion`] brings all modules from their real poses onto the lattice (`start`, `regroup`), orders the units by taking the
//! finished formation apart (`order`), finds how they leave the lattice (`exits`), and plans them one after another in that order (`docking`): units in the way
//! make way (`make_way`), those that a unit would cut off from their spots change sides before (`parts`), and each move is timed
//! between the reservations of the others (`sipp`, `table`). Then each path is improved with all others fixed (`improve`). What
//! is executed is not the times but the waits (`waits`): a step begins when the units that hold its cells before have left them,
//! so that no delay leads to contact. Units dock once they rest on their spots, in the acting order of the plan.
//!
//! All decisions are made on whole numbers and the budget counts search nodes, so all replicas find the same plan.

mod attempts;
mod diagnose;
mod docking;
mod exit;
mod exits;
mod fit;
mod group;
mod improve;
mod lattice;
mod lattice_request;
mod make_way;
mod order;
mod output;
mod parts;
mod rectangle;
mod regions;
mod regroup;
mod resting;
mod result;
mod route;
mod schedule;
mod shape;
mod sipp;
mod start;
mod swap;
mod swapped_motion;
mod table;
mod target_swapping;
mod units;
mod unlabelled;
mod variants;
mod waits;

pub use result::{
    FIELD_CELLS_MAX, MotionError, MotionParameters, MotionRequest, Obstruction, StartFault,
};

use formation_model::{MotionPlan, Polyline, Pose};

use lattice_request::LatticeRequest;
pub(crate) use swap::{plan_shorter, plan_with_swaps};

/// Paths and waits for all units of a plan.
///
/// # Errors
/// Names what is wrong with the target or the starts, or the unit that cannot get to its spots and why.
pub fn plan_motion(request: &MotionRequest) -> Result<MotionPlan, MotionError> {
    let motion = LatticeRequest::new(request)?.plan()?;
    for unit in &motion.units {
        for module in &unit.modules {
            // Messages carry where a silent module may be: its path from where it was last seen.
            let seen = Pose::default();
            if Polyline::through([seen].into_iter().chain(unit.poses_after(0, module))).is_err() {
                return Err(MotionError::TooManyCorners(module.module));
            }
        }
    }
    Ok(motion)
}
