//! A network that is cut in two and healed, with real sockets: network namespaces with a switch between them.

use std::thread;
use std::time::{Duration, Instant};

#[cfg(feature = "zenoh")]
use formation_tests::Running;
use formation_tests::{Domain, Fleet, FleetTiming, Network};

use super::PATIENCE;

/// As many modules as spots; modules 1, 2 and 3 are docked.
const FIVE: &str = "
name: five
target:
  frame_id: map
  spots:
    - {id: 1, x: 5, y: 5}
    - {id: 2, x: 6, y: 5}
    - {id: 3, x: 7, y: 5}
    - {id: 4, x: 8, y: 5}
    - {id: 5, x: 9, y: 5}
  edges: [[1, 2], [2, 3], [3, 4], [4, 5]]
configurations:
  - id: 1
    leader: 2
    modules: [{id: 1, x: 1, y: 1}, {id: 2, x: 2, y: 1}, {id: 3, x: 3, y: 1}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 12, y: 12}
  - {id: 5, x: 5, y: 12, theta: 1.0}
";

const MINORITY: [u32; 2] = [4, 5];

/// Shows Q6.
#[test]
fn the_majority_finishes_the_minority_waits_and_healing_gives_one_formation() {
    let domain = &*Domain::for_processes(7);
    let Some(network) = Network::with_sides(2) else {
        return;
    };
    cut_and_heal(
        &network,
        Fleet::new("cut", FIVE, domain, FleetTiming::Quick),
    );
}

/// Over Zenoh, each side has a router, and the cut is between these.
#[cfg(feature = "zenoh")]
#[test]
fn sides_whose_routers_are_cut_over_zenoh_are_one_again_when_healed() {
    let domain = &*Domain::for_processes(9);
    let Some(network) = Network::with_sides(2) else {
        return;
    };
    let other = format!("tcp/{}:7447", Network::address(0));
    let others: [&[&str]; 2] = [&[], &[&other]];
    let _routers = [0, 1].map(|side| {
        let network = Some(network.side(side));
        Running::start_router(network, domain, "tcp/0.0.0.0:7447", others[side])
    });
    let fleet = Fleet::new("zenoh cut", FIVE, domain, FleetTiming::Quick);
    cut_and_heal(&network, fleet.over_zenoh("tcp/127.0.0.1:7447"));
}

/// Cuts the network while the first unit is on its way, and heals it when the majority has formed.
fn cut_and_heal(network: &Network, mut fleet: Fleet) {
    let sides = [network.side(0), network.side(1)];
    let judges = sides.map(|side| fleet.judge(Some(side)));
    let _announcer = fleet.announce(Some(sides[0]));
    let marks = fleet.marks();
    for module in fleet.modules().to_vec() {
        let side = usize::from(MINORITY.contains(&module));
        fleet.start(module, Some(sides[side]));
    }
    // Cut while the first unit is on its way.
    let moving = fleet.wait_for_any(&marks, "moving to", PATIENCE);
    assert!(moving.is_some(), "{}", fleet.story());
    network.cut();
    let cut = Instant::now();
    let partial = judges[0].wait_until(cut, PATIENCE, |judged| judged.outcome == "PARTIAL");
    let partial = partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    assert_eq!(partial.modules(), [1, 2, 3].into(), "the majority forms");
    for module in MINORITY {
        let waits = fleet
            .agent(module)
            .wait_for_log(0, "waiting for a quorum: 2 of 5", PATIENCE);
        assert!(waits.is_some(), "{}", fleet.story());
    }
    let marks = fleet.marks();
    thread::sleep(Duration::from_secs(2));
    for module in MINORITY {
        for line in fleet.agent(module).log_since(marks[&module]) {
            for deed in ["convened", "planning", "moving to", "settled on"] {
                assert!(!line.text.contains(deed), "module {module}: {}", line.text);
            }
        }
    }
    assert!(
        judges[1].verdicts().is_empty(),
        "the minority does not form"
    );
    network.heal();
    let healed = Instant::now();
    let whole = judges
        .each_ref()
        .map(|judge| fleet.wait_until_whole(judge, healed, PATIENCE));
    assert_eq!(whole[0].epoch, whole[1].epoch);
    assert_eq!(whole[0].assignments, whole[1].assignments);
}
