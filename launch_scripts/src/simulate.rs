//! `formation simulate`: many agents in one process, under virtual time and a seeded network.

use std::collections::BTreeMap;
use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use formation_sim::{
    CampaignError, CampaignParameters, Ending, RunReport, Transcript, run_seed, run_seeds,
};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::arguments::SimulateArguments;
use crate::check::counted;
use crate::failure::Failure;
use crate::{console, scenario_file};

/// So many lines of a failing run are shown.
const TAIL_LINES: usize = 40;
/// So many failing seeds are told one by one.
const TOLD_MAX: usize = 10;

/// Runs the seeds, prints what came of them, and fails if anything was violated.
///
/// # Errors
/// Names what is wrong with the input, or how many runs violated something.
pub fn run(arguments: &SimulateArguments) -> Result<(), Failure> {
    let parameters = campaign_parameters(arguments)?;
    let seeds = arguments.first_seed..arguments.first_seed.saturating_add(arguments.seeds);
    let start = Instant::now();
    let mut summary = Summary::new(arguments);
    let bar = progress_bar(arguments.seeds);
    run_seeds(&parameters, seeds, |report| {
        bar.inc(1);
        summary.add(report);
        bar.set_message(summary.progress());
    })
    .map_err(bad_input)?;
    bar.finish_and_clear();
    summary.finish(start.elapsed());
    if arguments.json {
        console::result_json(&summary.figures)?;
    } else {
        if let Some(transcript) = &summary.transcript {
            console::result_line(transcript.to_string().trim_end())?;
        }
        console::result_line(&summary.figures.text())?;
    }
    summary.tell_failing(arguments, &parameters)
}

fn campaign_parameters(arguments: &SimulateArguments) -> Result<CampaignParameters, Failure> {
    let problem = match &arguments.scenario {
        Some(path) => {
            let scenario = scenario_file::load(path)?;
            Some(Arc::new(scenario.problem().clone()))
        }
        None => None,
    };
    Ok(CampaignParameters {
        faults: arguments.faults,
        modules_min: arguments.modules.min,
        modules_max: arguments.modules.max,
        problem,
        transcripts: arguments.seeds == 1,
        ..CampaignParameters::default()
    })
}

fn bad_input(error: CampaignError) -> Failure {
    Failure::BadInput(anyhow!(error).context("no scenario could be drawn"))
}

fn progress_bar(seeds: u64) -> ProgressBar {
    if seeds == 1 || !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(seeds), ProgressDrawTarget::stderr());
    // A template that does not parse would only change the looks.
    if let Ok(style) =
        ProgressStyle::with_template("{bar:24} {pos}/{len} runs, {msg} ({elapsed}, {eta} to go)")
    {
        bar.set_style(style);
    }
    bar
}

/// What `formation simulate --json` prints.
#[derive(Debug, Serialize)]
struct Figures {
    runs: u64,
    first_seed: u64,
    faults: String,
    /// The least and the most modules that a run had.
    modules: Option<[usize; 2]>,
    formed: u64,
    waiting_for_quorum: u64,
    /// How many breaches there were of each kind; empty when all is well.
    violations: BTreeMap<String, u64>,
    failing_seeds: Vec<u64>,
    recovery_ms: Spread,
    messages: u64,
    epochs: u64,
    elapsed_ms: u64,
    /// The account of the run, line by line, when there was one seed only.
    #[serde(skip_serializing_if = "Option::is_none")]
    transcript: Option<Vec<String>>,
}

/// The median and the worst of some durations; `null` without any.
#[derive(Debug, Default, Serialize)]
struct Spread {
    median: Option<u64>,
    worst: Option<u64>,
}

impl Spread {
    fn of(durations: &mut [Duration]) -> Self {
        durations.sort_unstable();
        let millis = |duration: &Duration| u64::try_from(duration.as_millis()).unwrap_or(u64::MAX);
        Self {
            median: durations.get(durations.len() / 2).map(millis),
            worst: durations.last().map(millis),
        }
    }

