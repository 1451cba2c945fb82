//! A hand-made plan that keeps every promise, and one that breaks each.

use std::sync::Arc;

use super::*;
use formation_model::{
    ActingUnit, EvictionRecord, PlannerParameters, PlanningModule, Pose, RawSpot, RawTarget,
    SpotSelection, Target,
};

/// A path of six spots, 1 to 6, and six modules: 1, 2 and 3 docked in a row, the others single.
struct Case {
    spots: Vec<u32>,
    pins: Vec<(u32, u32)>,
    parameters: PlannerParameters,
    modules: u32,
    decisions: Vec<Decision>,
    plan: Plan,
}

fn decision(pairs: &[(u32, u32)]) -> Decision {
    Decision {
        selections: pairs
            .iter()
            .map(|&(spot, module)| SpotSelection {
                spot: SpotId(spot),
                module: ModuleId(module),
            })
            .collect(),
        ..Decision::default()
    }
}

fn eviction(evicted: u32, by: u32, from: u32, to: Option<u32>) -> EvictionRecord {
    EvictionRecord {
        evicted: ModuleId(evicted),
        by: ModuleId(by),
        from: SpotId(from),
        to: to.map(SpotId),
    }
}

fn unit(pairs: &[(u32, u32)]) -> ActingUnit {
    ActingUnit {
        lead: ModuleId(pairs.iter().map(|pair| pair.0).min().unwrap()),
        placements: pairs
            .iter()
            .map(|&(module, spot)| (ModuleId(module), SpotId(spot)))
            .collect(),
        pinned: false,
    }
}

/// Module 4 takes spot 3, the block takes spots 2 to 4 and displaces it to spot 5, where module 6 finds it and sends it
/// on to spot 6; module 5 takes spot 1.
fn good() -> Case {
    let mut block = decision(&[(2, 1), (3, 2), (4, 3), (5, 4)]);
    block.evictions = vec![eviction(4, 2, 3, Some(5))];
    let mut chain = decision(&[(5, 6), (6, 4)]);
    chain.evictions = vec![eviction(4, 6, 5, Some(6))];
    let mut plan = Plan {
        assignments: [(1, 2), (2, 3), (3, 4), (4, 6), (5, 1), (6, 5)]
            .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
            .into(),
        blocks: vec![vec![ModuleId(1), ModuleId(2), ModuleId(3)]],
        kept_links: [(1, 2), (2, 3)]
            .map(|(one, other)| (ModuleId(one), ModuleId(other)))
            .into(),
        ..Plan::default()
    };
    plan.assembly.units = vec![
        unit(&[(2, 3), (1, 2), (3, 4)]),
        unit(&[(6, 5)]),
        unit(&[(5, 1)]),
        unit(&[(4, 6)]),
    ];
    Case {
        spots: (1..=6).collect(),
        pins: Vec::new(),
        parameters: PlannerParameters::default(),
        modules: 6,
        decisions: vec![decision(&[(3, 4)]), block, chain, decision(&[(1, 5)])],
        plan,
    }
}

impl Case {
    fn problem(&self) -> PlanningProblem {
        let raw = RawTarget {
            frame_id: "map".to_owned(),
            spots: self
                .spots
                .iter()
                .map(|&id| RawSpot {
                    id,
                    x: f64::from(id),
                    y: 0.0,
                    theta: 0.0,
                })
                .collect(),
            edges: self
                .spots
                .windows(2)
                .map(|pair| [pair[0], pair[1]])
                .collect(),
        };
        let modules = (1..=self.modules)
            .map(|id| PlanningModule {
                id: ModuleId(id),
                pose: Pose::default(),
                links: match id {
                    1 | 3 => [ModuleId(2)].into(),
                    2 => [ModuleId(1), ModuleId(3)].into(),
                    _ => BTreeSet::new(),
                },
                configuration: None,
                leader: None,
                pin: self
                    .pins
                    .iter()
                    .find(|pin| pin.0 == id)
                    .map(|pin| SpotId(pin.1)),
            })
            .collect();
        PlanningProblem::new(
            Arc::new(Target::try_from(raw).unwrap()),
            self.parameters,
            modules,
        )
        .unwrap()
    }

    fn violations(&self) -> Vec<Violation> {
        check_plan(&self.problem(), &self.decisions, &self.plan)
            .err()
            .unwrap_or_default()
    }
}

