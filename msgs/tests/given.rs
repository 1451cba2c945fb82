//! The allocation of a target, as it travels.

use formation_model::{ModuleSize, TargetAnnouncement};
use formation_msgs::{self as wire, IntoCore, bounds};

fn selection(module_id: u32, spot_id: u32) -> wire::SpotSelection {
    wire::SpotSelection { spot_id, module_id }
}

fn read(edit: impl FnOnce(&mut wire::TargetConfiguration)) -> Result<TargetAnnouncement, String> {
    let spot = |id: u32| wire::Spot {
        id,
        x: f64::from(id),
        ..wire::Spot::default()
    };
    let mut target = wire::TargetConfiguration {
        spots: vec![spot(1), spot(2)],
        edges: vec![wire::Edge {
            first: 1,
            second: 2,
        }],
        allocation: vec![selection(7, 2), selection(5, 1)],
        ..wire::TargetConfiguration::default()
    };
    target.planner.policy = "given".to_owned();
    edit(&mut target);
    target
        .into_core(ModuleSize::METRE)
        .map_err(|error| error.to_string())
}

#[test]
fn an_allocation_arrives_as_it_was_sent() {
    let announcement = read(|target| target.detached = vec![7]).unwrap();
    let sent = wire::TargetConfiguration::new(&announcement, ModuleSize::METRE);
    assert_eq!(sent.allocation, [selection(5, 1), selection(7, 2)]);
    assert_eq!(sent.detached, [7]);
}

#[test]
fn a_wrong_allocation_is_refused() {
    type Edit = fn(&mut wire::TargetConfiguration);
    let refused: [(Edit, &str); 8] = [
        (
            |target| target.allocation[1] = selection(7, 1),
            "target: allocation[1].module: module 7 is listed twice: it has spot 2",
        ),
        (
            |target| target.allocation[1] = selection(5, 2),
            "target: allocation[1].spot: spot 2 is given twice: module 7 has it",
        ),
        (
            |target| target.allocation[1] = selection(5, 3),
            "target: allocation[1].spot: spot 3 is not in the target",
        ),
        (
            |target| target.detached = vec![5, 5],
            "target: detached[1]: module 5 is listed twice",
        ),
        (
            |target| target.allocation.clear(),
            "target: allocation: is for the policy `given`, which needs it",
        ),
        (
            |target| target.planner.policy.clear(),
            "target: allocation: is for the policy `given`, which needs it",
        ),
        (
            |target| target.withdrawn = true,
            "target: spots: must be empty while the target is withdrawn",
        ),
        (
            |target| target.allocation = vec![selection(5, 1); bounds::MODULES_MAX + 1],
            "target: allocation: 10001 entries, at most 10000 are allowed",
        ),
    ];
    for (edit, expected) in refused {
        assert_eq!(read(edit).unwrap_err(), expected);
    }
}