    fn text(&self) -> String {
        let seconds = |millis: Option<u64>| {
            millis.map_or_else(
                || "none".to_owned(),
                |millis| format!("{:.1} s", Duration::from_millis(millis).as_secs_f64()),
            )
        };
        format!(
            "median {}, worst {}",
            seconds(self.median),
            seconds(self.worst)
        )
    }
}

impl Figures {
    fn text(&self) -> String {
        let mut lines = Vec::new();
        let modules = match self.modules {
            Some([least, most]) if least == most => format!("{least} modules"),
            Some([least, most]) => format!("{least} to {most} modules"),
            None => "no modules".to_owned(),
        };
        lines.push(format!(
            "{} of {modules} with faults: {}; {} formed, {} waiting for a quorum",
            counted_u64(self.runs, "run"),
            self.faults,
            self.formed,
            self.waiting_for_quorum
        ));
        if self.violations.is_empty() {
            lines.push("violations: none".to_owned());
        } else {
            let kinds: Vec<String> = self
                .violations
                .iter()
                .map(|(kind, count)| format!("{kind} {count}"))
                .collect();
            lines.push(format!("violations: {}", kinds.join(", ")));
        }
        let from = if self.faults == "none" {
            "from the start until formed"
        } else {
            "from the last fault until formed"
        };
        lines.push(format!("recovery {from}: {}", self.recovery_ms.text()));
        lines.push(format!(
            "{}, {} in {:.1} s",
            counted_u64(self.messages, "message"),
            counted_u64(self.epochs, "epoch"),
            Duration::from_millis(self.elapsed_ms).as_secs_f64()
        ));
        lines.join("\n")
    }
}

fn counted_u64(count: u64, noun: &str) -> String {
    counted(usize::try_from(count).unwrap_or(usize::MAX), noun)
}

/// What has come of the runs so far.
struct Summary {
    figures: Figures,
    recoveries: Vec<Duration>,
    failing: BTreeMap<u64, RunReport>,
    transcript: Option<Transcript>,
    keeps_transcript: bool,
}

impl Summary {
    fn new(arguments: &SimulateArguments) -> Self {
        Self {
            figures: Figures {
                runs: 0,
                first_seed: arguments.first_seed,
                faults: arguments.faults.to_string(),
                modules: None,
                formed: 0,
                waiting_for_quorum: 0,
                violations: BTreeMap::new(),
                failing_seeds: Vec::new(),
                recovery_ms: Spread::default(),
                messages: 0,
                epochs: 0,
                elapsed_ms: 0,
                transcript: None,
            },
            recoveries: Vec::new(),
            failing: BTreeMap::new(),
            transcript: None,
            keeps_transcript: arguments.seeds == 1,
        }
    }

    fn add(&mut self, report: RunReport) {
        let figures = &mut self.figures;
        figures.runs += 1;
        figures.messages += report.messages;
        figures.epochs += report.epochs;
        let [least, most] = figures.modules.unwrap_or([report.modules, report.modules]);
        figures.modules = Some([least.min(report.modules), most.max(report.modules)]);
        match report.ending {
            Ending::Formed => {
                figures.formed += 1;
                self.recoveries.push(report.recovery);
            }
            Ending::WaitingForQuorum => figures.waiting_for_quorum += 1,
            Ending::Neither => {}
        }
        for violation in &report.violations {
            *figures
                .violations
                .entry(violation.kind.to_string())
                .or_default() += 1;
        }
        if self.keeps_transcript {
            self.transcript = Some(report.transcript.clone());
        }
        if !report.violations.is_empty() {
            self.failing.insert(report.seed, report);
        }
    }

    fn progress(&self) -> String {
        match self.failing.len() {
            0 => "no violation".to_owned(),
            failing => format!("{failing} violated"),
        }
    }

    fn finish(&mut self, elapsed: Duration) {
        self.figures.failing_seeds = self.failing.keys().copied().collect();
        self.figures.recovery_ms = Spread::of(&mut self.recoveries);
        self.figures.elapsed_ms = u64::try_from(elapsed.as_millis()).unwrap_or(u64::MAX);
        self.figures.transcript = self
            .transcript
            .as_ref()
            .map(|transcript| transcript.lines().iter().map(ToString::to_string).collect());
    }

