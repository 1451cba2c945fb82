//! `formation report`: the page or the film of a recorded run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow};
use formation_model::{ModuleId, PlanningProblem, SpotId};
use formation_motion::PlannedMotion;
use formation_msgs::Verdict;
use formation_planner::plan;
use formation_report::{Colours, Fact, PANELS_MAX, Subject, Summary, Tone, animation, figure};
use formation_verifier_lines::{NOT_COLLISION_FREE, outcome_text};
use formation_verify::Outcome;
use recorder::replay::{Replay, replay};
use ros_runtime::exit::{Failure, one_line};

use crate::arguments::ReportArguments;
use crate::console;
use crate::report::ReportDirectory;
use crate::run::Recording;
use crate::scenario_file;

/// Draws a recording, and prints what it holds.
///
/// # Errors
/// The file is no recording of a formation, or is damaged, or a file cannot be written. What is drawn of a damaged recording
/// shows what comes before the damage.
pub fn run(arguments: &ReportArguments) -> Result<(), Failure> {
    let path = arguments.recording.as_path();
    let wrong = |what: &dyn std::fmt::Display| {
        Failure::bad_input(format_args!("{}: {what}", path.display()))
    };
    let replay = replay(path).map_err(|error| wrong(&error))?;
    let Some(problem) = &replay.problem else {
        let damage = replay.file.damage.as_ref();
        let damage = damage.map(|damage| format!("; it is damaged: {damage}"));
        return Err(wrong(&format_args!(
            "has no roster with a target, so there is nothing to draw{}",
            damage.unwrap_or_default()
        )));
    };
    let mut recording = Recording::default();
    for entry in &replay.entries {
        recording.keep(entry.clone());
    }
    let judged = replay.verdict.as_ref().map(settled);
    let name = without_compression(path);
    let name = name.file_stem().unwrap_or_default().to_string_lossy();
    let mut outcome = plan(Arc::clone(problem));
    let (motion, planned) = PlannedMotion::of(problem, outcome.plan.clone());
    outcome.follow(problem, planned);
    let (name, course) = (one_line(&name), recording.entries());
    let subject =
        Subject::of_course(&name, problem, &outcome, course, judged.as_ref()).with_paths(&motion);
    let summary = summary(&replay, problem, &recording);
    let mut written = Vec::new();
    if let Some(file) = &arguments.film {
        let colours = if arguments.dark {
            Colours::Dark
        } else {
            Colours::Light
        };
        let film = animation(&subject, course, &summary.outcome, colours);
        written.push(write_picture("film", file, &film)?);
    }
    if let Some(file) = &arguments.figure {
        if arguments.at.len() > PANELS_MAX {
            return Err(Failure::bad_input(format_args!(
                "--at: has {} shares; a figure has at most {PANELS_MAX}",
                arguments.at.len()
            )));
        }
        let row = figure(&subject, course, &arguments.at);
        written.push(write_picture("figure", file, &row)?);
    }
    let has_other = arguments.film.is_some() || arguments.figure.is_some();
    if !has_other || arguments.report.is_some() {
        let directory = arguments.report.clone();
        let directory = directory.unwrap_or_else(|| default_directory(path));
        let report = ReportDirectory::create(&directory)?;
        report.write_pictures(&subject, course, &summary)?;
        let page = directory.join("report.html");
        written.push(format!("report: {}", page.display()));
    }
    console::result_line(&text(&replay, &summary, written))?;
    match &replay.file.damage {
        None => Ok(()),
        Some(damage) => Err(Failure::Failed(anyhow!(
            "{}: is damaged after {} samples: {damage}; the report shows what comes before",
            path.display(),
            replay.file.samples
        ))),
    }
}

/// Writes the picture of an option, and says so.
fn write_picture(option: &str, file: &Path, picture: &str) -> Result<String, Failure> {
    if scenario_file::is_standard_input(file) {
        return Err(Failure::bad_input(format_args!(
            "--{option} -: name a file"
        )));
    }
    fs::write(file, picture)
        .with_context(|| format!("{}: cannot be written", file.display()))
        .map_err(Failure::Failed)?;
    Ok(format!("{option}: {}", file.display()))
}

