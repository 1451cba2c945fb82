//! Reports of runs, in text and as objects.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

use formation_event_log::{Entry, LogEvent};
use formation_model::Scenario;
use formation_verifier_lines::{AgreementReport, VerdictReport};
use serde_json::{Value, json};

use super::super::recording::Recording;
use super::super::roles::Death;
use super::*;
use crate::plan_output::PlanOutput;

const EPOCH: Epoch = Epoch {
    number: 1,
    convener: ModuleId(7),
};
const TIMEOUT: Duration = Duration::from_secs(60);

fn plan() -> CheckedPlan {
    let scenario = Scenario::from_yaml(
        "
target: {spots: [{id: 1, x: 0.0, y: 0.0}, {id: 2, x: 1.0, y: 0.0}], edges: [[1, 2]]}
singletons: [{id: 7, x: 0.0, y: 1.0}, {id: 8, x: 1.0, y: 1.0}]
",
    )
    .unwrap();
    CheckedPlan::of(&scenario).unwrap()
}

fn assignments(pairs: &[(u32, u32)]) -> Vec<Assignment> {
    let pairs = pairs.iter().map(|&(module, spot)| Assignment {
        module: ModuleId(module),
        spot: SpotId(spot),
    });
    pairs.collect()
}

fn verdict(outcome: Outcome, spots: [u32; 2]) -> VerdictReport {
    let violations = match outcome {
        Outcome::Failed => vec!["module 7 moved too early".to_owned()],
        _ => Vec::new(),
    };
    VerdictReport {
        outcome,
        epoch: Some(EPOCH),
        filled_spots: 2,
        assignments: assignments(&[(7, spots[0]), (8, spots[1])]),
        unassigned: Vec::new(),
        open_spots: Vec::new(),
        blocked_spots: Vec::new(),
        violations,
        missing: Vec::new(),
        timings_ms: Default::default(),
        planning_ms: Some(12),
        acting_ms: Some(345),
        counts: Default::default(),
        collision_free: true,
        collision_reason: None,
        not_judged: Vec::new(),
    }
}

/// An epoch whose roster lists the scenario's modules as they started, but for those out of service.
fn roster(plan: &CheckedPlan, modules: &[u32], out_of_service: &[u32]) -> Recording {
    let ids = |ids: &[u32]| ids.iter().copied().map(ModuleId).collect::<Vec<_>>();
    let is_whole = modules.len() == 2 && out_of_service.is_empty();
    let mut recording = Recording::default();
    recording.keep(Entry {
        at_ms: 1,
        event: LogEvent::Roster {
            epoch: EPOCH,
            modules: ids(modules),
            out_of_service: ids(out_of_service),
            problem: is_whole.then(|| plan.problem.digest()),
        },
    });
    recording
}

fn report(outcome: Outcome, spots: [u32; 2]) -> RunReport {
    let observed = Observed {
        discovery: Some(Duration::from_millis(1_500)),
        ..Observed::default()
    };
    report_on(verdict(outcome, spots), observed, &[7, 8], &[])
}

/// The report on a run whose last roster listed these modules.
fn report_on(
    verdict: VerdictReport,
    observed: Observed,
    modules: &[u32],
    out_of_service: &[u32],
) -> RunReport {
    let plan = plan();
    let observed = Observed {
        recording: roster(&plan, modules, out_of_service),
        ..observed
    };
    let judgement = Judgement::Verdict(verdict);
    RunReport::new(&plan, judgement, &observed, TIMEOUT)
}

/// A verdict on a formation in which only module 8 has settled, on spot 2.
fn half(outcome: Outcome) -> VerdictReport {
    VerdictReport {
        filled_spots: 1,
        assignments: assignments(&[(8, 2)]),
        open_spots: vec![SpotId(1)],
        violations: Vec::new(),
        ..verdict(outcome, [1, 2])
    }
}

/// The report on a run during which this module died.
fn report_without(module: u32, verdict: VerdictReport) -> RunReport {
    let mut observed = Observed::default();
    observed.deaths.push(Death {
        name: format!("module_agent of module {module}"),
        modules: vec![ModuleId(module)],
        status: ExitStatus::from_raw(9),
        after: Duration::from_millis(5_230),
    });
    report_on(verdict, observed, &[7, 8], &[])
}

