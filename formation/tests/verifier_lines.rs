//! Shell commands that print what a verifier prints.

use formation_model::{Assignment, FormationStage, ModuleId, SpotId};
use formation_verifier_lines::{ReportLine, TimingsReport, VerdictReport};
use formation_verify::{Counts, Outcome, Progress};

/// A command that prints a line of the verifier.
pub fn prints(line: &ReportLine) -> String {
    format!("echo '{}'\n", serde_json::to_string(line).unwrap())
}

pub fn gathering(joined: usize, waiting_for: &[u32]) -> String {
    prints(&ReportLine::Progress(Progress {
        stage: FormationStage::Gathering,
        epoch: None,
        joined,
        expected: None,
        planned: 0,
        agreed: 0,
        settled: 0,
        to_fill: 0,
        stopped: false,
        waiting_for: waiting_for.iter().copied().map(ModuleId).collect(),
    }))
}

pub fn judges(outcome: Outcome, assignments: &[(u32, u32)], open_spots: &[u32]) -> String {
    let assignments = assignments.iter().map(|&(module, spot)| Assignment {
        module: ModuleId(module),
        spot: SpotId(spot),
    });
    let assignments: Vec<Assignment> = assignments.collect();
    prints(&ReportLine::Verdict(VerdictReport {
        outcome,
        epoch: None,
        filled_spots: assignments.len(),
        assignments,
        unassigned: Vec::new(),
        open_spots: open_spots.iter().copied().map(SpotId).collect(),
        blocked_spots: Vec::new(),
        violations: Vec::new(),
        missing: vec!["spot 9 is empty".to_owned()],
        timings_ms: TimingsReport::default(),
        planning_ms: Some(1),
        acting_ms: Some(2),
        counts: Counts::default(),
        collision_free: true,
        collision_reason: None,
        not_judged: Vec::new(),
    }))
}

/// A verifier that judges once this many other processes were started.
pub fn verdict_after(processes: usize, outcome: Outcome, spots: [u32; 2]) -> String {
    format!(
        r#"
while [ "$(ls "$(dirname "$0")" | grep -c '^started-[mt].*[0-9]$')" -lt {processes} ]; do sleep 0.02; done
{}{}"#,
        gathering(2, &[]),
        judges(outcome, &[(7, spots[0]), (8, spots[1])], &[])
    )
}

pub fn verdict(outcome: Outcome, spots: [u32; 2]) -> String {
    verdict_after(3, outcome, spots)
}
