//! Equal units swap their spots where nothing can carry out the claims.

use std::sync::Arc;

use formation_model::{MotionPlan, PlanningProblem, SpotSelection};
use formation_motion::PlannedMotion;
use formation_motion::paths::MotionError;
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::motion::{assert_sound, run, waits_of};
use crate::support::walls::Field;

/// The motion of a problem and the spots that change hands for it, without contact in any execution.
fn planned(
    problem: &Arc<PlanningProblem>,
) -> Result<(MotionPlan, Vec<SpotSelection>), MotionError> {
    let mut outcome = plan(Arc::clone(problem));
    let (motion, plan) = PlannedMotion::of(problem, outcome.plan, &[]);
    let motion = match motion {
        PlannedMotion::Paths(motion) => motion,
        PlannedMotion::Straight(error) => return Err(error.unwrap()),
        PlannedMotion::Refused(error) => return Err(error),
    };
    let swaps = plan.swaps.clone();
    outcome.plan = plan;
    assert_sound(problem, &outcome, &motion);
    let found = run(&motion, &waits_of(&motion), 3, &mut Numbers(1));
    assert!(found.is_empty(), "{:?}", &found[..1]);
    Ok((motion, swaps))
}

#[test]
#[ignore = "explore"]
fn explore() {
    for percent in [0, 20, 60] {
        for fill in [20, 40, 60, 80] {
            let (mut good, mut swapped, mut bad) = (0, 0, Vec::new());
            let mut slow = std::time::Duration::ZERO;
            for seed in 0..15 {
                for blob in [false, true] {
                    let mut numbers = Numbers(seed * 77 + 5);
                    let field = Field::lanes(6, percent, &mut numbers);
                    let free = (field.width * field.height) as usize - field.walls.len();
                    let count = (free * fill / 200).max(2);
                    let extra = count / 5 * (seed as usize % 2);
                    let mut field = field.filled(count, &mut numbers);
                    if blob {
                        field = field.started_together(count + extra, &mut numbers);
                    }
                    let problem = field.problem();
                    let began = std::time::Instant::now();
                    let found = planned(&problem);
                    slow = slow.max(began.elapsed());
                    match found {
                        Ok((_, swaps)) if swaps.is_empty() => good += 1,
                        Ok(_) => swapped += 1,
                        Err(error) => bad.push(format!("{seed} {blob}: {error}")),
                    }
                }
            }
            println!(
                "{percent} {fill}: as claimed {good}, swapped {swapped}, refused {}, slowest {slow:?}",
                bad.len()
            );
            for bad in bad.iter().take(4) {
                println!("   {bad}");
            }
        }
    }
}
