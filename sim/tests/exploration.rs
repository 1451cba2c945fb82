//! Every schedule of three modules, up to a bound.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::time::Duration;

use crate::explorer::{Bound, Explorer};
use formation_model::{PlanningProblem, Scenario};
use formation_protocol::{Agent, Mutation};
use formation_sim::AgentFactory;

const THREE: &str = "
name: three
target:
  spots:
    - {id: 1, x: 5.0, y: 0.0, theta: 0.0}
    - {id: 2, x: 6.0, y: 0.0, theta: 0.0}
    - {id: 3, x: 7.0, y: 0.0, theta: 0.0}
  edges: [[1, 2], [2, 3]]
singletons:
  - {id: 1, x: 0.0, y: 0.0, theta: 0.0}
  - {id: 2, x: 0.0, y: 2.0, theta: 0.0}
  - {id: 3, x: 0.0, y: 4.0, theta: 0.0}
";

fn three() -> PlanningProblem {
    Scenario::from_yaml(THREE).unwrap().problem().clone()
}

fn bound(deviations: u8, fault: bool, until_s: u64) -> Bound {
    Bound {
        deviations,
        fault,
        until: Duration::from_secs(until_s),
    }
}

/// What the test command searches, and what the soak script does.
fn bounds() -> Vec<Bound> {
    if std::env::var("FORMATION_EXPLORE").is_ok_and(|size| size == "large") {
        vec![bound(2, false, 10), bound(1, true, 10)]
    } else {
        vec![bound(1, false, 10), bound(0, true, 10), bound(1, true, 1)]
    }
}

/// Shows C1.
#[test]
fn no_schedule_of_three_modules_breaks_anything() {
    for bound in bounds() {
        let searched = Explorer::new(three(), AgentFactory::default()).search(bound);
        println!(
            "{bound:?}: {} states, {} steps, {} ends",
            searched.states, searched.steps, searched.ends
        );
        if let Some((violation, trail)) = searched.violation {
            panic!("{violation} after\n{trail}");
        }
        assert!(searched.ends > 0 && searched.states > 100);
    }
}

/// The search sees what it should: these bugs need a certain order of messages, or a fault at a certain step.
#[test]
fn the_search_finds_bugs() {
    for (mutation, bound, found) in [
        (
            Mutation::SkipLeaseWait,
            bound(0, false, 10),
            "before the lease",
        ),
        (Mutation::AcceptStaleEpoch, bound(0, true, 10), "went back"),
        (
            Mutation::IgnoreQuorum,
            bound(0, true, 10),
            "a minority plans",
        ),
        (Mutation::CountDeadAsAlive, bound(0, true, 10), "no end"),
        (Mutation::ApplyOutOfTurn, bound(1, false, 10), "no end"),
    ] {
        let agents = AgentFactory::new(move |identity, parameters, now| {
            Agent::new(identity, parameters, now).mutated(mutation)
        });
        let searched = Explorer::new(three(), agents).search(bound);
        let violation = searched
            .violation
            .map(|(violation, _)| violation)
            .unwrap_or_default();
        println!("{mutation:?}: {violation} after {} states", searched.states);
        assert!(violation.contains(found), "{mutation:?}: {violation:?}");
    }
}
