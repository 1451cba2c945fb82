//! `formation simulate`: many agents in one process, under virtual time and a seeded network.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use formation_event_log::milliseconds;
use formation_model::SpotId;
use formation_model::text::{counted, joined};
use formation_sim::{CampaignError, CampaignParameters, Ending, SeedReport, run_seed, run_seeds};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ros_runtime::exit::Failure;
use serde::Serialize;

use crate::arguments::SimulateArguments;
use crate::checked_plan::{CheckedPlan, PlanTurn};
use crate::{console, scenario_file};

/// How many lines of a failing run are shown.
const TAIL_LINES: usize = 40;
/// Between two drawings of the progress while no run ends.
const TICK_INTERVAL: Duration = Duration::from_millis(200);
/// How many failing seeds, and violations of one seed, are shown.
const SHOWN_MAX: usize = 10;

/// Runs the seeds, prints what they found, and fails if anything was violated.
///
/// # Errors
/// Names what is wrong with the input, or how many runs violated something.
pub fn run(arguments: &SimulateArguments) -> Result<(), Failure> {
    let plan = planned(arguments)?;
    let parameters = campaign_parameters(arguments, plan.as_ref());
    let first = arguments.first_seed;
    let end = first.checked_add(arguments.seeds).ok_or_else(|| {
        let count = counted_u64(arguments.seeds, "seed");
        Failure::bad_input(format_args!(
            "--first-seed {first}: {count} from there on exceed the highest seed"
        ))
    })?;
    let start = Instant::now();
    let mut campaign = Campaign::new(arguments);
    campaign.figures.plan = plan.as_ref().map(PlanFigures::of);
    let bar = progress_bar(arguments.seeds);
    run_seeds(&parameters, first..end, |report| {
        bar.inc(1);
        campaign.add(report);
        bar.set_message(match campaign.failing.len() {
            0 => "no violation".to_owned(),
            failing => format!("{failing} violated"),
        });
    })
    .map_err(bad_input)?;
    bar.finish_and_clear();
    campaign.finish(start.elapsed());
    if arguments.json {
        console::result_json(&campaign.figures)?;
    } else {
        for line in campaign.figures.transcript.iter().flatten() {
            console::result_line(line)?;
        }
        console::result_text(&campaign.figures.text())?;
    }
    campaign.conclusion(arguments, &parameters)?;
    match plan.as_ref().zip(arguments.scenario.as_deref()) {
        Some((plan, path)) => plan.refuse_hole(path),
        None => Ok(()),
    }
}

/// The plan of the scenario, if one is given.
fn planned(arguments: &SimulateArguments) -> Result<Option<CheckedPlan>, Failure> {
    let Some(path) = &arguments.scenario else {
        return Ok(None);
    };
    let plan = CheckedPlan::of(&scenario_file::load(path)?)?;
    plan.refuse_without_motion(path)?;
    Ok(Some(plan))
}

fn campaign_parameters(
    arguments: &SimulateArguments,
    plan: Option<&CheckedPlan>,
) -> CampaignParameters {
    let problem = plan.map(|plan| Arc::clone(&plan.problem));
    CampaignParameters {
        faults: arguments.faults,
        modules_min: arguments.modules.0,
        modules_max: arguments.modules.1,
        problem,
        transcripts: arguments.seeds == 1,
        ..CampaignParameters::default()
    }
}

fn bad_input(error: CampaignError) -> Failure {
    Failure::BadInput(anyhow!(error).context("no scenario could be drawn"))
}

fn progress_bar(seeds: u64) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(seeds), ProgressDrawTarget::stderr());
    // A template that does not parse would only change the looks.
    if let Ok(style) = ProgressStyle::with_template(
        "{spinner} {bar:24} {pos}/{len} runs, {msg} ({elapsed}, {eta} to go)",
    ) {
        bar.set_style(style);
    }
    bar.set_message("no violation");
    // The clock goes on while a run takes long.
    bar.enable_steady_tick(TICK_INTERVAL);
    bar
}

/// What `formation simulate --json` prints.
#[derive(Debug, Default, Serialize)]
struct Figures {
    first_seed: u64,
    faults: String,
    /// The fewest and the most modules that a run had.
    modules: Option<[usize; 2]>,
    #[serde(flatten)]
    sums: Sums,
    /// How many violations there were of each kind.
    violations: BTreeMap<String, u64>,
    failing_seeds: Vec<u64>,
    recovery_ms: Spread,
    elapsed_ms: u64,
    /// The plan of the scenario, if one was given.
    #[serde(flatten)]
    plan: Option<PlanFigures>,
    /// The log of the run, line by line, when there was one seed only.
    #[serde(skip_serializing_if = "Option::is_none")]
    transcript: Option<Vec<String>>,
}

