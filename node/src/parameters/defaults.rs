//! The file of defaults that ships with the suite says what the programs declare.

use std::ffi::OsString;
use std::path::Path;

use clap::Parser;
use ros2_client::ParameterValue;

use super::{Declaration, NodeWide, Parameters, node_wide};
use crate::agents;
use crate::announcer::announcer_declarations;
use crate::arguments::{
    JudgingArguments, MotionArguments, RosArguments, TimingArguments, judging_declarations,
};
use crate::environment::Namespace;
use crate::visualisation::{VisualisationParameters, visualisation_declarations};

const FILE: &str = "../launch_scripts/config/formation.yaml";

/// The arguments that parameters have their defaults from.
#[derive(Parser)]
struct Command {
    #[command(flatten)]
    timing: TimingArguments,
    #[command(flatten)]
    motion: MotionArguments,
}

#[derive(Parser)]
struct Verifier {
    #[command(flatten)]
    judging: JudgingArguments,
}

/// What all programs declare when they are started without any argument.
fn declarations() -> Vec<Declaration> {
    let command = Command::parse_from(["program"]);
    let judging = Verifier::parse_from(["program"])
        .judging
        .parameters()
        .unwrap();
    let mut declarations = node_wide(NodeWide::default());
    declarations.extend(agents::declarations(
        &command.timing.parameters().unwrap(),
        &command.motion.parameters(),
    ));
    declarations.extend(announcer_declarations());
    declarations.extend(judging_declarations(&judging));
    declarations.extend(visualisation_declarations(
        &VisualisationParameters::default(),
    ));
    declarations
}

#[test]
fn the_file_of_defaults_names_every_parameter_with_its_default() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let text = std::fs::read_to_string(path).unwrap();
    let words = ["program", "--ros-args", "--params-file", FILE].map(OsString::from);
    let (_, ros) = RosArguments::extract(words, |_| Ok(text.clone())).unwrap();
    let node = ros.remaps.identity("module_4", &Namespace::default());
    let assigned = ros.parameters.of_node(&node);
    let assigned: Vec<(&str, &ParameterValue)> = assigned
        .iter()
        .map(|(name, assignment)| (*name, &assignment.value))
        .collect();
    let (declared, _) = Parameters::declare(declarations(), &Default::default()).unwrap();
    let declared: Vec<(&str, &ParameterValue)> = declared.values().iter().collect();
    assert_eq!(assigned, declared);
}

#[test]
fn every_parameter_is_described_and_within_its_range() {
    for declaration in declarations() {
        let name = declaration.name;
        assert!(declaration.description.len() > 10, "{name}");
        assert_eq!(
            declaration.accept(declaration.value.clone()),
            Ok(declaration.value.clone())
        );
        assert!(
            declaration.accept(ParameterValue::NotSet).is_err(),
            "{name}"
        );
    }
}