    /// Says which seeds failed, how, and how to see it again.
    fn tell_failing(
        &self,
        arguments: &SimulateArguments,
        parameters: &CampaignParameters,
    ) -> Result<(), Failure> {
        for (seed, report) in self.failing.iter().take(TOLD_MAX) {
            console::note(&format!(
                "seed {seed} ({} modules, {} spots, {} running at the end):",
                report.modules, report.spots, report.running
            ));
            for violation in report.violations.iter().take(TOLD_MAX) {
                console::note(&format!(
                    "  {:.3} s {}: {}",
                    violation.at.as_secs_f64(),
                    violation.kind,
                    violation.detail
                ));
            }
            console::note(&format!("  replay: {}", replay(arguments, *seed)));
        }
        let Some(&first) = self.failing.keys().next() else {
            return Ok(());
        };
        let told = CampaignParameters {
            transcripts: true,
            ..parameters.clone()
        };
        let report = run_seed(&told, first).map_err(bad_input)?;
        let lines = report.transcript.lines();
        console::note(&format!("the end of seed {first}:"));
        for line in &lines[lines.len().saturating_sub(TAIL_LINES)..] {
            console::note(&line.to_string());
        }
        Err(Failure::Failed(anyhow!(
            "{} of {} violated what must always hold",
            self.failing.len(),
            counted_u64(self.figures.runs, "run")
        )))
    }
}

/// The command that runs one seed again.
fn replay(arguments: &SimulateArguments, seed: u64) -> String {
    let what = match &arguments.scenario {
        Some(path) => quoted(path),
        None => format!(
            "--modules {}-{}",
            arguments.modules.min, arguments.modules.max
        ),
    };
    format!(
        "formation simulate {what} --faults {} --first-seed {seed} --seeds 1",
        arguments.faults
    )
}

/// The path as a shell takes it for one word.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use formation_sim::{Violation, ViolationKind};

    use super::*;
    use crate::arguments::{Arguments, Command};
    use clap::Parser;

    fn arguments(line: &str) -> SimulateArguments {
        match Arguments::try_parse_from(line.split_whitespace())
            .unwrap()
            .command
        {
            Command::Simulate(arguments) => arguments,
            other => panic!("not simulate: {other:?}"),
        }
    }

    fn report(seed: u64, recovery_s: u64, violations: Vec<Violation>) -> RunReport {
        RunReport {
            seed,
            modules: 5,
            spots: 5,
            running: 4,
            ending: Ending::Formed,
            recovery: Duration::from_secs(recovery_s),
            messages: 10,
            epochs: 2,
            violations,
            transcript: Transcript::default(),
        }
    }

    #[test]
    fn a_violated_seed_is_counted_by_kind_and_fails_the_command() {
        let arguments = arguments("formation simulate --seeds 3 --modules 5-6 --faults none");
        let parameters = campaign_parameters(&arguments).unwrap();
        let mut summary = Summary::new(&arguments);
        let violation = Violation {
            at: Duration::from_secs(1),
            kind: ViolationKind::Hole,
            detail: "4 of 5 spots are filled".to_owned(),
        };
        summary.add(report(0, 7, Vec::new()));
        summary.add(report(2, 9, vec![violation]));
        summary.add(report(1, 3, Vec::new()));
        summary.finish(Duration::ZERO);
        let figures = &summary.figures;
        assert_eq!(figures.failing_seeds, [2]);
        assert_eq!(figures.violations, BTreeMap::from([("hole".to_owned(), 1)]));
        assert_eq!(figures.recovery_ms.median, Some(7_000));
        assert_eq!(figures.recovery_ms.worst, Some(9_000));
        let failure = summary.tell_failing(&arguments, &parameters).unwrap_err();
        assert_eq!(
            failure.to_string(),
            "1 of 3 runs violated what must always hold"
        );
        assert_eq!(
            replay(&arguments, 2),
            "formation simulate --modules 5-6 --faults none --first-seed 2 --seeds 1"
        );
    }
}