/// The file's name without its end; where it has none, and for a bag, something that does not exist yet.
fn default_directory(path: &Path) -> PathBuf {
    let path = without_compression(path);
    match path.extension() {
        Some(_) if !path.is_dir() => path.with_extension(""),
        _ => {
            // `..` has no name of its own.
            let path = match path.file_name() {
                Some(_) => path,
                None => path.canonicalize().unwrap_or(path),
            };
            let mut name = path.file_name().unwrap_or_default().to_owned();
            name.push(".report");
            path.with_file_name(name)
        }
    }
}

/// The name of a file before zstd compressed it.
fn without_compression(path: &Path) -> PathBuf {
    match path.extension() {
        Some(end) if end == "zstd" => path.with_extension(""),
        _ => path.to_owned(),
    }
}

/// Which module settled on which spot.
fn settled(verdict: &Verdict) -> BTreeMap<ModuleId, SpotId> {
    let pairs = verdict.assignments.iter();
    pairs
        .map(|pair| (ModuleId(pair.module_id), SpotId(pair.spot_id)))
        .collect()
}

fn summary(replay: &Replay, problem: &PlanningProblem, recording: &Recording) -> Summary {
    let verdict = replay.verdict.as_ref();
    let (outcome, tone) = match verdict.and_then(judgement) {
        Some((Outcome::Failed, text)) => (text, Tone::Bad),
        Some((_, text)) => (text, Tone::Good),
        None => ("No verdict was recorded".to_owned(), Tone::Neutral),
    };
    let mut notes: Vec<String> = Vec::new();
    if let Some(verdict) = verdict {
        notes.extend(verdict.violations.iter().map(|text| one_line(text)));
        notes.extend((!verdict.collision_reason.is_empty()).then(|| {
            format!(
                "{NOT_COLLISION_FREE}: {}",
                one_line(&verdict.collision_reason)
            )
        }));
    }
    notes.extend(losses(replay));
    notes.extend(recording.note());
    let mut facts = vec![
        Fact::new("modules", problem.modules().len()),
        Fact::new("spots", problem.target().spots().len()),
        Fact::new(
            "length of the recording",
            format!("{:.1} s", replay.duration.as_secs_f64()),
        ),
        Fact::new("recorded samples", replay.file.samples),
    ];
    if let Some(session) = replay.session {
        facts.push(Fact::new("session", session.0));
    }
    Summary {
        outcome,
        tone,
        source: "Made of a recording of the topics. The film stretches turns, which take milliseconds, and cuts waits; the \
                 clock next to it counts seconds since the first recorded sample."
            .to_owned(),
        facts,
        notes,
    }
}

/// What is missing from the recording.
fn losses(replay: &Replay) -> Vec<String> {
    let file = &replay.file;
    let damage = file.damage.as_ref();
    let damage = damage.map(|damage| {
        format!(
            "The recording is damaged: {damage}. What comes after {} samples is missing.",
            file.samples
        )
    });
    let lost = file.lost.filter(|&lost| lost > 0);
    let lost = lost.map(|lost| format!("The recorder lost {lost} samples."));
    let refused = (replay.refused > 0)
        .then(|| format!("{} samples do not decode or are not valid.", replay.refused));
    [damage, lost, refused].into_iter().flatten().collect()
}

/// The outcome of a recorded verdict and its text; `None` if it is none that this build knows.
fn judgement(verdict: &Verdict) -> Option<(Outcome, String)> {
    let outcome = verdict.judgement().ok()?;
    let count = |number: u32| usize::try_from(number).unwrap_or(usize::MAX);
    let text = outcome_text(
        outcome,
        count(verdict.filled_spots),
        count(verdict.spots),
        verdict.blocked_spots.len(),
    );
    Some((outcome, text))
}

fn text(replay: &Replay, summary: &Summary, written: Vec<String>) -> String {
    let rows = replay.samples.iter();
    let rows = rows.map(|(topic, count)| format!("{count:>8}  {topic}"));
    let mut lines = vec![format!("{:>8}  topic", "samples")];
    lines.extend(rows);
    lines.extend(summary.notes.iter().cloned());
    lines.push(format!(
        "{}, in {:.1} s",
        summary.outcome,
        replay.duration.as_secs_f64()
    ));
    lines.extend(written);
    lines.join("\n")
}
