//! `formation simulate`: many agents in one process, under virtual time and a seeded network.

use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use formation_offline::{Campaign, CheckedPlan, campaign_parameters, counted_u64};
use formation_sim::{CampaignError, CampaignParameters, run_seed, run_seeds};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ros_runtime::exit::Failure;

use crate::arguments::SimulateArguments;
use crate::plan_output::PlanOutput;
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
    let parameters = parameters(arguments, plan.as_ref());
    let first = arguments.first_seed;
    let end = first.checked_add(arguments.seeds).ok_or_else(|| {
        let count = counted_u64(arguments.seeds, "seed");
        Failure::bad_input(format_args!(
            "--first-seed {first}: {count} from there on exceed the highest seed"
        ))
    })?;
    let start = Instant::now();
    let mut campaign = Campaign::new(first, arguments.seeds, arguments.faults, plan.as_ref());
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
    conclusion(&campaign, arguments, &parameters)?;
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
    let plan = CheckedPlan::of(&scenario_file::load_formable(path)?)?;
    plan.refuse_without_motion(path)?;
    Ok(Some(plan))
}

fn parameters(arguments: &SimulateArguments, plan: Option<&CheckedPlan>) -> CampaignParameters {
    let keeps_transcripts = arguments.seeds == 1;
    campaign_parameters(arguments.faults, arguments.modules, plan, keeps_transcripts)
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

/// Reports which seeds failed, how, and by which command each runs again.
fn conclusion(
    campaign: &Campaign,
    arguments: &SimulateArguments,
    parameters: &CampaignParameters,
) -> Result<(), Failure> {
    for (seed, report) in campaign.failing.iter().take(SHOWN_MAX) {
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
    let Some(&first) = campaign.failing.keys().next() else {
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
        campaign.failing.len(),
        counted_u64(campaign.figures.sums.runs, "run")
    )))
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
    use formation_sim::{BrokenInvariant, Ending, SeedReport, Transcript, ViolationKind};

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
            published: Vec::new(),
        }
    }

    #[test]
    fn a_violated_seed_is_counted_by_kind_and_fails_the_command() {
        let arguments = arguments("formation simulate --seeds 3 --modules 5-6 --faults none");
        let parameters = parameters(&arguments, None);
        let mut campaign = Campaign::new(0, 3, arguments.faults, None);
        let violation = BrokenInvariant {
            at: Duration::from_secs(1),
            kind: ViolationKind::Hole,
            detail: "4 of 5 spots are filled".to_owned(),
        };
        campaign.add(report(0, 7, Vec::new()));
        campaign.add(report(2, 9, vec![violation]));
        campaign.add(report(1, 3, Vec::new()));
        campaign.finish(Duration::ZERO);
        let failure = conclusion(&campaign, &arguments, &parameters).unwrap_err();
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
