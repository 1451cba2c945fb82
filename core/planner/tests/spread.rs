//! The parameter `spread`: rows keep their order, at almost no distance.

use std::sync::Arc;

use formation_generate::Grouping;
use formation_model::{
    MicroUnits, ModuleId, PlannerParameters, PlanningModule, PlanningProblem, Policy, Pose,
    RawSpot, RawTarget, SpotId, Spread, Target,
};
use formation_planner::{PlanOutcome, plan};

use crate::support::{Numbers, problem, with_parameters};

/// A row of modules that shifts along its line; each start is off by up to twice `noise` micro-units along both axes.
fn row(count: u32, shift: u32, noise: i64, seed: u64, policy: Policy) -> Arc<PlanningProblem> {
    let mut numbers = Numbers(seed);
    let spots = (0..count).map(|id| RawSpot {
        id,
        x: f64::from(id + shift),
        y: 0.0,
        theta: 0.0,
    });
    let raw = RawTarget {
        frame_id: "map".to_owned(),
        spots: spots.collect(),
        edges: (1..count).map(|id| [id - 1, id]).collect(),
    };
    let mut off = || MicroUnits(numbers.within(-2 * noise, 2 * noise));
    let modules = (0..count).map(|id| PlanningModule {
        id: ModuleId(id),
        pose: Pose {
            x: MicroUnits(i64::from(id) * 1_000_000) + off(),
            y: off(),
            theta: MicroUnits::ZERO,
        },
        links: [].into(),
        configuration: None,
        leader: None,
        pin: None,
    });
    let parameters = PlannerParameters {
        policy,
        ..PlannerParameters::default()
    };
    let target = Arc::new(Target::try_from(raw).unwrap());
    Arc::new(PlanningProblem::new(target, parameters, modules.collect()).unwrap())
}

fn keeps_order(outcome: &PlanOutcome) -> bool {
    let mut assignments = outcome.plan.assignments.iter();
    assignments.all(|(&module, &spot)| SpotId(module.0) == spot)
}

#[test]
fn rows_keep_their_order_whatever_the_noise() {
    for (count, shift) in [(12, 2), (20, 60), (20, 5), (5, 1)] {
        for noise in [0, 3_000, 10_000] {
            for seed in 1..=20 {
                for policy in [Policy::Exact, Policy::Auction, Policy::Hungarian] {
                    let outcome = plan(row(count, shift, noise, seed, policy));
                    assert!(
                        keeps_order(&outcome),
                        "{count} modules by {shift}, noise {noise}, seed {seed}, {policy:?}"
                    );
                }
            }
        }
    }
}

/// Without it, the plain sum leaves the order to the noise.
#[test]
fn without_spread_a_row_loses_its_order() {
    let row = row(20, 60, 3_000, 1, Policy::Exact);
    assert!(!keeps_order(&plan(Arc::new(row.with_spread(Spread::ZERO)))));
}

#[test]
fn the_policy_of_the_paper_ignores_the_spread() {
    for seed in 0..5 {
        let paper = PlannerParameters {
            policy: Policy::Paper,
            spread: Spread::from_units(1.0).unwrap(),
            ..PlannerParameters::default()
        };
        let spread = problem(30, 30, Grouping::Mixed, seed, paper);
        let plain = Arc::new(spread.with_spread(Spread::ZERO));
        assert_eq!(plan(spread).decisions, plan(plain).decisions);
    }
}

#[test]
fn the_sum_of_distances_grows_by_less_than_a_thousandth_and_the_longest_way_shrinks() {
    let (mut totals, mut longest) = ([0_i64; 2], [0_i64; 2]);
    for seed in 0..20 {
        let spread = problem(
            100,
            100,
            Grouping::Singletons,
            seed,
            PlannerParameters::default(),
        );
        let plain = Arc::new(spread.with_spread(Spread::ZERO));
        let [spread, plain] = [spread, plain].map(plan);
        assert!(spread.total_distance >= plain.total_distance, "{seed}");
        assert!(spread.total_utility <= plain.total_utility, "{seed}");
        for (index, outcome) in [&spread, &plain].into_iter().enumerate() {
            totals[index] += outcome.total_distance.0;
            longest[index] += outcome.longest_distance.0;
        }
    }
    assert!(
        totals[0] <= totals[1] + totals[1] / 1_000,
        "{} units instead of {}",
        totals[0],
        totals[1]
    );
    assert!(longest[0] < longest[1], "{longest:?}");
}

/// The greater the spread, the smaller the sum of squares.
#[test]
fn a_greater_spread_evens_out_the_ways() {
    let base = problem(
        60,
        60,
        Grouping::Singletons,
        3,
        PlannerParameters::default(),
    );
    let squares = |spread: f64| {
        let parameters = PlannerParameters {
            spread: Spread::from_units(spread).unwrap(),
            ..PlannerParameters::default()
        };
        let problem = with_parameters(&base, parameters);
        let outcome = plan(Arc::clone(&problem));
        let assignments = outcome.plan.assignments.iter();
        let square = |(&module, &spot): (&ModuleId, &SpotId)| {
            let from = problem.module(module).unwrap().pose;
            let distance = from.distance_to(&problem.target().spot(spot).unwrap().pose);
            i128::from(distance.0) * i128::from(distance.0)
        };
        assignments.map(square).sum::<i128>()
    };
    let sums = [0.0, 0.001, 0.01, 0.1, 1.0].map(squares);
    // Up to the rounding of costs.
    let slack = 60 * 1_000_000;
    assert!(
        sums.windows(2).all(|pair| pair[1] <= pair[0] + slack),
        "{sums:?}"
    );
    assert!(sums[4] < sums[0]);
}