fn json_of(report: &RunReport) -> Value {
    serde_json::to_value(report).unwrap()
}

#[test]
fn other_modules_may_take_the_places_of_the_dead() {
    let report = report_without(9, verdict(Outcome::Complete, [2, 1]));
    assert!(report.conclusion().is_ok());
    assert_eq!(
        report.text(&plan(), "two"),
        "module  spot\n     7     2\n     8     1\nplanned in 12 ms, acted in 345 ms\n\
             dead: module_agent of module 9 ended with signal: 9 (SIGKILL) after 5.2 s\n\
             COMPLETE: all 2 spots are filled, hole-free"
    );
    assert_eq!(
        json_of(&report)["dead"],
        json!([{
            "process": "module_agent of module 9",
            "modules": [9],
            "ended_with": "signal: 9 (SIGKILL)",
            "after_ms": 5_230,
        }])
    );
}

#[test]
fn a_spot_that_a_dead_module_held_is_open() {
    let mut judged = verdict(Outcome::Failed, [1, 2]);
    judged.violations.clear();
    let report = report_without(8, judged);
    let json = json_of(&report);
    assert_eq!(json["assignments"], json!([{"module": 7, "spot": 1}]));
    assert_eq!(json["open_spots"], json!([2]));
    assert_eq!(
        report.conclusion().unwrap_err().to_string(),
        "the formation failed: spot 2 is open, as module 8 died there"
    );
    assert!(
        report
            .text(&plan(), "two")
            .ends_with("FAILED: 1 of 2 spots are filled")
    );
}

#[test]
fn a_complete_formation_ends_with_hole_free() {
    let report = report(Outcome::Complete, [1, 2]);
    assert!(report.conclusion().is_ok());
    let text = report.text(&plan(), "two");
    assert!(
        text.ends_with("\nCOMPLETE: all 2 spots are filled, hole-free"),
        "{text}"
    );
    assert!(
        text.contains("joined in 1500 ms, planned in 12 ms, acted in 345 ms"),
        "{text}"
    );
}

#[test]
fn programs_read_the_plan_and_the_run_in_one_object() {
    let mut json = json_of(&report(Outcome::Complete, [1, 2]));
    let plan = serde_json::to_value(plan().report()).unwrap();
    assert!(json["planning_us"].is_u64());
    json["planning_us"] = plan["planning_us"].clone();
    let mut expected = plan.as_object().unwrap().clone();
    let run = json!({
        "verdict": "COMPLETE",
        "violations": [],
        "missing": [],
        "discovery_ms": 1_500,
        "planning_ms": 12,
        "acting_ms": 345,
        "dead": [],
        "replanned": false,
        "out_of_service": [],
        "left_out": [],
        "timed_out": false,
        "blocked_spots": [],
        "collision_free": true,
        "collision_reason": null,
    });
    expected.extend(run.as_object().unwrap().clone());
    assert_eq!(json, Value::Object(expected));
}

#[test]
fn another_allocation_than_planned_is_found_wrong() {
    let report = report(Outcome::Complete, [2, 1]);
    let failure = report.conclusion().unwrap_err();
    assert_eq!(
        failure.to_string(),
        "the processes formed another allocation than the offline plan: module 7 took spot 2 instead of spot 1; \
             module 8 took spot 1 instead of spot 2"
    );
    assert_eq!(json_of(&report)["assignments"][0]["spot"], 2);
}

#[test]
fn another_plan_for_another_roster_is_no_fault() {
    // Module 7 was out of reach for a while: it has moved since the start.
    let observed = Observed {
        recording: {
            let mut recording = roster(&plan(), &[7, 8], &[]);
            let mut later = recording.entries()[0].clone();
            if let LogEvent::Roster { problem, .. } = &mut later.event {
                *problem = None;
            }
            recording.keep(later);
            recording
        },
        ..Observed::default()
    };
    let judgement = Judgement::Verdict(verdict(Outcome::Complete, [2, 1]));
    let report = RunReport::new(&plan(), judgement, &observed, TIMEOUT);
    assert!(report.conclusion().is_ok());
    assert_eq!(json_of(&report)["replanned"], true);
    assert_eq!(report.faults(), Vec::<String>::new());
    let text = report.text(&plan(), "two");
    assert!(text.starts_with("module  spot\n     7     2\n"), "{text}");
}

