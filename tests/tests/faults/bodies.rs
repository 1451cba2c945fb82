//! Processes die, and their robots stay where they are.

use std::collections::BTreeSet;
use std::time::Instant;

use formation_tests::{Domain, Fleet, Running, Timing};

use super::{PATIENCE, SPARES};

#[test]
fn five_modules_that_die_block_their_spots_until_their_bodies_are_removed() {
    let domain = &*Domain::for_processes(12);
    let mut fleet = Fleet::new("bodies", SPARES, domain, Timing::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let marks = fleet.marks();
    fleet.start_all();
    let moving = fleet.wait_for_any(&marks, "moving to", PATIENCE);
    assert!(moving.is_some(), "{}", fleet.story());
    let began = Instant::now();
    let whole = fleet.wait_until_whole(&judge, began, PATIENCE);
    // Spot 2 joins the others, so its module lives on; the fifth module stands on no spot.
    let holders = whole.assignments.iter().filter(|&(_, &spot)| spot != 2);
    let mut lost: Vec<u32> = holders.map(|(&module, _)| module).collect();
    lost.extend(whole.unassigned.iter().next_back());
    assert_eq!(lost.len(), 5);
    let mut dead = BTreeSet::new();
    for batch in lost.chunks(3) {
        let died = batch.iter().map(|&module| fleet.kill(module)).max();
        dead.extend(batch.iter().copied());
        let living = fleet.living();
        let partial = judge.wait_until(died.unwrap(), PATIENCE, |judged| {
            judged.outcome == "PARTIAL" && judged.modules() == living
        });
        let partial = partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
        assert_eq!(partial.violations, [""; 0]);
        // Each spot of a dead module is blocked by name, and no other module stands on it.
        for (module, spot) in &whole.assignments {
            let blocker = partial.blocked.get(spot);
            assert_eq!(blocker, dead.get(module), "{partial:?}");
            assert_eq!(
                partial.assignments.get(module),
                blocker.xor(Some(module)).and(Some(spot))
            );
        }
    }
    let (_, spot) = whole
        .assignments
        .iter()
        .find(|(module, _)| **module == lost[0])
        .unwrap();
    let named = format!("spot {spot} is blocked by the body of module {}", lost[0]);
    let says_so = fleet.living().into_iter().any(|module| {
        let lines = fleet.agent(module).log_since(0);
        lines.iter().any(|line| line.text.contains(&named))
    });
    assert!(says_so, "no {named:?} in\n{}", fleet.story());
    // The living have no process of theirs reported as gone.
    let live = whole.assignments.iter().find(|&(_, &spot)| spot == 2);
    let live = live.unwrap().0.to_string();
    let refused = Running::start("formation", domain, &["remove", &live]).finish(PATIENCE);
    assert_eq!(refused.status, 1, "{}", refused.stderr);
    let removed = Instant::now();
    fleet.remove(&lost);
    fleet.wait_until_whole(&judge, removed, PATIENCE);
}
