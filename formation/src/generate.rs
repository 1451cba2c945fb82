//! `formation generate`.

use std::fmt::Write;

use anyhow::anyhow;
use formation_generate::{
    Apart, GenerateError, GeneratorParameters, Grouping, generate, set_apart,
};
use formation_model::text::joined;
use formation_model::{RawModule, RawScenario};
use ros_runtime::exit::Failure;

use crate::arguments::GenerateArguments;
use crate::console;

/// Generates a scenario and prints it as a scenario file.
///
/// # Errors
/// Names the option that is out of its range.
pub fn run(arguments: &GenerateArguments) -> Result<(), Failure> {
    let grouping = match (arguments.configurations, arguments.configuration_size) {
        (Some(equal), _) => equal,
        (None, Some(size)) => Grouping::Configurations(size),
        (None, None) if arguments.mixed => Grouping::Mixed,
        (None, None) => Grouping::Singletons,
    };
    let parameters = GeneratorParameters {
        degree_max: arguments.degree,
        ..GeneratorParameters::new(arguments.modules, arguments.spots, arguments.seed)
    }
    .grouped(grouping);
    let mut scenario = generate(&parameters).map_err(|error| {
        Failure::BadInput(match error {
            GenerateError::OutOfRange { .. } => anyhow!("--{error}"),
            GenerateError::NoTreeFound { .. } => anyhow!(error),
        })
    })?;
    if !arguments.touching {
        set_apart(
            &mut scenario,
            Apart::Circles,
            arguments.apart,
            arguments.seed,
        );
    }
    console::result_line(to_yaml(&scenario).trim_end())
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
        serde_json::Value::from(text).to_string()
    }
}

#[cfg(test)]
mod tests {
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