/// What the checker finds once the good case is changed.
fn after(change: impl FnOnce(&mut Case)) -> Vec<Violation> {
    let mut case = good();
    change(&mut case);
    case.violations()
}

#[track_caller]
fn assert_finds(violations: &[Violation], expected: &Violation) {
    assert!(
        violations.contains(expected),
        "expected {expected:?} among {violations:?}"
    );
}

#[test]
fn a_good_plan_passes() {
    assert_eq!(good().violations(), []);
}

#[test]
fn a_wrong_assignment_is_found() {
    let found = after(|case| {
        case.plan.assignments.remove(&ModuleId(5));
    });
    assert_finds(
        &found,
        &Violation::WrongCount {
            filled: 5,
            expected: 6,
        },
    );
    assert_finds(
        &found,
        &Violation::ReplayDiffers {
            module: ModuleId(5),
            claimed: Some(SpotId(1)),
            planned: None,
        },
    );
    let found = after(|case| {
        case.plan.assignments.insert(ModuleId(5), SpotId(6));
    });
    assert_finds(
        &found,
        &Violation::TwoHolders {
            spot: SpotId(6),
            first: ModuleId(4),
            second: ModuleId(5),
        },
    );
    let found = after(|case| {
        case.plan.assignments.insert(ModuleId(9), SpotId(8));
    });
    assert_finds(
        &found,
        &Violation::UnknownModule {
            module: ModuleId(9),
        },
    );
    assert_finds(&found, &Violation::UnknownSpot { spot: SpotId(8) });
    let found = after(|case| case.pins = vec![(5, 2)]);
    assert_finds(
        &found,
        &Violation::PinLost {
            module: ModuleId(5),
            pin: SpotId(2),
            spot: Some(SpotId(1)),
        },
    );
}

#[test]
fn a_hole_between_filled_spots_is_found() {
    let apart = Violation::Apart {
        from: SpotId(1),
        unreached: SpotId(3),
    };
    let with_a_hole = |case: &mut Case| {
        case.spots = (1..=8).collect();
        case.decisions.truncate(1);
        case.decisions.push(decision(&[(3, 1), (4, 2), (5, 3)]));
        case.decisions[0] = decision(&[(1, 4)]);
        case.modules = 4;
        case.plan.assignments = [(1, 3), (2, 4), (3, 5), (4, 1)]
            .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
            .into();
    };
    assert_finds(&after(with_a_hole), &apart);
    // It is meant to be there where every spot is kept.
    let kept = after(|case| {
        with_a_hole(case);
        case.parameters.keep_all_spots = true;
        case.plan.assembly.units = vec![unit(&[(4, 1)]), unit(&[(2, 4), (1, 3), (3, 5)])];
    });
    assert_eq!(kept, []);
}

#[test]
fn pins_excuse_a_hole_only_where_it_cannot_be_closed() {
    let pinned = |far: u32| {
        let case = |case: &mut Case| {
            case.spots = (1..=8).collect();
            case.modules = 5;
            case.pins = vec![(4, 1), (5, far)];
            case.decisions = vec![decision(&[(far - 3, 1), (far - 2, 2), (far - 1, 3)])];
            case.plan.assignments = [(1, far - 3), (2, far - 2), (3, far - 1), (4, 1), (5, far)]
                .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
                .into();
            let mut pins = [unit(&[(4, 1)]), unit(&[(5, far)])];
            pins.iter_mut().for_each(|unit| unit.pinned = true);
            case.plan.assembly.units = pins.into();
            case.plan
                .assembly
                .units
                .push(unit(&[(3, far - 1), (2, far - 2), (1, far - 3)]));
        };
        after(case)
    };
    assert_eq!(pinned(5), []);
    assert_eq!(pinned(8), []);
    // Five modules could fill spots 1 to 5 without a hole.
    let hole = after(|case| {
        case.spots = (1..=8).collect();
        case.modules = 5;
        case.pins = vec![(4, 1), (5, 3)];
        case.decisions = vec![decision(&[(4, 1), (5, 2), (6, 3)])];
        case.plan.assignments = [(1, 4), (2, 5), (3, 6), (4, 1), (5, 3)]
            .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
            .into();
    });
    assert_finds(
        &hole,
        &Violation::Apart {
            from: SpotId(1),
            unreached: SpotId(3),
        },
    );
}

