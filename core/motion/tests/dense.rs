//! Single modules in crowds: they swap their spots on the way where they cannot pass each other, or only far too late.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use formation_model::{PlanningProblem, RawModule, RawSpot, Scenario, Variant};

use crate::support::walls::{Cell, Field};
use crate::swaps::planned;

/// The cells of a square without those for which this holds.
fn square_without(side: i64, is_left_out: impl Fn(i64, i64) -> bool) -> Vec<Cell> {
    let cells = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    cells.filter(|&(x, y)| !is_left_out(x, y)).collect()
}

/// Modules on some cells, each a quarter further than the one before if they are turned, and a target of other cells.
fn crowd(starts: &[Cell], spots: &[Cell], is_turned: bool) -> Arc<PlanningProblem> {
    let quarters = [0.0, FRAC_PI_2, PI, -FRAC_PI_2];
    let heading = |id: u32| {
        if is_turned {
            quarters[id as usize % 4]
        } else {
            0.0
        }
    };
    let at = |(x, y): Cell| (x as f64, y as f64);
    let mut raw = generated();
    let numbered: Vec<(u32, Cell)> = (1..).zip(spots.iter().copied()).collect();
    raw.target.spots = numbered
        .iter()
        .map(|&(id, cell)| {
            let ((x, y), theta) = (at(cell), 0.0);
            RawSpot { id, x, y, theta }
        })
        .collect();
    let beside = |one: Cell, other: Cell| (one.0 - other.0).abs() + (one.1 - other.1).abs() == 1;
    raw.target.edges = numbered
        .iter()
        .flat_map(|&(id, cell)| {
            let others = numbered.iter();
            let next = others.filter(move |&&(other, its)| id < other && beside(cell, its));
            next.map(move |&(other, _)| [id, other])
        })
        .collect();
    raw.singletons = (1..)
        .zip(starts)
        .map(|(id, &cell)| {
            let ((x, y), theta) = (at(cell), heading(id));
            RawModule { id, x, y, theta }
        })
        .collect();
    Arc::new(Scenario::try_from(raw).unwrap().problem().clone())
}

fn generated() -> formation_model::RawScenario {
    let parameters = formation_generate::GeneratorParameters::new(2, 2, 1);
    formation_generate::generate(&parameters).unwrap()
}

#[test]
fn a_crowd_whose_holes_move_is_formed_in_few_steps() {
    let starts = square_without(14, |x, y| (3 * x + 5 * y) % 11 == 0);
    let spots = square_without(14, |x, y| (5 * x + 2 * y) % 13 == 3 || (x, y) == (0, 0));
    let (count, spots) = (starts.len().min(spots.len()), spots);
    let problem = crowd(&starts, &spots[..count], false);
    let (motion, plan) = planned(&problem).unwrap();
    assert!(!plan.swaps.is_empty());
    assert_eq!(motion.variant, Variant::Swapping);
    assert!(motion.makespan <= 25, "{}", motion.makespan);
}

/// No hole is left in the crowd, and it has to grow by one column on one side.
#[test]
fn a_full_square_shifts_by_one() {
    let starts = square_without(10, |_, _| false);
    let spots: Vec<Cell> = starts.iter().map(|&(x, y)| (x + 1, y)).collect();
    let (motion, _) = planned(&crowd(&starts, &spots, false)).unwrap();
    assert!(motion.makespan <= 12, "{}", motion.makespan);
}

#[test]
fn a_crowd_spreads_to_turn() {
    let starts = square_without(12, |x, y| (x + 2 * y) % 7 == 0);
    let spots: Vec<Cell> = (0..i64::try_from(starts.len()).unwrap())
        .map(|index| (index % 20, index / 20 - 3))
        .collect();
    let (motion, plan) = planned(&crowd(&starts, &spots, true)).unwrap();
    assert_eq!(motion.variant, Variant::Swapping);
    assert!(!plan.swaps.is_empty());
    assert!(motion.makespan <= 40, "{}", motion.makespan);
}

/// Modules without a spot stand on spots, and walls are in between.
#[test]
fn modules_without_a_spot_take_part() {
    let field = Field::drawn(
        "
        abcd.#1234
        efgh.#5678
        ijkl...9..
        mnop.#....
        ",
    );
    let (motion, plan) = planned(&field.problem()).unwrap();
    let spots: BTreeSet<_> = plan.assignments.values().collect();
    assert_eq!(spots.len(), 9);
    assert!(motion.makespan <= 30, "{}", motion.makespan);
}