#[test]
fn a_module_that_left_service_is_named_and_no_other_plan() {
    let partial = report_on(half(Outcome::Partial), Observed::default(), &[7, 8], &[7]);
    assert_eq!(
        partial.conclusion().unwrap_err().to_string(),
        "not all spots are filled: spot 1 open; module 7 left service, and no spare was left"
    );
    assert_eq!(
        partial.outcome_text(),
        "PARTIAL: 1 of 2 spots are filled; module 7 left service"
    );
    assert_eq!(json_of(&partial)["out_of_service"], json!([7]));
    let complete = report_on(
        verdict(Outcome::Complete, [2, 1]),
        Observed::default(),
        &[7, 8, 9],
        &[9],
    );
    assert!(complete.conclusion().is_ok());
}

#[test]
fn a_time_that_was_up_is_named_with_what_was_missing() {
    let mut late = half(Outcome::Failed);
    late.missing = vec!["spot 1 is open".to_owned()];
    let report = report_on(late, Observed::default(), &[7, 8], &[]);
    assert_eq!(
        report.conclusion().unwrap_err().to_string(),
        "the formation failed: the time was up after 60 s (--timeout); spot 1 is open"
    );
    let text = report.text(&plan(), "two");
    assert!(
        text.contains("\nthe time was up after 60 s (--timeout)\nmissing: spot 1 is open\n"),
        "{text}"
    );
    assert_eq!(json_of(&report)["timed_out"], true);
    let observed = Observed {
        timed_out: true,
        ..Observed::default()
    };
    let report = report_on(half(Outcome::Partial), observed, &[8], &[]);
    assert_eq!(
        report.conclusion().unwrap_err().to_string(),
        "not all spots are filled: spot 1 open; module 7 did not join, and no spare was left; the time was up after \
             60 s (--timeout); on a busy machine, host several modules in each process with --modules-per-process"
    );
    assert_eq!(
        report.outcome_text(),
        "PARTIAL: 1 of 2 spots are filled; module 7 did not join"
    );
}

#[test]
fn modules_that_were_left_out_are_named() {
    let agreement = AgreementReport {
        epoch: EPOCH,
        assignments: assignments(&[(8, 1)]),
        planning_ms: 12,
        violations: Vec::new(),
    };
    let judgement = Judgement::Agreement(agreement);
    let observed = Observed {
        recording: roster(&plan(), &[8], &[]),
        ..Observed::default()
    };
    let report = RunReport::new(&plan(), judgement, &observed, TIMEOUT);
    let failure = report.conclusion().unwrap_err().to_string();
    assert!(
        failure.starts_with(
            "the plan has a hole; module 7 did not join, and no spare was left; on a busy machine"
        ),
        "{failure}"
    );
    let json = json_of(&report);
    assert_eq!(json["verdict"], "AGREED");
    assert_eq!(json["left_out"], json!([7]));
    assert_eq!(json["missing"], Value::Null);
    assert_eq!(json["acting_ms"], Value::Null);
}

#[test]
fn a_failed_formation_says_why() {
    let report = report(Outcome::Failed, [1, 2]);
    assert_eq!(
        report.conclusion().unwrap_err().to_string(),
        "the formation failed: module 7 moved too early"
    );
    let text = report.text(&plan(), "two");
    assert!(
        text.contains("violation: module 7 moved too early"),
        "{text}"
    );
}

/// A spare that stands idle is not missing: the spot has no room for it.
#[test]
fn a_blocked_spot_is_named_with_what_can_be_done() {
    let mut partial = half(Outcome::Partial);
    let (spot, module) = (SpotId(1), ModuleId(7));
    partial.blocked_spots = vec![BlockedSpot { spot, module }];
    partial.unassigned = vec![ModuleId(9)];
    let report = report_without(7, partial);
    assert_eq!(
        report.conclusion().unwrap_err().to_string(),
        "not all spots are filled: spot 1 open; module 7 died, spot 1 is blocked by the body of module 7; once a body is \
             taken away, report that with `formation remove`"
    );
    let blocked = "spot 1 is blocked by the body of module 7".to_owned();
    assert!(report.faults().contains(&blocked));
    let facts = format!("{:?}", report.facts(&plan()));
    assert!(
        facts.contains("\"spots left open\", value: \"1\""),
        "{facts}"
    );
    assert!(!facts.contains("turns"), "{facts}");
}
