//! Runs in which equal units swap their spots after the claims.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::fmt::Write as _;
use std::sync::Arc;

use formation_model::PlanningProblem;
use formation_sim::{CampaignParameters, Ending, FaultKind, ViolationKind, run_seed};

use crate::support::{run_all, scenario};

/// A row at the begin of a lane one cell wide, with spots past its bend, which the claims reverse.
fn bent_lane(modules: u32) -> PlanningProblem {
    let mut text = String::from("target:\n  spots:\n");
    let side = 2 * modules;
    for id in 1..=modules {
        writeln!(
            text,
            "    - {{id: {id}, x: {side}, y: {}}}",
            modules - 1 + id
        )
        .unwrap();
    }
    let edges: Vec<String> = (1..modules)
        .map(|id| format!("[{id}, {}]", id + 1))
        .collect();
    writeln!(text, "  edges: [{}]\nsingletons:", edges.join(", ")).unwrap();
    for id in 1..=modules {
        writeln!(text, "  - {{id: {id}, x: {}, y: 0}}", id - 1).unwrap();
    }
    let (middle, last) = (f64::from(modules), f64::from(side - 1));
    writeln!(
        text,
        "obstacles: [{{x: {}, y: {middle}, width: {side}, height: {last}}}]\n\
         arena: {{x: {middle}, y: {}, width: {}, height: {side}}}",
        middle - 0.5,
        middle - 0.5,
        side + 1,
    )
    .unwrap();
    scenario(&text)
}

fn parameters(faults: FaultKind, modules: u32) -> CampaignParameters {
    CampaignParameters {
        faults,
        problem: Some(Arc::new(bent_lane(modules))),
        transcripts: true,
        ..CampaignParameters::default()
    }
}

/// The last claim has the swap, all members agree on it, and the verifier finds each module where it leads.
#[test]
fn a_row_passes_a_bent_lane_after_a_swap() {
    let parameters = parameters(FaultKind::None, 10);
    run_all(&parameters, 0..8);
    let report = run_seed(&parameters, 1).unwrap();
    let transcript = report.transcript.to_string();
    let claims = transcript.lines().filter(|line| line.contains("swaps"));
    assert!(claims.count() > 0, "{transcript}");
}

/// Whatever fails, nobody contradicts the swap. A body that is left behind closes the lane, so that spots stay open.
#[test]
fn faults_contradict_no_swap() {
    for faults in [FaultKind::Mixed, FaultKind::Stops, FaultKind::Partition] {
        for seed in 0..10 {
            let report = run_seed(&parameters(faults, 6), seed).unwrap();
            let mut kinds = report.violations.iter().map(|one| one.kind);
            let is_open = |kind| matches!(kind, ViolationKind::Hole | ViolationKind::NoEnd);
            assert!(kinds.all(is_open), "{seed}: {:?}", report.violations);
            let is_formed = report.ending == Ending::Formed;
            assert!(faults != FaultKind::Stops || is_formed, "{seed}");
        }
    }
}
