//! Which settled modules have to make way, so that every spot can be reached.
//!
//! Pinned modules can wall in a spot that must still be filled. Then the pins farthest from the target's centre are
//! released, as few as a bisection finds. A try of the bisection does not plan: it keeps the filled spots and the blocks of
//! the plan with all pins, and looks for an acting order in which the released spots are filled like any other. The plan
//! for the pins that stay then shows whether that holds, as the modules that were released may form blocks. If it does not,
//! or if the tries found nothing, a bisection over whole plans follows; no pin is released if even the plan without any pin
//! has walls.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::planned_turns::PlannedTurns;
use crate::assembly;
use formation_model::{AssemblyWarning, MicroUnits, Plan, PlanningProblem, SpotId};

/// Plans for a problem, after the release of the pins that wall in spots. The pins that stay are those of
/// [`PlannedTurns::problem`].
/// Enforces P3.
#[must_use]
pub fn plan_releasing_pins(problem: Arc<PlanningProblem>) -> PlannedTurns {
    let (first, values) = PlannedTurns::with_values(problem);
    let outermost_first = outermost_first(first.problem());
    let all = outermost_first.len();
    if all == 0 || !has_walls(first.plan()) {
        return first;
    }
    let without = |count: usize| {
        let released: BTreeSet<SpotId> = outermost_first[..count].iter().copied().collect();
        first.problem().without_pins(&released)
    };
    let planned = |count: usize| PlannedTurns::of(Arc::new(without(count)));
    let leaves_no_wall = |count: usize| {
        let order = assembly::try_order(&without(count), first.plan(), &values);
        !order.warnings.iter().any(is_wall)
    };
    let mut too_few = 0;
    if leaves_no_wall(all) {
        let enough = least_count(0, all, leaves_no_wall);
        let planned = planned(enough);
        if !has_walls(planned.plan()) {
            return planned;
        }
        too_few = enough;
    }
    let mut best = planned(all);
    if has_walls(best.plan()) {
        return first;
    }
    least_count(too_few, all, |count| {
        let planned = planned(count);
        let is_enough = !has_walls(planned.plan());
        if is_enough {
            best = planned;
        }
        is_enough
    });
    best
}

/// The least count that is enough by bisection, between one that is too few and one that is enough.
fn least_count(
    mut too_few: usize,
    mut enough: usize,
    mut is_enough: impl FnMut(usize) -> bool,
) -> usize {
    while too_few + 1 < enough {
        let middle = too_few.midpoint(enough);
        if is_enough(middle) {
            enough = middle;
        } else {
            too_few = middle;
        }
    }
    enough
}

/// The pinned spots of a problem, those farthest from the target's centre first.
fn outermost_first(problem: &PlanningProblem) -> Vec<SpotId> {
    let target = problem.target();
    let centre = target.centre();
    let pins = problem.modules().iter().filter_map(|module| module.pin);
    let mut spots: Vec<(MicroUnits, SpotId)> = pins
        .filter_map(|id| Some((target.spot(id)?.pose.distance_to(&centre), id)))
        .collect();
    spots.sort_unstable();
    spots.into_iter().rev().map(|(_, id)| id).collect()
}

fn has_walls(plan: &Plan) -> bool {
    plan.assembly.warnings.iter().any(is_wall)
}

