//! `formation plan`.

use formation_report::{Summary, Tone};
use ros_runtime::exit::Failure;

use crate::arguments::{PlanArguments, SPEED_UNITS_PER_S};
use crate::checked_plan::{CheckedPlan, PlanReport};
use crate::motion::{self, MotionSummary};
use crate::policies::problem_under;
use crate::report::ReportDirectory;
use crate::spread::WithoutSpread;
use crate::{check, console, policy_program, scenario_file};

/// Plans a scenario file and prints the plan.
///
/// # Errors
/// Names what is wrong with the file or with the plan, or why the report cannot be written. A plan with a hole is printed all
/// the same.
pub fn run(arguments: &PlanArguments) -> Result<(), Failure> {
    let path = arguments.scenario.as_path();
    let scenario = scenario_file::load(path)?;
    check::warn(path, &scenario);
    let report = arguments.report.as_deref();
    let report = report.map(ReportDirectory::create).transpose()?;
    let problem = match &arguments.policy_program {
        Some(program) => {
            policy_program::ask(program, scenario.problem(), arguments.program_timeout).map_err(
                |error| Failure::failed(format_args!("--policy-program: {program} {error}")),
            )?
        }
        None => problem_under(&scenario, arguments.policy).map_err(|reason| {
            Failure::bad_input(format_args!("{}: {reason}", scenario_file::named(path)))
        })?,
    };
    let plan = CheckedPlan::shown(problem)?;
    plan.warn(path);
    let without_spread = WithoutSpread::of(&plan.problem);
    if let Some(directory) = report {
        write_report(&directory, &plan, scenario.name(), without_spread)?;
    }
    if arguments.json {
        console::result_json(&whole_report(&plan, without_spread))?;
    } else {
        console::result_text(&plan.text(scenario.name(), without_spread.as_ref()))?;
    }
    plan.refuse_hole(path)
}

/// The object that `--json` prints.
fn whole_report(plan: &CheckedPlan, without_spread: Option<WithoutSpread>) -> PlanReport {
    PlanReport {
        without_spread,
        complete: Some(plan.is_complete()),
        turns: Some(plan.turns()),
        motion: Some(MotionSummary::of(&plan.motion)),
        ..plan.report()
    }
}

fn write_report(
    directory: &ReportDirectory,
    plan: &CheckedPlan,
    name: &str,
    without_spread: Option<WithoutSpread>,
) -> Result<(), Failure> {
    let course = plan.course();
    let subject = plan.subject(name, &course);
    let mut notes = plan.statistics.warnings.clone();
    notes.extend(motion::warning(&plan.motion));
    let summary = Summary {
        outcome: format!(
            "Planned: {} of {} spots get a module{}",
            plan.statistics.assignments.len(),
            plan.problem.target().spots().len(),
            motion::mark(&plan.motion)
        ),
        tone: Tone::Neutral,
        source: format!(
            "Planned offline and not carried out: the film shows the turns of the plan, then its motions, at \
             {SPEED_UNITS_PER_S} units a second. The clock next to the film counts the motions alone."
        ),
        facts: plan.facts(),
        notes,
    };
    directory.write_json(&whole_report(plan, without_spread))?;
    directory.write_pictures(&subject, &course, &summary)
}
