//! `formation check`.

use std::path::Path;

use formation_model::Scenario;
use formation_model::text::counted;
use formation_motion::check_differential_drives;
use formation_offline::{CheckReport, CheckedPlan, docked_count, oddities};
use formation_planner::PlanSize;
use ros_runtime::exit::{Failure, one_line};

use crate::arguments::{CheckArguments, DIFFERENTIAL};
use crate::plan_output::PlanOutput;
use crate::robot_budget::{Budget, Robot};
use crate::{console, scenario_file};

/// Validates a scenario file, plans it, and prints a summary of it.
///
/// # Errors
/// Names the file, the place and what is wrong there, or the spot that cannot be reached, or that the plan has a hole.
pub fn check(arguments: &CheckArguments) -> Result<(), Failure> {
    match (&arguments.scenario, arguments.robot) {
        (scenario, Some(robot)) => check_robot(scenario.as_deref(), robot, arguments),
        (Some(scenario), None) => check_scenario(scenario, &arguments.drive, arguments.json),
        (None, None) => Err(Failure::bad_input("a scenario or --robot is needed")),
    }
}

/// Prints what a robot needs, and checks that a scenario leaves it.
fn check_robot(
    path: Option<&Path>,
    robot: Robot,
    arguments: &CheckArguments,
) -> Result<(), Failure> {
    let lengths = [("--error", arguments.error), ("--stop", arguments.stop)];
    for (option, length) in lengths {
        if !(length.is_finite() && length >= 0.0) {
            return Err(Failure::bad_input(format_args!(
                "{option}: {length} is no length in metres"
            )));
        }
    }
    let budget = Budget::of(robot, arguments.error, arguments.stop);
    if !budget.module_size.is_finite() {
        return Err(Failure::bad_input(
            "--robot, --error, --stop: no lattice has room for so large a robot",
        ));
    }
    let scenario = path.map(scenario_file::load).transpose()?;
    match arguments.json {
        true => console::result_json(&budget)?,
        false => console::result_text(&budget.text())?,
    }
    let lacks = scenario.map(|scenario| budget.lacks(robot, &scenario));
    let lacks = lacks.unwrap_or_default().join("; ");
    match (path, lacks.is_empty()) {
        (Some(path), false) => {
            let name = scenario_file::named(path);
            Err(Failure::failed(format_args!("{name}: {lacks}")))
        }
        _ => Ok(()),
    }
}

fn check_scenario(path: &Path, drive: &str, json: bool) -> Result<(), Failure> {
    let scenario = scenario_file::load(path)?;
    refuse_long_plans(path, &scenario)?;
    warn(path, &scenario);
    let plan = CheckedPlan::of(&scenario)?;
    plan.refuse_without_motion(path)?;
    if drive == DIFFERENTIAL {
        refuse_turning(path, &scenario)?;
    }
    plan.warn_of_cut_search(path);
    if json {
        console::result_json(&CheckReport::of(&scenario, &plan))?;
    } else {
        let summary = summary(&scenario);
        console::result_text(&format!("{}: {summary}", scenario_file::named(path)))?;
    }
    plan.refuse_hole(path)
}

/// Refuses a scenario whose plan would take real processes too long.
///
/// # Errors
/// Names the field to which the most time is due, and the limit.
pub fn refuse_long_plans(path: &Path, scenario: &Scenario) -> Result<(), Failure> {
    let refused = PlanSize::of(scenario.problem()).check();
    refused.map_err(|reason| {
        Failure::bad_input(format_args!("{}: {reason}", scenario_file::named(path)))
    })
}

/// Refuses a scenario that robots with differential drives cannot carry out.
///
/// # Errors
/// Names what they cannot move.
pub fn refuse_turning(path: &Path, scenario: &Scenario) -> Result<(), Failure> {
    let refused = check_differential_drives(scenario.problem());
    refused.map_err(|reason| {
        Failure::bad_input(format_args!("{}: {reason}", scenario_file::named(path)))
    })
}

/// Prints a warning for all that is valid and yet looks like a mistake.
pub fn warn(path: &Path, scenario: &Scenario) {
    for warning in oddities(scenario.problem()) {
        console::note(&format!(
            "warning: {}: {warning}",
            scenario_file::named(path)
        ));
    }
}

fn summary(scenario: &Scenario) -> String {
    let problem = scenario.problem();
    let configurations = problem.configurations();
    let docked = docked_count(problem);
    let topology = problem.target().topology();
    let name = match scenario.name() {
        "" => String::new(),
        name => format!("{}; ", one_line(name)),
    };
    format!(
        "{name}{} ({}, {}); {} ({})",
        counted(problem.modules().len(), "module"),
        counted(configurations.len(), "configuration"),
        counted(problem.modules().len() - docked, "singleton"),
        counted(topology.node_count(), "spot"),
        if topology.is_tree() { "tree" } else { "cyclic" },
    )
}
