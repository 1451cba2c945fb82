//! `formation show` and `formation schema`.

use std::path::Path;

use formation_model::text::joined;
use formation_model::{Area, BODY_WIDTH, PlannerParameters, RawArea, Scenario};
use formation_offline::CheckedPlan;
use formation_report::before;
use ros_runtime::exit::{Failure, one_line};

use crate::plan_output::PlanOutput;
use crate::{console, scenario_file};

/// The JSON schema of scenario files.
const SCHEMA: &str = include_str!("../../launch_scripts/scenario.schema.json");

/// Prints a scenario as maps, or as a picture of its start.
///
/// # Errors
/// Names the file, and what is wrong in it or cannot be drawn as a map.
pub fn show(path: &Path, svg: bool) -> Result<(), Failure> {
    let scenario = scenario_file::load(path)?;
    let name = one_line(scenario.name());
    if svg {
        let plan = CheckedPlan::of(&scenario)?;
        let subject = plan.subject(&name, &plan.course());
        return console::result_line(&before(&subject));
    }
    let maps = scenario.to_maps().map_err(|error| {
        Failure::bad_input(format_args!(
            "{}: {error}; --svg draws it all the same",
            scenario_file::named(path)
        ))
    })?;
    let surroundings = surroundings(&scenario);
    // A JSON string is a YAML string, whatever it contains.
    let name = serde_json::Value::from(name);
    let maps = maps.trim_end();
    console::result_line(&format!("name: {name}\n{surroundings}{maps}"))?;
    let left_out = left_out(&scenario);
    if !left_out.is_empty() {
        console::note(&format!(
            "note: left out, as a map does not show it: {}",
            joined(left_out, ", ")
        ));
    }
    Ok(())
}

/// What the file says besides, by the names of its fields.
fn left_out(scenario: &Scenario) -> Vec<&'static str> {
    let problem = scenario.problem();
    let names_leaders = problem.modules().iter().any(|one| one.leader.is_some());
    let fields = [
        (
            "planner",
            *problem.parameters() != PlannerParameters::default(),
        ),
        ("frame_id", problem.target().frame_id() != "map"),
        ("leader", names_leaders),
    ];
    let present = fields.into_iter().filter(|&(_, is_present)| is_present);
    present.map(|(field, _)| field).collect()
}

/// Sizes that are not the default ones, obstacles and walls, as a scenario file has them.
fn surroundings(scenario: &Scenario) -> String {
    let mut lines = String::new();
    if let Some(size) = scenario.module_size() {
        lines.push_str(&format!("module_size: {}\n", size.metres()));
    }
    if scenario.problem().target().surroundings().body().is_round() {
        lines.push_str("body: circle\n");
    }
    let width = scenario.problem().target().surroundings().body_width();
    if width != BODY_WIDTH {
        lines.push_str(&format!("body_width: {}\n", width.to_units()));
    }
    let surroundings = scenario.problem().target().surroundings();
    let written = |area: &Area| {
        let RawArea {
            x,
            y,
            width,
            height,
        } = area.to_raw();
        format!("{{x: {x}, y: {y}, width: {width}, height: {height}}}")
    };
    if !surroundings.obstacles().is_empty() {
        lines.push_str("obstacles:\n");
    }
    for obstacle in surroundings.obstacles() {
        lines.push_str(&format!("  - {}\n", written(obstacle)));
    }
    if let Some(arena) = surroundings.arena() {
        lines.push_str(&format!("arena: {}\n", written(&arena)));
    }
    lines
}

/// Prints the JSON schema of scenario files.
///
/// # Errors
/// The output cannot be written.
pub fn schema() -> Result<(), Failure> {
    console::result_line(SCHEMA.trim_end())
}
