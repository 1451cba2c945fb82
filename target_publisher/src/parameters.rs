//! The parameters of the target publisher.

use std::time::Duration;

use formation_model::MODULES_MAX;
use ros_runtime::parameters::{Tunable, Tunables, seconds, text, whole_number};

/// The parameters of the target publisher.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PublisherParameters {
    /// How many modules take part, where a goal does not say.
    pub expected_modules: Option<u32>,
    /// The folder of the scenarios that goals can name.
    pub scenario_folder: Option<String>,
    /// How long a goal waits for a verdict.
    pub verdict_limit: Duration,
    /// How long a cancelled goal waits until the modules stand still.
    pub standstill_limit: Duration,
}

impl Default for PublisherParameters {
    fn default() -> Self {
        Self {
            expected_modules: None,
            scenario_folder: None,
            verdict_limit: Duration::from_secs(600),
            standstill_limit: Duration::from_secs(10),
        }
    }
}

impl Tunables for PublisherParameters {
    const HEADING: &'static str = "Goals";

    fn table() -> Vec<Tunable<Self>> {
        let modules_max = u32::try_from(MODULES_MAX).unwrap_or(u32::MAX);
        vec![
            Tunable::new(
                "expected_modules",
                whole_number(modules_max),
                |own: &mut Self| &mut own.expected_modules,
                "How many modules take part; 0 if that is not known, and gathering ends when no further module comes",
            )
            .at_start("it belongs to the target that was announced with it"),
            Tunable::new(
                "scenario_folder",
                text("FOLDER"),
                |own: &mut Self| &mut own.scenario_folder,
                "Folder of the scenarios that goals of form_configuration can name; none if empty",
            )
            .at_start("it determines which files can be read from outside"),
            Tunable::new(
                "verdict_limit_s",
                seconds(),
                |own: &mut Self| &mut own.verdict_limit,
                "A goal of form_configuration ends without a verdict after this",
            ),
            Tunable::new(
                "standstill_limit_s",
                seconds(),
                |own: &mut Self| &mut own.standstill_limit,
                "A cancelled goal waits this long until the modules stand still",
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    use formation_tests::parameter_section;
    use ros_runtime::arguments::RosArguments;
    use ros_runtime::settings::Settings;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let words = ["", "--ros-args", "--params-file", ""].map(OsString::from);
        let sections = parameter_section(&["The target publisher"]);
        let (_, ros) = RosArguments::extract(words, |_| Ok(sections.clone())).unwrap();
        let node = Settings::default().identity("target_publisher");
        let shipped = ros.parameters.of_node(&node).into_iter();
        let shipped = shipped.map(|(name, assignment)| (name, assignment.value.clone()));
        let declared = PublisherParameters::default().declarations().into_iter();
        let declared = declared.map(|declaration| (declaration.name, declaration.value));
        assert_eq!(shipped.collect::<BTreeMap<_, _>>(), declared.collect());
    }
}
