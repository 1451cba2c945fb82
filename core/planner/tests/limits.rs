//! Numbers at their limits do not panic or wrap, and are refused with a clear error beyond. Tests are compiled with overflow
//! checks.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_model::{
    COORDINATE_LIMIT_UNITS, CutPrice, MODULES_MAX, MicroUnits, PaperOptions, PlannerParameters,
    PlanningProblem, Policy, ProblemError, RawScenario, Scenario, Spread, TurnOrder, WEIGHT_LIMIT,
    Weights,
};
use formation_planner::{Planning, Statistics, plan};
use formation_verify::check_plan;

use crate::support::{hungarian, with_parameters};

/// Every module is at one corner of the range of coordinates, and every spot near the opposite corner.
fn at_opposite_corners(modules: usize, spots: usize, grouping: Grouping) -> RawScenario {
    let mut raw = generate(&GeneratorParameters::new(modules, spots, 3).grouped(grouping)).unwrap();
    let members = raw
        .configurations
        .iter_mut()
        .flat_map(|configuration| &mut configuration.modules);
    for (number, module) in members.chain(&mut raw.singletons).enumerate() {
        // A few start exactly at the corner; the others differ, so that their distances do.
        let inward = f64::from(u32::try_from(number / 3).unwrap());
        (module.x, module.y) = (inward - COORDINATE_LIMIT_UNITS, -COORDINATE_LIMIT_UNITS);
    }
    let most = |of: fn(&formation_model::RawSpot) -> f64| {
        raw.target.spots.iter().map(of).fold(f64::MIN, f64::max)
    };
    let (most_x, most_y) = (most(|spot| spot.x), most(|spot| spot.y));
    for spot in &mut raw.target.spots {
        spot.x += COORDINATE_LIMIT_UNITS - most_x;
        spot.y += COORDINATE_LIMIT_UNITS - most_y;
    }
    raw
}

fn heaviest() -> Weights {
    Weights::from_units(WEIGHT_LIMIT, WEIGHT_LIMIT - 1.0, WEIGHT_LIMIT - 2.0).unwrap()
}

#[test]
fn the_longest_distances_at_the_greatest_weights_are_planned_and_verified() {
    for grouping in [
        Grouping::Singletons,
        Grouping::Mixed,
        Grouping::Configurations(10),
    ] {
        for (modules, spots) in [(40, 40), (50, 30), (30, 40)] {
            let raw = at_opposite_corners(modules, spots, grouping);
            let scenario = Scenario::try_from(raw).unwrap();
            for policy in [
                Policy::Exact,
                Policy::Paper,
                Policy::Auction,
                Policy::Hungarian,
            ] {
                for (order, d_max) in [(TurnOrder::Rank, None), (TurnOrder::SizeFirst, Some(3))] {
                    let parameters = PlannerParameters {
                        paper: PaperOptions::default(),
                        policy,
                        order,
                        d_max,
                        exact_finish: true,
                        weights: heaviest(),
                        cut_price: CutPrice::from_units(WEIGHT_LIMIT).unwrap(),
                        spread: Spread::from_units(1.0).unwrap(),
                        keep_all_spots: false,
                    };
                    let problem = with_parameters(scenario.problem(), parameters);
                    let outcome = plan(Arc::clone(&problem));
                    let statistics = Statistics::of(&problem, &outcome);
                    assert!(statistics.total_utility < -2.0e8 * 20.0);
                    if policy != Policy::Paper {
                        let decisions: Vec<_> = outcome
                            .decisions
                            .iter()
                            .map(|(_, decision)| decision.clone())
                            .collect();
                        assert_eq!(check_plan(&problem, &decisions, &outcome.plan).err(), None);
                    }
                }
            }
        }
    }
}

