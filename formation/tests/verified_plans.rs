//! Every plan of random scenarios keeps the guarantees of the planning rules, as an independent checker sees it.

use std::sync::Arc;

use formation::generate::{GeneratorParameters, Grouping, TreeKind, generate};
use formation::parameters::TurnOrder;
use formation::planning;
use formation::scenario::{RawScenario, Scenario};
use formation::verify::check_plan;

/// Plans a scenario and fails with its text if the plan breaks a promise.
fn assert_verified(raw: RawScenario) -> Result<(), Box<dyn std::error::Error>> {
    let text = serde_yaml::to_string(&raw)?;
    let scenario = Scenario::try_from(raw)?;
    let problem = Arc::new(scenario.problem().clone());
    let outcome = planning::plan(Arc::clone(&problem));
    let decisions: Vec<_> = outcome
        .decisions
        .into_iter()
        .map(|(_, decision)| decision)
        .collect();
    let checked = check_plan(&problem, &decisions, &outcome.plan);
    assert!(checked.is_ok(), "{checked:#?}\n{text}");
    Ok(())
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
            for (order, d_max, keep_all_spots) in [
                (TurnOrder::Rank, None, false),
                (TurnOrder::SizeFirst, Some(3), true),
                (TurnOrder::Rank, Some(0), false),
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
                    raw.planner.keep_all_spots = keep_all_spots;
                    assert_verified(raw)?;
                }
            }
        }
    }
    Ok(())
}