/// What is printed of the plan of a scenario.
#[derive(Debug, Serialize)]
struct PlanFigures {
    /// Whether it fills all spots that the modules suffice for.
    complete: bool,
    /// Whether each placement of a configuration is proven to be the best.
    proven: bool,
    open_spots: Vec<SpotId>,
    turns: Vec<PlanTurn>,
}

impl PlanFigures {
    fn of(plan: &CheckedPlan) -> Self {
        Self {
            complete: plan.is_complete(),
            proven: plan.statistics.proven,
            open_spots: plan.statistics.open_spots.clone(),
            turns: plan.turns(),
        }
    }
}

/// Sums over all runs.
#[derive(Debug, Default, Serialize)]
struct Sums {
    runs: u64,
    formed: u64,
    waiting_for_quorum: u64,
    messages: u64,
    epochs: u64,
}

/// Median and worst recovery time over the seeds; `null` if no seed has one.
#[derive(Debug, Default, Serialize)]
struct Spread {
    median: Option<u64>,
    worst: Option<u64>,
    /// The lowest seed that took the worst time.
    worst_seed: Option<u64>,
}

impl Spread {
    fn of(times: &mut [(Duration, u64)]) -> Self {
        times.sort_unstable_by_key(|&(time, seed)| (time, Reverse(seed)));
        let middle = times.get(times.len() / 2);
        let worst = times.last();
        Self {
            median: middle.map(|&(time, _)| milliseconds(time)),
            worst: worst.map(|&(time, _)| milliseconds(time)),
            worst_seed: worst.map(|&(_, seed)| seed),
        }
    }

    fn text(&self) -> String {
        let seconds = |millis: Option<u64>| {
            millis.map_or_else(
                || "none".to_owned(),
                |millis| format!("{:.1} s", Duration::from_millis(millis).as_secs_f64()),
            )
        };
        let seed = self.worst_seed;
        let seed = seed.map_or_else(String::new, |seed| format!(" (seed {seed})"));
        format!(
            "median {}, worst {}{seed}",
            seconds(self.median),
            seconds(self.worst)
        )
    }
}

impl Figures {
    fn text(&self) -> String {
        let Self { faults, sums, .. } = self;
        let modules = match self.modules {
            Some([least, most]) if least == most => format!("{least} modules"),
            Some([least, most]) => format!("{least} to {most} modules"),
            None => "no modules".to_owned(),
        };
        let kinds = self.violations.iter();
        let violations = match self.violations.is_empty() {
            true => "none".to_owned(),
            false => joined(kinds.map(|(kind, count)| format!("{kind} {count}")), ", "),
        };
        let from = if faults == "none" {
            "start"
        } else {
            "last fault"
        };
        format!(
            "{} of {modules} with faults: {faults}; {} formed, {} waiting for a quorum\n\
             violations: {violations}\n\
             recovery from the {from} until formed: {}\n\
             {}, {} in {:.1} s",
            counted_u64(sums.runs, "run"),
            sums.formed,
            sums.waiting_for_quorum,
            self.recovery_ms.text(),
            counted_u64(sums.messages, "message"),
            counted_u64(sums.epochs, "epoch"),
            Duration::from_millis(self.elapsed_ms).as_secs_f64()
        )
    }
}

fn counted_u64(count: u64, noun: &str) -> String {
    counted(usize::try_from(count).unwrap_or(usize::MAX), noun)
}

/// The runs so far.
struct Campaign {
    figures: Figures,
    /// The recovery of each run that formed, and its seed.
    recoveries: Vec<(Duration, u64)>,
    failing: BTreeMap<u64, SeedReport>,
    keeps_transcript: bool,
}

impl Campaign {
    fn new(arguments: &SimulateArguments) -> Self {
        Self {
            figures: Figures {
                first_seed: arguments.first_seed,
                faults: arguments.faults.to_string(),
                ..Figures::default()
            },
            recoveries: Vec::new(),
            failing: BTreeMap::new(),
            keeps_transcript: arguments.seeds == 1,
        }
    }

