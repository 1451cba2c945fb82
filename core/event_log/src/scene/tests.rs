use super::*;
use formation_model::{EvictionRecord, MicroUnits};

fn epoch(number: u64) -> Epoch {
    Epoch {
        number,
        convener: ModuleId(1),
    }
}

fn state(module: u32, phase: ModulePhase, spot: Option<u32>, unit: Option<u32>) -> LogEvent {
    LogEvent::State(ModuleSnapshot {
        module: ModuleId(module),
        phase,
        pose: Pose::default(),
        links: BTreeSet::new(),
        spot: spot.map(SpotId),
        unit: unit.map(ModuleId),
        in_service: true,
    })
}

fn roster(number: u64, modules: &[u32]) -> LogEvent {
    LogEvent::Roster {
        epoch: epoch(number),
        modules: modules.iter().copied().map(ModuleId).collect(),
        out_of_service: Vec::new(),
        problem: None,
    }
}

fn claim(turn: u32, pairs: &[(u32, u32)], evictions: &[(u32, u32, Option<u32>)]) -> LogEvent {
    let claimant = ModuleId(pairs[0].0);
    LogEvent::Claim {
        epoch: epoch(1),
        turn,
        claimant,
        decision: Decision {
            selections: pairs
                .iter()
                .map(|&(module, spot)| SpotSelection {
                    spot: SpotId(spot),
                    module: ModuleId(module),
                })
                .collect(),
            evictions: evictions
                .iter()
                .map(|&(evicted, from, to)| EvictionRecord {
                    evicted: ModuleId(evicted),
                    by: claimant,
                    from: SpotId(from),
                    to: to.map(SpotId),
                })
                .collect(),
            ..Decision::default()
        },
    }
}

/// The spots whose holder an entry changes, and its steps.
fn apply(scene: &mut Scene, event: LogEvent) -> (Vec<(u32, Option<u32>)>, Vec<String>) {
    let entry = Entry { at_ms: 7, event };
    let changes = scene.apply(&entry);
    let holders = changes.holders.iter();
    (
        holders
            .map(|(spot, module)| (spot.0, module.map(|module| module.0)))
            .collect(),
        changes.steps.iter().map(ToString::to_string).collect(),
    )
}

fn held(scene: &Scene) -> Vec<(u32, u32)> {
    let holders = scene.holders().iter();
    holders.map(|(spot, module)| (spot.0, module.0)).collect()
}

#[test]
fn claims_move_spots_from_holder_to_holder() {
    let mut scene = Scene::default();
    apply(&mut scene, roster(1, &[1, 2, 3]));
    assert!(scene.is_fresh_start());
    assert_eq!(scene.stage(), FormationStage::Planning);
    apply(&mut scene, claim(0, &[(1, 1), (2, 2)], &[]));
    let (changed, _) = apply(&mut scene, claim(1, &[(3, 1), (1, 5)], &[(1, 1, Some(5))]));
    assert_eq!(changed, [(1, Some(3)), (5, Some(1))]);
    assert_eq!(held(&scene), [(1, 3), (2, 2), (5, 1)]);
    let (changed, steps) = apply(&mut scene, claim(2, &[(2, 3)], &[(1, 5, None)]));
    assert_eq!(changed, [(2, None), (5, None), (3, Some(2))]);
    assert_eq!(
        steps,
        ["Turn 3: module 2 takes spot 3; module 1 yields spot 5"]
    );
    assert_eq!(scene.decisions().len(), 3);

    let (changed, steps) = apply(&mut scene, LogEvent::Gathering(epoch(2)));
    assert_eq!(changed, [(1, None), (3, None)]);
    assert_eq!(steps, ["Epoch 2: all modules halt and gather again"]);
    assert_eq!((held(&scene), scene.decisions().len()), (Vec::new(), 0));
    assert_eq!(scene.stage(), FormationStage::Gathering);
}

#[test]
fn members_that_settled_before_the_epoch_hold_their_spots() {
    let mut scene = Scene::default();
    apply(&mut scene, state(1, ModulePhase::Gathered, Some(4), None));
    apply(&mut scene, state(2, ModulePhase::Gathered, None, None));
    apply(&mut scene, state(3, ModulePhase::Gathered, Some(6), None));
    let (changed, steps) = apply(&mut scene, roster(1, &[1, 2]));
    assert_eq!(changed, [(4, Some(1))], "module 3 is no member");
    assert_eq!(steps, ["The roster is fixed: 2 modules take part"]);
    assert!(!scene.is_fresh_start());
}

#[test]
fn a_unit_sets_off_once_and_settles_as_a_whole() {
    use ModulePhase::{Gathered, Listening, Moving, Settled, Waiting};
    let mut scene = Scene::default();
    let mut steps = Vec::new();
    for event in [
        roster(1, &[1, 2, 3]),
        claim(0, &[(1, 1), (2, 2)], &[]),
        state(3, Settled, Some(3), None),
        state(1, Waiting, Some(1), Some(1)),
        state(2, Waiting, Some(2), Some(1)),
        state(1, Moving, Some(1), Some(1)),
        state(2, Moving, Some(2), Some(1)),
        state(1, Settled, Some(1), Some(1)),
        state(2, Settled, Some(2), Some(1)),
        state(3, Gathered, Some(3), None),
        state(3, Settled, Some(3), None),
        state(3, Listening, None, None),
    ] {
        steps.append(&mut apply(&mut scene, event).1);
    }
    assert_eq!(
        steps,
        [
            "The roster is fixed: 3 modules take part",
            "Turn 1: modules 1 and 2 take spots 1 and 2",
            "All modules hold the same plan; they may move now",
            "Modules 1 and 2 set off together",
            "Modules 1 and 2 have settled",
            "Module 3 starts again",
        ]
    );
    assert_eq!(scene.stage(), FormationStage::Acting);
    assert!(!scene.is_moving());
}

#[test]
fn a_module_is_where_its_latest_entry_says() {
    let mut scene = Scene::default();
    let module = ModuleId(1);
    let pose = Pose {
        x: MicroUnits(5),
        ..Pose::default()
    };
    apply(&mut scene, LogEvent::Pose { module, pose });
    assert!(scene.modules().is_empty(), "it has reported no state yet");
    apply(&mut scene, state(1, ModulePhase::Moving, None, None));
    apply(&mut scene, LogEvent::Pose { module, pose });
    scene.note_received(900, module);
    assert_eq!(scene.pose_of(module), Some(pose));
    assert_eq!(scene.modules()[&module].received_ms, 900);
    assert!(scene.is_moving());
}
