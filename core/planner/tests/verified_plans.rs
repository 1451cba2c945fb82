//! The independent checker finds no violation in the plans of random scenarios.

use std::sync::Arc;

use formation_generate::{GeneratorParameters, Grouping, Random, TreeKind, generate};
use formation_model::{PlanningProblem, RawScenario, Scenario, SpotId, TurnOrder};
use formation_planner as planner;
use formation_verify::check_plan;

/// Plans a scenario; fails with its text if the plan has violations.
fn assert_verified(raw: RawScenario) -> Result<(), Box<dyn std::error::Error>> {
    let text = serde_yaml::to_string(&raw)?;
    let scenario = Scenario::try_from(raw)?;
    assert_plan_verified(&Arc::new(scenario.problem().clone()), &text);
    Ok(())
}

/// Plans a problem; fails with `text` if the plan has violations.
fn assert_plan_verified(problem: &Arc<PlanningProblem>, text: &str) {
    let outcome = planner::plan(Arc::clone(problem));
    let decisions: Vec<_> = outcome
        .decisions
        .into_iter()
        .map(|(_, decision)| decision)
        .collect();
    let checked = check_plan(problem, &decisions, &outcome.plan);
    assert!(checked.is_ok(), "{checked:#?}\n{text}");
}

#[test]
fn random_scenarios_of_every_kind() -> Result<(), Box<dyn std::error::Error>> {
    let mut seed = 0;
    for (modules, spots) in [
        (1, 1),
        (1, 6),
        (9, 4),
        (12, 12),
        (14, 25),
        (40, 40),
        (60, 30),
    ] {
        for grouping in [
            Grouping::Singletons,
            Grouping::Mixed,
            Grouping::Configurations(modules.min(5)),
            Grouping::Configurations(modules),
        ] {
            for (order, d_max, exact_finish, keep_all_spots) in [
                (TurnOrder::Rank, None, false, false),
                (TurnOrder::SizeFirst, Some(3), false, true),
                (TurnOrder::Rank, Some(0), false, false),
                (TurnOrder::Rank, Some(0), true, true),
                (TurnOrder::SizeFirst, Some(1), true, false),
            ] {
                for tree in [TreeKind::Lattice, TreeKind::UniformLabelled] {
                    seed += 1;
                    let mut raw = generate(&GeneratorParameters {
                        tree,
                        grouping,
                        ..GeneratorParameters::new(modules, spots, seed)
                    })?;
                    raw.planner.order = order;
                    raw.planner.d_max = d_max;
                    raw.planner.exact_finish = exact_finish;
                    raw.planner.keep_all_spots = keep_all_spots;
                    assert_verified(raw)?;
                }
            }
        }
    }
    Ok(())
}

/// Some modules have settled on a connected part of the target, as after an interrupted epoch. Some of these have failed since, so
/// that the others can be disconnected.
/// Shows P2.
#[test]
fn modules_that_have_settled_stay() -> Result<(), Box<dyn std::error::Error>> {
    for seed in 0..300 {
        let mut random = Random::from_seed(seed);
        let (modules, spots) = [(14, 14), (20, 12), (10, 16)][random.index(3)];
        let raw =
            generate(&GeneratorParameters::new(modules, spots, seed).grouped(Grouping::Mixed))?;
        let scenario = Scenario::try_from(raw)?;
        let target = scenario.problem().target();
        let mut settled: Vec<SpotId> = vec![target.spots()[random.index(spots)].id];
        let mut next = 0;
        while settled.len() < 6 {
            let adjacent: Vec<SpotId> = target.neighbours_of(settled[next]).collect();
            for spot in adjacent {
                if !settled.contains(&spot) {
                    settled.push(spot);
                }
            }
            next += 1;
        }
        if seed % 2 == 0 {
            settled.swap_remove(random.index(settled.len()));
            settled.swap_remove(random.index(settled.len()));
        }
        random.shuffle(&mut settled);
        let mut members = scenario.problem().modules().to_vec();
        random.shuffle(&mut members);
        for (member, spot) in members.iter_mut().zip(settled) {
            member.pin = Some(spot);
        }
        let parameters = *scenario.problem().parameters();
        let problem = PlanningProblem::new(Arc::clone(target), parameters, members)?;
        assert_plan_verified(&Arc::new(problem), &format!("seed {seed}"));
    }
    Ok(())
}