#[test]
fn wrong_turns_are_found() {
    let found = after(|case| case.decisions.extend(vec![Decision::default(); 9]));
    assert_eq!(
        found,
        [Violation::TooManyTurns {
            turns: 13,
            modules: 6
        }]
    );
    // The chain's end is reported wrongly.
    let found = after(|case| case.decisions[2].evictions[0].to = Some(SpotId(1)));
    assert_finds(
        &found,
        &Violation::WrongEviction {
            turn: 2,
            module: ModuleId(4),
            spot: SpotId(1),
        },
    );
    // The evicted never held the spot.
    let found = after(|case| case.decisions[2].evictions[0].from = SpotId(6));
    assert_finds(
        &found,
        &Violation::WrongEviction {
            turn: 2,
            module: ModuleId(4),
            spot: SpotId(6),
        },
    );
    let found = after(|case| case.parameters.d_max = Some(0));
    assert_eq!(
        found,
        [Violation::ChainTooLong {
            turn: 2,
            evictions: 1,
            limit: 0
        }]
    );
}

#[test]
fn chains_of_several_evictions_are_followed() {
    // Module 5 takes spot 6 from 4, which takes spot 5 from 6, which goes to spot 1.
    let mut case = good();
    let mut chain = decision(&[(1, 6), (5, 4), (6, 5)]);
    chain.evictions = vec![eviction(4, 5, 6, Some(5)), eviction(6, 4, 5, Some(1))];
    case.decisions[3] = chain;
    case.plan.assignments = [(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1)]
        .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
        .into();
    case.plan.assembly.units = vec![
        unit(&[(2, 3), (1, 2), (3, 4)]),
        unit(&[(4, 5)]),
        unit(&[(6, 1)]),
        unit(&[(5, 6)]),
    ];
    assert_eq!(case.violations(), []);
    case.parameters.d_max = Some(2);
    assert_eq!(case.violations(), []);
    case.parameters.d_max = Some(1);
    assert_eq!(case.violations().len(), 1);
}

#[test]
fn wrong_blocks_and_links_are_found() {
    let found = after(|case| case.plan.blocks.clear());
    assert_finds(
        &found,
        &Violation::WrongBlock {
            module: ModuleId(1),
        },
    );
    let found = after(|case| {
        case.plan.blocks.push(vec![ModuleId(4), ModuleId(5)]);
    });
    assert_finds(
        &found,
        &Violation::WrongBlock {
            module: ModuleId(4),
        },
    );
    let found = after(|case| {
        case.plan.kept_links.remove(&(ModuleId(1), ModuleId(2)));
    });
    assert_eq!(
        found,
        [Violation::WrongKeptLink {
            first: ModuleId(1),
            second: ModuleId(2),
            listed: false
        }]
    );
    let found = after(|case| {
        case.plan.kept_links.insert((ModuleId(3), ModuleId(6)));
    });
    assert_eq!(
        found,
        [Violation::WrongKeptLink {
            first: ModuleId(3),
            second: ModuleId(6),
            listed: true
        }]
    );
    // The block's middle module is put at its end, so that one of its links breaks.
    let found = after(|case| {
        case.decisions[1].selections = decision(&[(2, 1), (3, 3), (4, 2), (5, 4)]).selections;
        case.decisions[1].evictions = vec![eviction(4, 3, 3, Some(5))];
        case.plan.assignments.insert(ModuleId(2), SpotId(4));
        case.plan.assignments.insert(ModuleId(3), SpotId(3));
        case.plan.kept_links.remove(&(ModuleId(1), ModuleId(2)));
        case.plan.assembly.units[0] = unit(&[(3, 3), (1, 2), (2, 4)]);
    });
    assert_finds(
        &found,
        &Violation::BlockApart {
            first: ModuleId(1),
            unreached: ModuleId(2),
        },
    );
    // Two modules of it do keep their link, and are what the turn really placed as a block.
    assert_finds(
        &found,
        &Violation::WrongBlock {
            module: ModuleId(2),
        },
    );
    assert_eq!(found.len(), 3);
}

