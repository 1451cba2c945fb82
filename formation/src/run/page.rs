//! What `--report` shows of a run.

use std::collections::BTreeMap;

use formation_event_log::Entry;
use formation_model::{ModuleId, SpotId};
use formation_offline::CheckedPlan;
use formation_report::{Fact, Subject, Summary, Tone};
use ros_runtime::exit::{Failure, one_line};

use super::recording::Recording;
use super::report::{RunOutcome, RunReport};
use crate::arguments::RunArguments;

/// What the pictures of a run show: which module ended where, by the verdict where there is one.
pub fn subject(
    plan: &CheckedPlan,
    name: &str,
    course: &[Entry],
    report: Option<&RunReport>,
) -> Subject {
    if report.is_some_and(|report| report.outcome() == RunOutcome::Agreed) {
        return plan.subject(&one_line(name), &plan.course());
    }
    let judged: Option<BTreeMap<ModuleId, SpotId>> = report.map(|report| {
        let assignments = report.assignments().iter();
        assignments.map(|one| (one.module, one.spot)).collect()
    });
    let (problem, outcome) = (&plan.problem, &plan.outcome);
    let dead = report.map(RunReport::dead_modules).unwrap_or_default();
    Subject::of_course(&one_line(name), problem, outcome, course, judged.as_ref())
        .with_paths(&plan.motion)
        .with_dead(&dead)
}

/// What the page of a run says next to the film.
pub fn summary(
    plan: &CheckedPlan,
    arguments: &RunArguments,
    recording: &Recording,
    result: Result<&RunReport, &Failure>,
) -> Summary {
    let report = result.ok();
    let mut facts = report.map_or_else(|| plan.planning_facts(), |report| report.facts(plan));
    facts.push(Fact::new(
        "speed of simulated modules",
        format!("{} units a second", arguments.motion.speed),
    ));
    let mut notes = plan.statistics.warnings.clone();
    notes.extend(report.into_iter().flat_map(RunReport::faults));
    notes.extend(recording.note());
    Summary {
        outcome: match result {
            Ok(report) => report.outcome_text(),
            Err(failure) => format!("Broken off: {failure}"),
        },
        tone: match report {
            Some(report) if report.conclusion().is_err() => Tone::Bad,
            Some(report) if report.outcome() == RunOutcome::Agreed => Tone::Neutral,
            Some(_) => Tone::Good,
            None => Tone::Bad,
        },
        source: "Recorded from the topics of the running processes. The film stretches turns, which take \
                 milliseconds, and cuts waits; the clock next to it counts seconds since the verifier's start."
            .to_owned(),
        facts,
        notes,
    }
}
