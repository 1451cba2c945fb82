//! The normalised events of short runs, compared line by line with what is kept under `tests/transcripts`.
//!
//! A change of the protocol shows here as a difference to read. `FORMATION_UPDATE_TRANSCRIPTS=1` rewrites the files when the
//! change is intended. The copy of the protocol that may have bugs is compared as well, as it must be the same without one.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::support::{Trial, drawn, in_phase, scenario};
use formation_generate::Grouping;
use formation_model::{ModuleId, ModulePhase};
use formation_protocol::Command;
use formation_sim::Cluster;

/// The nearest spot of the second module is taken when its turn comes.
const CHAIN: &str = "
name: chain
target:
  spots:
    - {id: 1, x: 10.0, y: 10.0, theta: 0.0}
    - {id: 2, x: 11.0, y: 10.0, theta: 0.0}
    - {id: 3, x: 12.0, y: 10.0, theta: 0.0}
  edges: [[1, 2], [2, 3]]
singletons:
  - {id: 1, x: 10.0, y: 8.0, theta: 0.0}
  - {id: 2, x: 10.0, y: 6.0, theta: 0.0}
  - {id: 3, x: 4.0, y: 10.0, theta: 0.0}
";

/// A line of four cannot keep together on a star of four: one breaks off.
const BLOCK: &str = "
name: block
target:
  spots:
    - {id: 1, x: 10.0, y: 10.0, theta: 0.0}
    - {id: 2, x: 11.0, y: 10.0, theta: 0.0}
    - {id: 3, x: 9.0, y: 10.0, theta: 0.0}
    - {id: 4, x: 10.0, y: 11.0, theta: 0.0}
  edges: [[1, 2], [1, 3], [1, 4]]
configurations:
  - id: 1
    modules:
      - {id: 1, x: 1.0, y: 1.0, theta: 0.0}
      - {id: 2, x: 2.0, y: 1.0, theta: 0.0}
      - {id: 3, x: 3.0, y: 1.0, theta: 0.0}
      - {id: 4, x: 4.0, y: 1.0, theta: 0.0}
    edges: [[1, 2], [2, 3], [3, 4]]
";

fn compare(name: &str, events: &str) {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = package.ancestors().map(|at| at.join("tests/transcripts"));
    let folder = folders.find(|folder| folder.is_dir()).unwrap();
    let path = folder.join(name).with_extension("txt");
    if std::env::var_os("FORMATION_UPDATE_TRANSCRIPTS").is_some_and(|value| value == "1") {
        fs::write(&path, events).unwrap();
        return;
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    if kept == events {
        return;
    }
    let (kept, events): (Vec<&str>, Vec<&str>) = (kept.lines().collect(), events.lines().collect());
    let same = kept
        .iter()
        .zip(&events)
        .take_while(|(one, other)| one == other)
        .count();
    let mut difference = String::new();
    for line in &kept[same.saturating_sub(3)..same] {
        writeln!(difference, "  {line}").unwrap();
    }
    for line in kept[same..].iter().take(12) {
        writeln!(difference, "- {line}").unwrap();
    }
    for line in events[same..].iter().take(12) {
        writeln!(difference, "+ {line}").unwrap();
    }
    panic!(
        "tests/transcripts/{name}.txt differs from line {} on; if that is intended, run this test with \
         FORMATION_UPDATE_TRANSCRIPTS=1\n{difference}",
        same + 1
    );
}

/// Shows C4.
#[test]
fn three_single_modules_agree_and_move() {
    let mut trial = Trial::new(&drawn(3, 3, Grouping::Singletons, 1), 1);
    trial.until(Cluster::has_formed);
    compare("singletons_agree", &trial.cluster.transcript().events());
}

#[test]
fn a_later_unit_evicts_an_earlier_one() {
    let mut trial = Trial::new(&scenario(CHAIN), 1);
    trial.until(Cluster::has_formed);
    assert!(
        trial
            .cluster
            .transcript()
            .events()
            .contains(" eviction epoch=")
    );
    compare("eviction_chain", &trial.cluster.transcript().events());
}

#[test]
fn a_block_that_does_not_fit_breaks() {
    let mut trial = Trial::new(&scenario(BLOCK), 1);
    trial.until(Cluster::has_formed);
    compare("block_and_remainder", &trial.cluster.transcript().events());
}

/// Shows E4, G6.
#[test]
fn another_module_convenes_when_the_convener_dies() {
    let mut trial = Trial::new(&drawn(4, 4, Grouping::Singletons, 2), 2);
    trial.until(|cluster| in_phase(cluster, ModulePhase::Gathered).len() == 3);
    trial.cluster.crash(ModuleId(1));
    trial.until(Cluster::has_formed);
    compare("convener_dies", &trial.cluster.transcript().events());
}

#[test]
fn a_cut_network_heals() {
    let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, 3), 3);
    trial.until(Cluster::has_formed);
    let aside = BTreeSet::from([ModuleId(1), ModuleId(2)]);
    trial.cluster.cut(&aside);
    trial.run_for(Duration::from_secs(20));
    trial.cluster.heal();
    trial.until_formed_again();
    assert!(
        trial
            .cluster
            .transcript()
            .events()
            .contains("waiting_for_quorum present=2 of=5")
    );
    compare("cut_heals", &trial.cluster.transcript().events());
}

#[test]
fn a_module_restarts() {
    let mut trial = Trial::new(&drawn(4, 4, Grouping::Singletons, 4), 4);
    trial.until(Cluster::has_formed);
    trial.cluster.crash(ModuleId(3));
    trial.run_for(Duration::from_secs(1));
    trial.cluster.restart(ModuleId(3));
    trial.until_formed_again();
    compare("module_restarts", &trial.cluster.transcript().events());
}

/// Shows S4.
#[test]
fn a_module_retires_and_a_spare_takes_its_spot() {
    let mut trial = Trial::new(&drawn(4, 3, Grouping::Singletons, 5), 5);
    trial.until(Cluster::has_formed);
    let (retired, _) = trial.settled()[0];
    trial.cluster.command(retired, Command::Retire);
    trial.until(|cluster| cluster.has_formed() && crate::support::newest_epoch(cluster) == 2);
    compare("module_retires", &trial.cluster.transcript().events());
}