fn is_wall(warning: &AssemblyWarning) -> bool {
    matches!(warning, AssemblyWarning::WalledIn(_))
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_generate::Random;
    use formation_model::{
        ModuleId, PlannerParameters, PlanningModule, Pose, RawSpot, RawTarget, Target,
    };

    /// How many pins are released, by a bisection over whole plans.
    fn released_by_definition(problem: &Arc<PlanningProblem>) -> usize {
        let outermost_first = outermost_first(problem);
        let walls_in = |count: usize| {
            let released = outermost_first[..count].iter().copied().collect();
            let problem = Arc::new(problem.without_pins(&released));
            has_walls(PlannedTurns::of(problem).plan())
        };
        let all = outermost_first.len();
        if all == 0 || !walls_in(0) || walls_in(all) {
            return 0;
        }
        least_count(0, all, |count| !walls_in(count))
    }

    /// A formation on a lattice of which some modules are lost and others wait next to it, with the settled ones docked.
    fn drawn(random: &mut Random) -> Option<Arc<PlanningProblem>> {
        let below = |random: &mut Random, bound: u64| u32::try_from(random.below(bound)).unwrap();
        let (width, height) = (3 + below(random, 4), 3 + below(random, 4));
        let holes = random.below(3);
        let filled: Vec<u32> = (0..width * height)
            .filter(|_| holes == 0 || random.below(6) >= holes)
            .collect();
        let is_filled = |id: u32| filled.contains(&id);
        let neighbours = |id: u32| {
            let (x, y) = (id % width, id / width);
            let right = (x + 1 < width).then_some(id + 1);
            let up = (y + 1 < height).then_some(id + width);
            right.into_iter().chain(up)
        };
        let edges: Vec<[u32; 2]> = filled
            .iter()
            .flat_map(|&id| neighbours(id).map(move |other| [id, other]))
            .filter(|edge| is_filled(edge[1]) && (holes == 0 || random.below(8) > 0))
            .collect();
        let spot = |&id: &u32| RawSpot {
            id,
            x: f64::from(id % width),
            y: f64::from(id / width),
            theta: 0.0,
        };
        let raw = RawTarget {
            frame_id: "map".to_owned(),
            spots: filled.iter().map(spot).collect(),
            edges: edges.clone(),
        };
        let target = Arc::new(Target::try_from(raw).ok()?);
        let lost: BTreeSet<u32> = filled
            .iter()
            .copied()
            .filter(|_| random.below(4) == 0)
            .collect();
        let settled = filled.iter().filter(|id| !lost.contains(id)).map(|&id| {
            let links = edges.iter().filter(|edge| edge.contains(&id));
            let others = links.map(|edge| edge[0] + edge[1] - id);
            PlanningModule {
                id: ModuleId(id),
                pose: target.spot(SpotId(id)).unwrap().pose,
                links: others
                    .filter(|id| !lost.contains(id))
                    .map(ModuleId)
                    .collect(),
                configuration: None,
                leader: None,
                pin: Some(SpotId(id)),
            }
        });
        let spare_count = match random.below(3) {
            0 => below(random, 3),
            _ => u32::try_from(lost.len()).unwrap() + below(random, 2),
        };
        let spares = (0..spare_count).map(|index| PlanningModule {
            id: ModuleId(1_000 + index),
            pose: Pose::from_units(-3.0 - f64::from(index), f64::from(index % 3), 0.0).unwrap(),
            links: BTreeSet::new(),
            configuration: None,
            leader: None,
            pin: None,
        });
        let modules = settled.chain(spares).collect();
        PlanningProblem::new(target, PlannerParameters::default(), modules)
            .ok()
            .map(Arc::new)
    }

    #[test]
    fn as_many_pins_are_released_as_by_whole_plans() {
        let mut random = Random::from_seed(3);
        let (mut rounds, mut released) = (0, 0);
        while rounds < 100 {
            let Some(problem) = drawn(&mut random) else {
                continue;
            };
            rounds += 1;
            let pins = |problem: &PlanningProblem| {
                let modules = problem.modules().iter();
                modules.filter(|module| module.pin.is_some()).count()
            };
            let planned = plan_releasing_pins(Arc::clone(&problem));
            let count = pins(&problem) - pins(planned.problem());
            let definition = released_by_definition(&problem);
            // The definition releases none if all modules, released together, form a block that cannot be placed without
            // a wall. A part of them may do.
            if definition > 0 {
                assert_eq!(count, definition, "round {rounds}");
            }
            if count > 0 {
                released += 1;
                assert!(!has_walls(planned.plan()), "round {rounds}");
            }
            assert_eq!(PlannedTurns::of(Arc::clone(planned.problem())), planned);
        }
        assert!(released > 20, "{released} of {rounds}");
    }
}
