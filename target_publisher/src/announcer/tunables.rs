//! What can be tuned of the process that announces the target.

use std::path::PathBuf;
use std::time::Duration;

use formation::model::MODULES_MAX;
use ros2_client::ParameterValue;

use super::conduct::Limits;
use super::wishes::Wishes;
use ros_runtime::arguments::SECONDS;
use ros_runtime::parameters::{Change, Declaration, ParameterError, Range, Values};

const EXPECTED_MODULES: &str = "expected_modules";
const SCENARIO_FOLDER: &str = "scenario_folder";
const VERDICT_LIMIT: &str = "verdict_limit_s";
const STANDSTILL_LIMIT: &str = "standstill_limit_s";

const LIMITS: Limits = Limits {
    verdict: Duration::from_secs(600),
    standstill: Duration::from_secs(10),
};

/// Declares what can be tuned, with these values unless something is assigned.
pub(super) fn declarations(wishes: &Wishes) -> Vec<Declaration> {
    let folder = wishes.folder.as_ref();
    let folder = folder.map(|folder| folder.to_string_lossy().into_owned());
    let seconds = |name, description, limit: Duration| Declaration {
        name,
        description,
        value: ParameterValue::Double(limit.as_secs_f64()),
        range: SECONDS,
        change: Change::AtRunTime,
    };
    vec![
        Declaration {
            name: EXPECTED_MODULES,
            description: "How many modules take part; 0 if that is not known, and gathering ends when nothing new \
                          comes",
            value: ParameterValue::Integer(wishes.expected_modules.unwrap_or_default().into()),
            range: Range::Integer {
                from: 0,
                to: i64::try_from(MODULES_MAX).unwrap_or(i64::MAX),
            },
            change: Change::AtStart("it belongs to the target that was announced with it"),
        },
        Declaration {
            name: SCENARIO_FOLDER,
            description: "Where the scenarios are that goals of form_configuration can name; nowhere if empty",
            value: ParameterValue::String(folder.unwrap_or_default()),
            range: Range::Any,
            change: Change::AtStart("it says which files can be read from outside"),
        },
        seconds(
            VERDICT_LIMIT,
            "A goal of form_configuration ends without a verdict after so many seconds",
            LIMITS.verdict,
        ),
        seconds(
            STANDSTILL_LIMIT,
            "So many seconds a cancelled goal waits until the modules stand still",
            LIMITS.standstill,
        ),
    ]
}

/// Where goals find what they want, as ROS 2 has it now.
pub(super) fn wishes(values: &Values) -> Result<Wishes, ParameterError> {
    let folder = values.string(SCENARIO_FOLDER)?;
    let count = values.integer(EXPECTED_MODULES)?;
    Ok(Wishes {
        folder: (!folder.is_empty()).then(|| PathBuf::from(folder)),
        expected_modules: u32::try_from(count).ok().filter(|&count| count > 0),
    })
}

/// How long is waited for others, as ROS 2 has it now.
pub(super) fn limits(values: &Values) -> Result<Limits, ParameterError> {
    Ok(Limits {
        verdict: values.seconds(VERDICT_LIMIT)?,
        standstill: values.seconds(STANDSTILL_LIMIT)?,
    })
}

#[cfg(test)]
mod tests {
    use formation_tests::parameter_section;
    use ros_runtime::arguments::assigned_in;
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let shipped: BTreeMap<String, ParameterValue> = ["The target publisher"]
            .into_iter()
            .flat_map(|title| assigned_in(&parameter_section(title)).unwrap())
            .collect();
        let declarations = declarations(&Wishes::default());
        let declared = declarations.into_iter();
        let declared = declared.map(|declaration| (declaration.name.to_owned(), declaration.value));
        assert_eq!(shipped, declared.collect());
    }
}