#[test]
fn utilities_at_their_limit_are_still_distinguished() {
    let raw = at_opposite_corners(40, 40, Grouping::Singletons);
    let scenario = Scenario::try_from(raw).unwrap();
    let parameters = PlannerParameters {
        weights: heaviest(),
        ..PlannerParameters::default()
    };
    let problem = with_parameters(scenario.problem(), parameters);
    let mut planning = Planning::new(Arc::clone(&problem));
    planning.take_all_turns();
    let instance = planning.instance();
    let rows: Vec<Vec<i64>> = (0..40)
        .map(|module| instance.utilities.row(module))
        .collect();
    let least = rows.iter().flatten().min().copied().unwrap();
    assert!(least < -282_800_000_000_000, "{least}");
    let total: MicroUnits = problem
        .modules()
        .iter()
        .enumerate()
        .map(|(position, module)| {
            let spot = planning.spot_of(module.id).unwrap();
            let spot = instance.target.position_of(spot).unwrap();
            instance.utilities.of(position, spot)
        })
        .sum();
    assert_eq!(total.0, hungarian::best_total(&rows));
}

/// The greatest number of modules on as many spots; blocks of 2,500 keep the allocation to seconds. The bounds of the
/// utilities, checked here too, imply that their sums fit.
#[test]
fn the_greatest_number_of_modules_is_allocated() {
    let grouping = Grouping::Configurations(2_500);
    let raw = generate(&GeneratorParameters::new(MODULES_MAX, MODULES_MAX, 5).grouped(grouping));
    let scenario = Scenario::try_from(raw.unwrap()).unwrap();
    let parameters = PlannerParameters {
        // With chains, inserting the many modules left over would take minutes.
        d_max: Some(0),
        weights: heaviest(),
        ..PlannerParameters::default()
    };
    let problem = with_parameters(scenario.problem(), parameters);
    let mut planning = Planning::new(Arc::clone(&problem));
    planning.take_all_turns();
    let held: BTreeSet<_> = problem
        .modules()
        .iter()
        .filter_map(|module| planning.spot_of(module.id))
        .collect();
    assert_eq!(held.len(), MODULES_MAX);
    let longest = MicroUnits(2_828_427_124_747).scaled_by(heaviest().loc());
    let count = i64::try_from(MODULES_MAX).unwrap();
    assert!(
        longest
            .0
            .checked_mul(count)
            .is_some_and(|sum| sum < 3_000_000_000_000_000_000)
    );
}

#[test]
fn what_is_beyond_the_limits_is_refused_by_name() {
    let beyond = |change: fn(&mut RawScenario)| {
        let mut raw = generate(&GeneratorParameters::new(3, 3, 1)).unwrap();
        change(&mut raw);
        Scenario::try_from(raw).unwrap_err().to_string()
    };
    let refused = beyond(|raw| raw.singletons[1].y = -COORDINATE_LIMIT_UNITS - 1.0);
    assert!(
        refused.contains("singletons[1]") && refused.contains("1000000"),
        "{refused}"
    );
    let refused = beyond(|raw| raw.target.spots[2].x = f64::NAN);
    assert!(
        refused.contains("spots[2].x") && refused.contains("finite"),
        "{refused}"
    );
    let expensive = "target: {spots: [{id: 1, x: 0, y: 0}]}\nplanner: {cut_price: 101}";
    let refused = Scenario::from_yaml(expensive).unwrap_err().to_string();
    assert!(
        refused.contains("cut_price") && refused.contains("+-100"),
        "{refused}"
    );
    let wide = "target: {spots: [{id: 1, x: 0, y: 0}]}\nplanner: {spread: 1.1}";
    let refused = Scenario::from_yaml(wide).unwrap_err().to_string();
    assert!(
        refused.contains("spread: must lie between 0 and 1, got 1.1"),
        "{refused}"
    );
    let refused = Weights::from_units(WEIGHT_LIMIT + 1.0, 1.0, 0.5).unwrap_err();
    assert!(refused.to_string().contains("100"), "{refused}");
    let raw = generate(&GeneratorParameters::new(1, 1, 1)).unwrap();
    let scenario = Scenario::try_from(raw).unwrap();
    let problem = scenario.problem();
    let crowd = (0..=MODULES_MAX).map(|number| {
        let mut module = problem.modules()[0].clone();
        module.id.0 = u32::try_from(number).unwrap() + 1;
        module
    });
    let refused = PlanningProblem::new(
        Arc::clone(problem.target()),
        PlannerParameters::default(),
        crowd.collect(),
    );
    assert_eq!(refused, Err(ProblemError::TooManyModules(MODULES_MAX + 1)));
}
