//! Runs whose modules start apart and so move along paths: all at the same time, and without contact.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use formation::generate::Apart;
use formation_sim::{CampaignParameters, FaultKind};

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
        run_all(&parameters(FaultKind::None, apart), 0..60);
    }
}

#[test]
fn faults_lead_to_no_contact() {
    for faults in [FaultKind::Mixed, FaultKind::Hostile, FaultKind::Partition] {
        run_all(&parameters(faults, Apart::Circles), 0..seeds());
    }
}