    fn add(&mut self, report: SeedReport) {
        let figures = &mut self.figures;
        let sums = &mut figures.sums;
        sums.runs += 1;
        sums.messages += report.messages;
        sums.epochs += report.epochs;
        match report.ending {
            Ending::Formed => {
                sums.formed += 1;
                self.recoveries.push((report.recovery, report.seed));
            }
            Ending::WaitingForQuorum => sums.waiting_for_quorum += 1,
            Ending::Neither => {}
        }
        let [least, most] = figures.modules.unwrap_or([report.modules; 2]);
        figures.modules = Some([least.min(report.modules), most.max(report.modules)]);
        for violation in &report.violations {
            let kind = figures.violations.entry(violation.kind.to_string());
            *kind.or_default() += 1;
        }
        if self.keeps_transcript {
            let lines = report.transcript.lines().iter();
            figures.transcript = Some(lines.map(ToString::to_string).collect());
        }
        if !report.violations.is_empty() {
            self.failing.insert(report.seed, report);
        }
    }

    fn finish(&mut self, elapsed: Duration) {
        self.figures.failing_seeds = self.failing.keys().copied().collect();
        self.figures.recovery_ms = Spread::of(&mut self.recoveries);
        self.figures.elapsed_ms = milliseconds(elapsed);
    }

    /// Reports which seeds failed, how, and by which command each runs again.
    fn conclusion(
        &self,
        arguments: &SimulateArguments,
        parameters: &CampaignParameters,
    ) -> Result<(), Failure> {
        for (seed, report) in self.failing.iter().take(SHOWN_MAX) {
            console::note(&format!(
                "seed {seed} ({} modules, {} spots, {} running at the end):",
                report.modules, report.spots, report.running
            ));
            for violation in report.violations.iter().take(SHOWN_MAX) {
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
        let with_transcript = CampaignParameters {
            transcripts: true,
            ..parameters.clone()
        };
        let report = run_seed(&with_transcript, first).map_err(bad_input)?;
        let lines = report.transcript.lines();
        console::note(&format!("the end of seed {first}:"));
        for line in &lines[lines.len().saturating_sub(TAIL_LINES)..] {
            console::note(&line.to_string());
        }
        Err(Failure::Failed(anyhow!(
            "{} of {} violated what must always hold",
            self.failing.len(),
            counted_u64(self.figures.sums.runs, "run")
        )))
    }
}

/// The command that runs one seed again.
fn replay(arguments: &SimulateArguments, seed: u64) -> String {
    let what = match &arguments.scenario {
        Some(path) => quoted(path),
        None => format!("--modules {}-{}", arguments.modules.0, arguments.modules.1),
    };
    format!(
        "formation simulate {what} --faults {} --first-seed {seed} --seeds 1",
        arguments.faults
    )
}

/// The path quoted for a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use formation_sim::{BrokenInvariant, Transcript, ViolationKind};

    use super::*;
    use crate::arguments::{Arguments, FormationCommand};
    use clap::Parser;

    fn arguments(line: &str) -> SimulateArguments {
        match Arguments::try_parse_from(line.split_whitespace())
            .unwrap()
            .command
        {
            FormationCommand::Simulate(arguments) => arguments,
            other => panic!("not simulate: {other:?}"),
        }
    }

    fn report(seed: u64, recovery_s: u64, violations: Vec<BrokenInvariant>) -> SeedReport {
        SeedReport {
            seed,
            modules: 5,
            spots: 5,
            running: 4,
            ending: Ending::Formed,
            recovery: Duration::from_secs(recovery_s),
            messages: 10,
            epochs: 2,
            violations,
            reported: Vec::new(),
            transcript: Transcript::default(),
        }
    }

    #[test]
    fn a_violated_seed_is_counted_by_kind_and_fails_the_command() {
        let arguments = arguments("formation simulate --seeds 3 --modules 5-6 --faults none");
        let parameters = campaign_parameters(&arguments, None);
        let mut campaign = Campaign::new(&arguments);
        let violation = BrokenInvariant {
            at: Duration::from_secs(1),
            kind: ViolationKind::Hole,
            detail: "4 of 5 spots are filled".to_owned(),
        };
        campaign.add(report(0, 7, Vec::new()));
        campaign.add(report(2, 9, vec![violation]));
        campaign.add(report(1, 3, Vec::new()));
        campaign.finish(Duration::ZERO);
        let figures = &campaign.figures;
        assert_eq!(figures.failing_seeds, [2]);
        assert_eq!(figures.violations, BTreeMap::from([("hole".to_owned(), 1)]));
        assert_eq!(figures.recovery_ms.median, Some(7_000));
        assert_eq!(figures.recovery_ms.worst, Some(9_000));
        assert_eq!(figures.recovery_ms.worst_seed, Some(2));
        let failure = campaign.conclusion(&arguments, &parameters).unwrap_err();
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
