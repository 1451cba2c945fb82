//! `formation plan`.

use std::path::Path;

use formation_offline::{CheckedPlan, WithoutSpread};
use ros_runtime::exit::{Failure, one_line};

use crate::plan_output::PlanOutput;
use crate::report::ReportDirectory;
use crate::{check, console, scenario_file};

/// Plans a scenario file and prints the plan.
///
/// # Errors
/// Names what is wrong with the file or with the plan, or why the report cannot be written. A plan with a hole is printed all
/// the same.
pub fn run(path: &Path, report: Option<&Path>, json: bool) -> Result<(), Failure> {
    let scenario = scenario_file::load(path)?;
    check::warn(path, &scenario);
    let report = report.map(ReportDirectory::create).transpose()?;
    let plan = CheckedPlan::of(&scenario)?;
    plan.warn(path);
    let without_spread = WithoutSpread::of(&plan.problem);
    if let Some(directory) = report {
        write_report(&directory, &plan, scenario.name(), without_spread)?;
    }
    if json {
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
