//! Degenerate inputs: all poses equal, distances across the whole range of coordinates, a hundred links at one module. Tests
//! run with overflow checks.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::sync::Arc;

use formation_model::{
    COORDINATE_LIMIT_UNITS, MODULES_MAX, ModuleId, PlannerParameters, PlanningModule,
    PlanningProblem, Pose, RawSpot, RawTarget, SPOTS_MAX, Target, WEIGHT_LIMIT, Weights,
};
use formation_planner::{Planning, plan};

use crate::support::hungarian;

fn heaviest() -> PlannerParameters {
    PlannerParameters {
        weights: Weights::from_units(WEIGHT_LIMIT, WEIGHT_LIMIT - 1.0, WEIGHT_LIMIT - 2.0).unwrap(),
        ..PlannerParameters::default()
    }
}

fn id(position: usize) -> u32 {
    u32::try_from(position).unwrap()
}

/// A path of spots at the given positions.
fn path(positions: &[(f64, f64)]) -> Arc<Target> {
    let spots = positions
        .iter()
        .enumerate()
        .map(|(position, &(x, y))| RawSpot {
            id: id(position),
            x,
            y,
            theta: 0.0,
        })
        .collect();
    let edges = (1..positions.len())
        .map(|position| [id(position - 1), id(position)])
        .collect();
    let frame_id = "map".to_owned();
    Arc::new(
        Target::try_from(RawTarget {
            frame_id,
            spots,
            edges,
        })
        .unwrap(),
    )
}

fn module(position: usize, (x, y): (f64, f64), links: &[usize]) -> PlanningModule {
    PlanningModule {
        id: ModuleId(id(position)),
        pose: Pose::from_units(x, y, 0.0).unwrap(),
        links: links.iter().map(|&other| ModuleId(id(other))).collect(),
        configuration: None,
        leader: None,
        pin: None,
    }
}

/// Every module has to cross the whole range of coordinates: the greatest possible sum of costs.
#[test]
fn ten_thousand_modules_across_the_world_do_not_overflow_the_totals() {
    let far = COORDINATE_LIMIT_UNITS;
    let spots: Vec<(f64, f64)> = (0..SPOTS_MAX)
        .map(|position| (far, far - f64::from(id(position)) * 1.0e-3))
        .collect();
    // Configurations are chains of a hundred, which fit the target, a path.
    let modules: Vec<PlanningModule> = (0..MODULES_MAX)
        .map(|position| {
            let first = position - position % 100;
            let links: Vec<usize> = [position.wrapping_sub(1), position + 1]
                .into_iter()
                .filter(|other| (first..first + 100).contains(other))
                .collect();
            module(position, (-far, -far), &links)
        })
        .collect();
    let problem = Arc::new(PlanningProblem::new(path(&spots), heaviest(), modules).unwrap());
    let mut planning = Planning::new(Arc::clone(&problem));
    let turns = planning.take_all_turns();
    assert!(turns.len() >= 100);
    let utility: i128 = (0..MODULES_MAX)
        .map(|module| {
            let spot = planning.spot_of(ModuleId(id(module))).unwrap();
            let spot = planning.instance().target.position_of(spot).unwrap();
            i128::from(planning.instance().utilities.of(module, spot).0)
        })
        .sum();
    assert!(utility < -2_000_000_000_000_000_000);
    assert!(utility > i128::from(i64::MIN));
}

/// Every comparison ties: all modules are on one point, all spots on another.
#[test]
fn modules_and_spots_that_coincide_are_still_distinguished() {
    let spots = vec![(5.0, 5.0); 30];
    let modules: Vec<PlanningModule> = (0..40)
        .map(|position| module(position, (1.0, 1.0), &[]))
        .collect();
    let parameters = PlannerParameters::default();
    let problem = Arc::new(PlanningProblem::new(path(&spots), parameters, modules).unwrap());
    let mut planning = Planning::new(Arc::clone(&problem));
    let decisions = planning.take_all_turns();
    // No eviction raises the utility, so there is none, and the lower identifiers come first.
    assert!(
        decisions
            .iter()
            .all(|(_, decision)| decision.evictions.is_empty())
    );
    let placed: Vec<bool> = (0..40)
        .map(|module| planning.spot_of(ModuleId(module)).is_some())
        .collect();
    assert_eq!(placed, [[true; 30].as_slice(), &[false; 10]].concat());
    let utilities: Vec<Vec<i64>> = (0..40)
        .map(|module| planning.instance().utilities.row(module))
        .collect();
    let total: i64 = (0..30)
        .map(|module| {
            let spot = planning.spot_of(ModuleId(id(module))).unwrap();
            utilities[module][usize::try_from(spot.0).unwrap()]
        })
        .sum();
    assert_eq!(total, hungarian::best_total(&utilities));
}

/// A star and a comb, with more edges at one node than a module has ports.
#[test]
fn large_degrees_are_matched() {
    let star = |leaves: usize| -> Vec<PlanningModule> {
        let all: Vec<usize> = (1..=leaves).collect();
        let mut modules = vec![module(0, (0.0, 0.0), &all)];
        modules.extend((1..=leaves).map(|leaf| module(leaf, (f64::from(id(leaf)), 1.0), &[0])));
        modules
    };
    let spots = (0..120)
        .map(|position| RawSpot {
            id: position,
            x: f64::from(position),
            y: -3.0,
            theta: 0.0,
        })
        .collect();
    let target = Target::try_from(RawTarget {
        frame_id: "map".to_owned(),
        spots,
        edges: (1..120).map(|position| [0, position]).collect(),
    })
    .unwrap();
    let problem = Arc::new(
        PlanningProblem::new(Arc::new(target), PlannerParameters::default(), star(99)).unwrap(),
    );
    let outcome = plan(problem);
    assert_eq!(outcome.plan.blocks.len(), 1);
    assert_eq!(outcome.plan.kept_links.len(), 99);
}
