//! `formation plan`.

use formation_offline::{CgshopSolution, CheckedPlan, WithoutSpread};
use ros_runtime::exit::{Failure, one_line};

use crate::arguments::PlanArguments;
use crate::plan_output::PlanOutput;
use crate::policies::problem_under;
use crate::report::ReportDirectory;
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
    if arguments.cgshop {
        let solution = CgshopSolution::of(scenario.name(), &plan);
        let solution = solution.map_err(|error| {
            Failure::bad_input(format_args!("{}: {error}", scenario_file::named(path)))
        })?;
        console::result_json(&solution)?;
    } else if arguments.json {
        console::result_json(&plan.whole_report(without_spread))?;
    } else {
        console::result_text(&plan.text(&one_line(scenario.name()), without_spread.as_ref()))?;
    }
    plan.refuse_hole(path)
}

fn write_report(
    directory: &ReportDirectory,
    plan: &CheckedPlan,
    name: &str,
    without_spread: Option<WithoutSpread>,
) -> Result<(), Failure> {
    let course = plan.course();
    let subject = plan.subject(&one_line(name), &course);
    directory.write_json(&plan.whole_report(without_spread))?;
    directory.write_pictures(&subject, &course, &plan.summary())
}
