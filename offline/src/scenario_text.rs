//! Scenarios as text, and drawn from the options of `formation generate`.

use std::fmt::Write;

use formation_generate::{Apart, GenerateError, GeneratorParameters, generate, set_apart};
use formation_model::text::joined;
use formation_model::{MICRO_PER_UNIT, MicroUnits, RawModule, RawScenario};
use serde_json::Value;

/// The width of the field in which modules start, 1.5 to 100 times the square root of their number, in hundredths.
///
/// # Errors
/// The width is out of this range.
pub fn field_percent(width: f64) -> Result<u32, String> {
    let width = MicroUnits::from_units(width);
    let percent = width.map(|width| width.0 / (MICRO_PER_UNIT / 100));
    let percent = percent.ok().and_then(|percent| u32::try_from(percent).ok());
    percent
        .filter(|percent| (150..=10_000).contains(percent))
        .ok_or_else(|| "must be 1.5 to 100".to_owned())
}

/// Draws a scenario. With a width, in hundredths of the square root of the number of modules, the modules start apart in a square
/// field about the target; without one they start as in the paper, and may touch.
///
/// # Errors
/// Names the parameter that is out of its range.
pub fn generated(
    parameters: &GeneratorParameters,
    apart_percent: Option<u32>,
) -> Result<RawScenario, GenerateError> {
    let mut scenario = generate(parameters)?;
    if let Some(percent) = apart_percent {
        set_apart(&mut scenario, Apart::Circles, percent, parameters.seed);
    }
    Ok(scenario)
}

/// The sections that [`to_yaml`] writes.
const LISTS: [&str; 4] = ["name", "target", "configurations", "singletons"];

/// A scenario with the sections of a file: who takes which spot, and whether there are parts, is in the section `target`.
///
/// # Errors
/// A number is none that JSON has.
pub fn as_in_a_file(scenario: &RawScenario) -> serde_json::Result<Value> {
    let mut whole = serde_json::to_value(scenario)?;
    if let Some(fields) = whole.as_object_mut() {
        let given = fields.remove("given");
        let given = given.and_then(|given| given.as_object().cloned());
        let in_parts = fields
            .remove("in_parts")
            .map(|flag| ("in_parts".to_owned(), flag));
        if let Some(target) = fields.get_mut("target").and_then(Value::as_object_mut) {
            target.extend(given.unwrap_or_default());
            target.extend(in_parts);
        }
    }
    Ok(whole)
}

/// The text of a scenario file with all its sections. JSON is YAML, so sections other than target and modules are written as JSON.
///
/// # Errors
/// A number is none that JSON has.
pub fn whole_yaml(scenario: &RawScenario) -> serde_json::Result<String> {
    let mut text = to_yaml(scenario);
    let whole = as_in_a_file(scenario)?;
    for (section, value) in whole.as_object().into_iter().flatten() {
        if !LISTS.contains(&section.as_str()) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{section}: {value}");
        }
    }
    Ok(text)
}

/// Writes a scenario as people write it, a spot or a module a line.
///
/// The planner section is left out: generated scenarios have its defaults.
pub fn to_yaml(scenario: &RawScenario) -> String {
    let mut text = format!(
        "name: {}\ntarget:\n  frame_id: {}\n  spots:\n",
        quoted(&scenario.name),
        quoted(&scenario.target.frame_id)
    );
    // Writing to a string cannot fail.
    for spot in &scenario.target.spots {
        let _ = writeln!(
            text,
            "    - {}",
            placed(spot.id, spot.x, spot.y, spot.theta)
        );
    }
    let _ = writeln!(text, "  edges: {}", pairs(&scenario.target.edges));
    if let Some(given) = &scenario.given {
        text.push_str(&given.to_yaml());
    }
    if scenario.in_parts {
        text.push_str("  in_parts: true\n");
    }
    if !scenario.configurations.is_empty() {
        text.push_str("configurations:\n");
    }
    for configuration in &scenario.configurations {
        let _ = writeln!(text, "  - id: {}", configuration.id);
        if let Some(leader) = configuration.leader {
            let _ = writeln!(text, "    leader: {leader}");
        }
        text.push_str("    modules:\n");
        for member in &configuration.modules {
            let _ = writeln!(text, "      - {}", module(member));
        }
        let _ = writeln!(text, "    edges: {}", pairs(&configuration.edges));
    }
    if !scenario.singletons.is_empty() {
        text.push_str("singletons:\n");
    }
    for singleton in &scenario.singletons {
        let _ = writeln!(text, "  - {}", module(singleton));
    }
    text
}

fn module(module: &RawModule) -> String {
    placed(module.id, module.x, module.y, module.theta)
}

fn placed(id: u32, x: f64, y: f64, theta: f64) -> String {
    format!("{{id: {id}, x: {x:?}, y: {y:?}, theta: {theta:?}}}")
}

fn pairs(edges: &[[u32; 2]]) -> String {
    let pairs = edges.iter().map(|[one, other]| format!("[{one}, {other}]"));
    format!("[{}]", joined(pairs, ", "))
}

/// A plain word as it is; anything else as JSON writes it, which YAML understands.
fn quoted(text: &str) -> String {
    let plain = text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text
            .chars()
            .all(|character| character.is_ascii_alphanumeric() || character == '_');
    // `true`, `null`, `yes` and their like are short; whatever is as short is quoted.
    if plain && text.len() > "false".len() {
        text.to_owned()
    } else {
        Value::from(text).to_string()
    }
}

#[cfg(test)]
mod tests {
    use formation_generate::Grouping;
    use formation_model::PlannerParameters;

    use super::*;

    #[test]
    fn what_is_written_reads_back_as_it_was() {
        for (modules, spots, grouping) in [
            (12, 9, Grouping::Singletons),
            (30, 40, Grouping::Mixed),
            (23, 7, Grouping::Configurations(5)),
        ] {
            let parameters = GeneratorParameters::new(modules, spots, 7).grouped(grouping);
            let scenario = generate(&parameters).unwrap();
            assert_eq!(scenario.planner, PlannerParameters::default());
            let read: RawScenario = serde_yaml::from_str(&to_yaml(&scenario)).unwrap();
            assert_eq!(read, scenario);
        }
    }

    #[test]
    fn names_are_quoted_where_yaml_would_take_them_for_something_else() {
        assert_eq!(quoted("lattice_frame"), "lattice_frame");
        for text in [
            "null",
            "true",
            "a: b",
            "# c",
            "say \"x\"",
            "12",
            "",
            "two\nlines",
        ] {
            let written = quoted(text);
            assert_eq!(serde_yaml::from_str::<String>(&written).unwrap(), text);
        }
    }
}
