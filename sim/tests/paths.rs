//! Runs whose modules start apart and so move along paths: all at the same time, and without contact.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use formation::generate::Apart;
use formation::protocol::{Agent, Mutation};
use formation_sim::{
    AgentFactory, CampaignParameters, FaultKind, RunReport, ViolationKind, run_seeds,
};

use crate::support::run_all;

/// The number of seeds of each kind.
fn seeds() -> u64 {
    std::env::var("FORMATION_SEEDS").map_or(60, |text| text.parse().unwrap())
}

fn parameters(faults: FaultKind, apart: Apart) -> CampaignParameters {
    CampaignParameters {
        faults,
        modules_max: 24,
        apart: Some((apart, 300)),
        ..CampaignParameters::default()
    }
}

#[test]
fn modules_form_without_contact() {
    for apart in [Apart::Cells, Apart::Circles] {
        run_all(&parameters(FaultKind::None, apart), 0..seeds());
    }
}

#[test]
fn faults_lead_to_no_contact() {
    for faults in [FaultKind::Mixed, FaultKind::Hostile] {
        run_all(&parameters(faults, Apart::Circles), 0..seeds());
    }
}

/// The bodies of modules that were cut off on their way are taken for somewhere on the straight line to their goal, which a
/// path need not follow; so another module can find one on its spot.
#[test]
fn cuts_lead_to_no_contact_among_members() {
    let mut bad: Vec<RunReport> = Vec::new();
    let parameters = parameters(FaultKind::Partition, Apart::Circles);
    run_seeds(&parameters, 0..seeds(), |mut report| {
        report
            .violations
            .retain(|one| one.kind != ViolationKind::TwoBodiesOnOneSpot);
        if !report.violations.is_empty() {
            bad.push(report);
        }
    })
    .unwrap();
    let bad: Vec<_> = bad.iter().map(|run| (run.seed, &run.violations)).collect();
    assert!(bad.is_empty(), "{bad:?}");
}

#[test]
fn modules_that_do_not_wait_for_each_other_meet() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::SkipWaits)
    });
    let parameters = CampaignParameters {
        agents,
        modules_min: 16,
        ..parameters(FaultKind::None, Apart::Circles)
    };
    let mut met = 0;
    run_seeds(&parameters, 0..20, |report| {
        let mut kinds = report.violations.iter().map(|one| one.kind);
        met += u32::from(kinds.any(|kind| kind == ViolationKind::BodiesOverlap));
    })
    .unwrap();
    assert!(met >= 15, "found in {met} of 20 runs");
}
