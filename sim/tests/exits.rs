//! Runs whose spots lie off the lattice: in hexagonal rows, at any distance, in parts that are turned against each other.

use std::sync::Arc;

use formation_model::Scenario;
use formation_sim::{CampaignParameters, Ending, FaultKind, ViolationKind, run_seeds};

use crate::support::run_all;

/// The number of seeds of each kind.
const SEEDS: u64 = 12;

/// Six round modules around one.
const HEXAGON: &str = include_str!("../../tests/scenarios/hexagon.yaml");

/// Two rows of three, 2.4 units apart and offset by 0.3.
const GAP: &str = "
target:
  spots:
    - {id: 1, x: 0, y: 0}
    - {id: 2, x: 1, y: 0}
    - {id: 3, x: 2, y: 0}
    - {id: 4, x: 0.3, y: 2.4}
    - {id: 5, x: 1.3, y: 2.4}
    - {id: 6, x: 2.3, y: 2.4}
  edges: [[1, 2], [2, 3], [4, 5], [5, 6], [2, 5]]
configurations:
  - id: 1
    modules: [{id: 1, x: 7, y: 0}, {id: 2, x: 8, y: 0}, {id: 3, x: 9, y: 0}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 7, y: 3}
  - {id: 5, x: 9, y: 3}
  - {id: 6, x: 11, y: 3}
";

/// A row, and beside it one that is turned by 20 degrees.
const TURNED: &str = "
target:
  spots:
    - {id: 1, x: 0, y: 0}
    - {id: 2, x: 1, y: 0}
    - {id: 3, x: 2, y: 0}
    - {id: 4, x: 0.5, y: 1.5, theta: 0.349066}
    - {id: 5, x: 1.4396926, y: 1.8420201, theta: 0.349066}
    - {id: 6, x: 2.3793852, y: 2.1840403, theta: 0.349066}
  edges: [[1, 2], [2, 3], [4, 5], [5, 6], [1, 4]]
configurations:
  - id: 1
    modules: [{id: 1, x: 7, y: 0}, {id: 2, x: 8, y: 0}, {id: 3, x: 9, y: 0}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 7, y: 3, theta: 0.4}
  - {id: 5, x: 9, y: 3}
  - {id: 6, x: 11, y: 3}
";

fn parameters(text: &str, faults: FaultKind) -> CampaignParameters {
    let scenario = Scenario::from_yaml(text).unwrap();
    CampaignParameters {
        faults,
        problem: Some(Arc::new(scenario.problem().clone())),
        ..CampaignParameters::default()
    }
}

#[test]
fn spots_off_the_lattice_are_taken_without_contact() {
    for text in [HEXAGON, GAP, TURNED] {
        run_all(&parameters(text, FaultKind::None), 0..SEEDS);
    }
}

/// Modules that are stopped on an exit plan again from where they stand, beside those that rest.
#[test]
fn stops_on_exits_lead_to_no_contact() {
    for text in [HEXAGON, GAP, TURNED] {
        let parameters = CampaignParameters {
            transcripts: true,
            ..parameters(text, FaultKind::Stops)
        };
        run_seeds(&parameters, 0..SEEDS, |report| {
            let seed = report.seed;
            assert!(
                report.violations.is_empty(),
                "{seed}: {:?}",
                report.violations
            );
            assert_eq!(
                report.ending,
                Ending::Formed,
                "{seed}\n{}",
                report.transcript
            );
        })
        .unwrap();
    }
}

#[test]
fn faults_on_exits_lead_to_no_contact() {
    for text in [HEXAGON, GAP, TURNED] {
        run_seeds(&parameters(text, FaultKind::Mixed), 0..SEEDS, |report| {
            let mut kinds = report.violations.iter().map(|one| one.kind);
            assert!(
                kinds.all(|kind| kind != ViolationKind::BodiesOverlap),
                "{}: {:?}",
                report.seed,
                report.violations
            );
        })
        .unwrap();
    }
}