#[test]
fn a_wrong_acting_order_is_found() {
    let found = after(|case| {
        case.plan.assembly.units.pop();
    });
    assert_eq!(
        found,
        [Violation::WrongListing {
            module: ModuleId(4),
            times: 0
        }]
    );
    let found = after(|case| {
        let again = case.plan.assembly.units[3].clone();
        case.plan.assembly.units.push(again);
    });
    assert_eq!(
        found,
        [Violation::WrongListing {
            module: ModuleId(4),
            times: 2
        }]
    );
    let found = after(|case| case.plan.assembly.units.swap(1, 3));
    assert_eq!(
        found,
        [Violation::NoPlacedNeighbour {
            module: ModuleId(4),
            spot: SpotId(6)
        }]
    );
    // Inside a unit, too.
    let found = after(|case| case.plan.assembly.units[0].placements.swap(0, 2));
    assert_eq!(
        found,
        [Violation::NoPlacedNeighbour {
            module: ModuleId(1),
            spot: SpotId(2)
        }]
    );
    let found = after(|case| case.plan.assembly.units[0].lead = ModuleId(2));
    assert_eq!(found, [Violation::WrongUnit { lead: ModuleId(2) }]);
    let found = after(|case| {
        let tail = case.plan.assembly.units[0].placements.split_off(1);
        case.plan.assembly.units.insert(
            1,
            ActingUnit {
                lead: ModuleId(1),
                placements: tail,
                pinned: false,
            },
        );
    });
    assert_eq!(found, vec![Violation::WrongUnit { lead: ModuleId(1) }; 2]);
    let found = after(|case| case.plan.assembly.units[3].pinned = true);
    assert_eq!(found, [Violation::WrongPin { lead: ModuleId(4) }]);
}

/// Modules 5 and 6 swap spots 1 and 5 after the last claim.
fn swapped(swaps: &[(u32, u32)]) -> Case {
    let mut case = good();
    if let Some(last) = case.decisions.last_mut() {
        last.swaps = decision(swaps).selections;
    }
    let plan = &mut case.plan;
    for (module, spot) in [(5, 5), (6, 1)] {
        plan.assignments.insert(ModuleId(module), SpotId(spot));
    }
    plan.assembly.units[1] = unit(&[(5, 5)]);
    plan.assembly.units[2] = unit(&[(6, 1)]);
    case
}

fn violations_of_swaps(case: &Case) -> Vec<Violation> {
    let found = check_swapped_plan(&case.problem(), &case.decisions, &case.plan);
    found.err().unwrap_or_default()
}

#[test]
fn a_swap_of_equal_units_passes() {
    assert_eq!(violations_of_swaps(&swapped(&[(1, 6), (5, 5)])), []);
}

#[test]
fn a_wrong_swap_is_found() {
    let wrong = |spot, module| Violation::WrongSwap {
        turn: 3,
        spot: SpotId(spot),
        module: ModuleId(module),
    };
    // Spot 5 would be left open.
    assert_finds(&violations_of_swaps(&swapped(&[(1, 6)])), &wrong(1, 6));
    // Module 6 would take two spots.
    let twice = swapped(&[(1, 6), (4, 6), (5, 5)]);
    assert_finds(&violations_of_swaps(&twice), &wrong(4, 6));
    // Module 5 holds spot 1 already.
    let idle = swapped(&[(1, 5)]);
    assert_finds(&violations_of_swaps(&idle), &wrong(1, 5));
    let mut pinned = swapped(&[(1, 6), (5, 5)]);
    pinned.pins = vec![(5, 1)];
    pinned.decisions.pop();
    pinned.decisions[2].swaps = decision(&[(1, 6), (5, 5)]).selections;
    let found = violations_of_swaps(&pinned);
    assert!(
        found
            .iter()
            .any(|one| matches!(one, Violation::WrongSwap { turn: 2, .. })),
        "{found:?}"
    );
    let mut paper = swapped(&[(1, 6), (5, 5)]);
    paper.parameters.policy = Policy::Paper;
    assert_finds(&violations_of_swaps(&paper), &wrong(1, 6));
}

#[test]
fn no_turn_follows_a_swap() {
    let mut case = swapped(&[(1, 6), (5, 5)]);
    case.decisions.push(Decision::default());
    assert_finds(
        &violations_of_swaps(&case),
        &Violation::SwapTooEarly { turn: 4 },
    );
}

/// The members of a block that a swap parts move as single modules.
#[test]
fn a_swap_that_parts_a_block_leaves_no_block() {
    let mut case = good();
    let mut replay = Replay::new(&case.problem());
    if let Some(last) = case.decisions.last_mut() {
        last.swaps = decision(&[(1, 1), (2, 5)]).selections;
    }
    for (turn, decision) in (0..).zip(&case.decisions) {
        replay.apply(&case.problem(), turn, decision);
    }
    assert_eq!(replay.violations, []);
    assert!(replay.blocks.is_empty(), "{:?}", replay.blocks);
}
