//! Processes that end in order, or join the graph anew: they say so, and nobody waits until they have been silent for long.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::time::Duration;

use formation_generate::Grouping;
use formation_model::ModuleId;
use formation_protocol::{AgentParameters, EpochReason, Event};
use formation_sim::{ClusterParameters, Stores};

use crate::support::{Trial, drawn};

const GONE: ModuleId = ModuleId(3);

/// A formation whose modules have stores.
fn formed() -> Trial {
    let parameters = ClusterParameters {
        stores: Stores::All,
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&drawn(5, 5, Grouping::Singletons, 1), parameters, 1);
    trial.until_formed_again();
    trial.run_for(Duration::from_secs(10));
    trial
}

/// The reasons of the epochs from the `first` on.
fn reasons(trial: &Trial, first: usize) -> Vec<EpochReason> {
    let convened = trial.noted.iter().filter_map(|(_, event)| match event {
        Event::Convened(_, reason) => Some(reason.clone()),
        _ => None,
    });
    convened.skip(first).collect()
}

/// Shows M9.
#[test]
fn the_others_go_on_without_a_module_that_has_left_after_a_lease() {
    let mut trial = formed();
    let (before, left) = (trial.convened.len(), trial.cluster.now());
    trial.cluster.leave(GONE);
    trial.run_for(Duration::from_secs(20));
    assert_eq!(reasons(&trial, before), [EpochReason::Left(vec![GONE])]);
    let waited = trial.convened[before] - left;
    let AgentParameters {
        lease, suspicion, ..
    } = AgentParameters::default();
    assert!(lease <= waited && waited < suspicion, "{waited:?}");
}

/// Shows M9.
#[test]
fn a_module_that_leaves_and_comes_back_at_once_opens_one_epoch() {
    let mut trial = formed();
    let (before, left) = (trial.convened.len(), trial.cluster.now());
    trial.cluster.leave(GONE);
    trial.run_for(Duration::from_secs(1));
    trial.cluster.restart(GONE);
    trial.run_for(Duration::from_secs(20));
    assert_eq!(
        reasons(&trial, before),
        [EpochReason::Restarted(vec![GONE])]
    );
    let waited = trial.convened[before] - left;
    assert!(waited < AgentParameters::default().suspicion, "{waited:?}");
    assert!(trial.cluster.has_formed());
}

/// The new runs know of the epoch that was, and are in none.
/// Shows E4.
#[test]
fn modules_that_all_leave_and_come_back_at_once_do_not_listen_first() {
    let mut trial = formed();
    let (before, left) = (trial.convened.len(), trial.cluster.now());
    let all = trial.cluster.running();
    for &module in &all {
        trial.cluster.leave(module);
    }
    trial.run_for(Duration::from_secs(1));
    for &module in &all {
        trial.cluster.restart(module);
    }
    trial.until_formed_again();
    assert_eq!(reasons(&trial, before), [EpochReason::NewTarget]);
    let waited = trial.convened[before] - left;
    assert!(waited < AgentParameters::default().suspicion, "{waited:?}");
}
