//! How a formation is judged.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use formation_model::MicroUnits;
use formation_node_support::micro_units;
use formation_node_support::scenario::read_own_scenario;
use formation_verify::ObserverParameters;
use ros_runtime::exit::Failure;
use ros_runtime::parameters::{Tunable, Tunables, Tuned, milliseconds, seconds};
use ros_runtime::settings::Settings;

/// How a formation is judged.
#[derive(Clone, Debug)]
pub struct Judging(pub ObserverParameters);

impl Default for Judging {
    fn default() -> Self {
        Self(ObserverParameters {
            time_limit: Duration::from_secs(60),
            ..ObserverParameters::default()
        })
    }
}

impl Tunables for Judging {
    const HEADING: &'static str = "Judging";

    fn table() -> Vec<Tunable<Self>> {
        let fixed = |row: Tunable<Self>| {
            row.at_start("a formation is judged by what held when observation began")
        };
        let tolerance = |name, unit, field: fn(&mut Self) -> &mut MicroUnits, help| {
            fixed(Tunable::new(
                name,
                micro_units(unit, 0.0, 1.0e3),
                field,
                help,
            ))
        };
        let time = |name, field: fn(&mut Self) -> &mut Duration, help| {
            fixed(Tunable::new(name, seconds(), field, help))
        };
        vec![
            time(
                "time_limit_s",
                |own| &mut own.0.time_limit,
                "A formation that is not done within this after its target was announced has failed",
            )
            .alias("timeout-s"),
            tolerance(
                "tolerance",
                "UNITS",
                |own| &mut own.0.position_tolerance,
                "How far a settled module may stand from its spot, in units; docked modules may be off each other by twice as much",
            ),
            tolerance(
                "heading_tolerance",
                "RADIANS",
                |own| &mut own.0.heading_tolerance,
                "By how much its heading may differ, in radians",
            ),
            time(
                "grace_s",
                |own| &mut own.0.grace,
                "Time in which an end state that is reached but not yet right may become right",
            ),
            fixed(Tunable::new(
                "clock_error_ms",
                milliseconds(60_000.0),
                |own: &mut Self| &mut own.0.clock_error,
                "The greatest difference between the clocks of two processes of modules, in milliseconds",
            )),
            time(
                "silence_s",
                |own| &mut own.0.silence,
                "A member that is silent for longer does not count as live; the suspicion of the agents",
            )
            .option_only(),
        ]
    }
}

/// How a formation is judged, and which modules take part in it.
#[derive(Clone, Debug, Args)]
pub struct JudgingArguments {
    /// Scenario file whose modules are to take part, so that absent ones can be named
    #[arg(long, value_name = "FILE", help_heading = "Judging")]
    pub scenario: Option<PathBuf>,
    #[command(flatten)]
    judging: Tuned<Judging>,
}

impl JudgingArguments {
    /// How a formation is judged; the scenario also gives the size of modules.
    ///
    /// # Errors
    /// Names the file that is wrong.
    pub fn resolve(self, settings: &mut Settings) -> Result<Judging, Failure> {
        let Judging(mut parameters) = self.judging.0;
        if let Some(path) = &self.scenario {
            let scenario = read_own_scenario(path, settings)?;
            let modules = scenario.problem().modules().iter();
            parameters.expected = modules.map(|module| module.id).collect();
        }
        Ok(Judging(parameters))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    use formation_tests::parameter_section;
    use ros_runtime::arguments::RosArguments;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let words = ["", "--ros-args", "--params-file", ""].map(OsString::from);
        let sections = parameter_section(&["The verifier"]);
        let (_, ros) = RosArguments::extract(words, |_| Ok(sections.clone())).unwrap();
        let node = Settings::default().identity("verifier");
        let shipped = ros.parameters.of_node(&node).into_iter();
        let shipped = shipped.map(|(name, assignment)| (name, assignment.value.clone()));
        let declared = Judging::default().declarations().into_iter();
        let declared = declared.map(|declaration| (declaration.name, declaration.value));
        assert_eq!(shipped.collect::<BTreeMap<_, _>>(), declared.collect());
    }
}
