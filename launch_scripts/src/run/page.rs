//! What `--report` shows of a run.

use std::collections::BTreeMap;

use formation::event_log::{Entry, Scene};
use formation::model::{ModuleId, ModulePhase, SpotId};
use formation_report::{Ending, Fact, Subject, Summary, Tone};
use ros_runtime::exit::{Failure, one_line};

use super::recording::Recording;
use super::report::{RunOutcome, RunReport};
use crate::arguments::RunArguments;
use crate::checked_plan::CheckedPlan;

/// What the pictures of a run show: which module ended where, by the verdict where there is one.
pub fn subject(
    plan: &CheckedPlan,
    name: &str,
    course: &[Entry],
    report: Option<&RunReport>,
) -> Subject {
    let name = one_line(name);
    if report.is_some_and(|report| report.outcome() == RunOutcome::Agreed) {
        return Subject::planned(&name, &plan.problem, &plan.outcome);
    }
    let judged: Option<BTreeMap<ModuleId, SpotId>> = report.map(|report| {
        let assignments = report.assignments().iter();
        assignments.map(|one| (one.module, one.spot)).collect()
    });
    let endings = endings(course, judged.as_ref());
    Subject::seen(&name, &plan.problem, &plan.outcome, &endings)
}

/// The last state of each module in the course of a formation, with the spot that the verdict gives it, if there is one.
pub fn endings(
    course: &[Entry],
    judged: Option<&BTreeMap<ModuleId, SpotId>>,
) -> BTreeMap<ModuleId, Ending> {
    let mut scene = Scene::default();
    for entry in course {
        scene.apply(entry);
    }
    let endings = scene.modules().iter().map(|(&module, known)| {
        let last = &known.snapshot;
        let ending = Ending {
            pose: last.pose,
            spot: match judged {
                Some(judged) => judged.get(&module).copied(),
                None => last.spot.filter(|_| last.phase == ModulePhase::Settled),
            },
            links: last.links.clone(),
        };
        (module, ending)
    });
    endings.collect()
}

/// What the page of a run says next to the film.
pub fn summary(
    plan: &CheckedPlan,
    arguments: &RunArguments,
    recording: &Recording,
    result: Result<&RunReport, &Failure>,
) -> Summary {
    let report = result.ok();
    let mut facts = report.map(RunReport::facts).unwrap_or_default();
    facts.extend(plan.facts());
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
