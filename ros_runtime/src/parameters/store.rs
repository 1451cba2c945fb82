//! The parameters of one node, and the rules by which they change.

use std::collections::BTreeMap;

use ros2_client::ParameterValue;
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::ListParametersResult;
use thiserror::Error;

use super::declaration::{Change, Declaration, shown};
use crate::arguments::{Origin, ParameterAssignment};
use crate::words::suggestion;

/// The values of a node's parameters, by name.
pub type Values = BTreeMap<&'static str, ParameterValue>;

/// Uses new values, or says why they cannot be used.
pub(crate) type Apply<'a> = &'a mut dyn FnMut(&Values) -> Result<(), String>;

/// What is wrong with a parameter.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("parameter `{name}`: {reason}")]
pub struct ParameterError {
    /// Its name.
    pub name: String,
    /// What is wrong, and what would be right.
    pub reason: String,
}

impl ParameterError {
    /// An error of the parameter `name`.
    pub fn new(name: &str, reason: impl Into<String>) -> Self {
        Self {
            name: name.to_owned(),
            reason: reason.into(),
        }
    }
}

/// The parameters of a node.
#[derive(Clone, Debug, Default)]
pub struct Parameters {
    declarations: BTreeMap<&'static str, Declaration>,
    values: Values,
}

impl Parameters {
    /// Declares parameters and takes the values that are assigned to them. Also returns warnings.
    ///
    /// # Errors
    /// Names the parameter whose value cannot be used, or that the command line assigns although it is not declared.
    pub fn declare(
        declarations: impl IntoIterator<Item = Declaration>,
        assignments: &BTreeMap<&str, &ParameterAssignment>,
    ) -> Result<(Self, Vec<String>), ParameterError> {
        let declarations = declarations.into_iter();
        let declarations: BTreeMap<_, _> = declarations
            .map(|declaration| (declaration.name, declaration))
            .collect();
        let defaults = declarations.values();
        let mut values: Values = defaults
            .map(|declaration| (declaration.name, declaration.value.clone()))
            .collect();
        let mut warnings = Vec::new();
        for (name, assignment) in assignments {
            let Some(declaration) = declarations.get(name) else {
                let reason = format!(
                    "{} assigns it, but there is none{}",
                    assignment.origin,
                    suggestion(name, declarations.keys().copied())
                );
                match &assignment.origin {
                    Origin::CommandLine => return Err(ParameterError::new(name, reason)),
                    Origin::File(_) if assignment.names_node => {
                        warnings.push(ParameterError::new(name, reason).to_string());
                    }
                    // Files may hold the parameters of many nodes.
                    Origin::File(_) => {}
                }
                continue;
            };
            let value = declaration
                .accept(assignment.value.clone())
                .map_err(|reason| {
                    ParameterError::new(name, format!("{}: {reason}", assignment.origin))
                })?;
            values.insert(declaration.name, value);
        }
        let parameters = Self {
            declarations,
            values,
        };
        Ok((parameters, warnings))
    }

    /// Their current values.
    #[must_use]
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Makes all of these changes or none; returns those that changed a value. `apply` uses the new values, or says why
    /// they cannot be used.
    pub(crate) fn set(
        &mut self,
        changes: Vec<raw::Parameter>,
        apply: Apply<'_>,
    ) -> Result<Vec<(&'static str, ParameterValue)>, String> {
        let mut next = self.values.clone();
        let mut changed = Vec::new();
        for raw::Parameter { name, value } in changes {
            let (name, value) = self
                .accept(&name, value.into())
                .map_err(|error| error.to_string())?;
            if self.values.get(name) != Some(&value) {
                next.insert(name, value.clone());
                changed.push((name, value));
            }
        }
        if !changed.is_empty() {
            apply(&next)?;
            self.values = next;
        }
        for (name, value) in &changed {
            tracing::info!("parameter {name} is now {}", shown(value));
        }
        Ok(changed)
    }

    fn accept(
        &self,
        name: &str,
        value: ParameterValue,
    ) -> Result<(&'static str, ParameterValue), ParameterError> {
        let declaration = self.declarations.get(name).ok_or_else(|| {
            let known = self.declarations.keys().copied();
            ParameterError::new(name, format!("there is none{}", suggestion(name, known)))
        })?;
        let value = declaration
            .accept(value)
            .map_err(|reason| ParameterError::new(name, reason))?;
        match declaration.change {
            Change::AtStart(reason) if self.values.get(name) != Some(&value) => Err(
                ParameterError::new(name, format!("can only be set at the start: {reason}")),
            ),
            _ => Ok((declaration.name, value)),
        }
    }

    /// The values of these parameters; those of parameters that do not exist are not set.
    pub(crate) fn get(&self, names: &[String]) -> Vec<ParameterValue> {
        names
            .iter()
            .map(|name| {
                let value = self.values.get(name.as_str());
                value.cloned().unwrap_or(ParameterValue::NotSet)
            })
            .collect()
    }

    /// What these parameters are; of those that do not exist, only the name.
    pub(crate) fn describe(&self, names: &[String]) -> Vec<raw::ParameterDescriptor> {
        names
            .iter()
            .map(|name| match self.declarations.get(name.as_str()) {
                Some(declaration) => declaration.descriptor(),
                None => raw::ParameterDescriptor {
                    name: name.clone(),
                    r#type: raw::ParameterType::NOT_SET,
                    description: String::new(),
                    additional_constraints: String::new(),
                    read_only: false,
                    dynamic_typing: false,
                    floating_point_range: Vec::new(),
                    integer_range: Vec::new(),
                },
            })
            .collect()
    }

    /// The names that equal a prefix or lie below it within `depth` levels, or all names; a depth of 0 is unlimited.
    pub(crate) fn list(&self, prefixes: &[String], depth: u64) -> ListParametersResult {
        let within = |levels: usize| depth == 0 || levels as u64 <= depth;
        let is_listed = |name: &str| {
            if prefixes.is_empty() {
                return within(name.split('.').count());
            }
            prefixes.iter().any(|prefix| {
                name.strip_prefix(prefix.as_str()).is_some_and(|rest| {
                    match rest.strip_prefix('.') {
                        Some(below) => within(below.split('.').count()),
                        None => rest.is_empty(),
                    }
                })
            })
        };
        let names: Vec<String> = self
            .declarations
            .keys()
            .filter(|name| is_listed(name))
            .map(|name| (*name).to_owned())
            .collect();
        let mut prefixes: Vec<String> = names
            .iter()
            .filter_map(|name| name.rsplit_once('.'))
            .map(|(prefix, _)| prefix.to_owned())
            .collect();
        prefixes.sort();
        prefixes.dedup();
        ListParametersResult { names, prefixes }
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use super::*;
    use crate::arguments::Namespace;
    use crate::arguments::RosArguments;
    use crate::parameters::Range;

    fn declarations() -> Vec<Declaration> {
        let declaration = |name, value, range, change| Declaration {
            name,
            description: "for the test".to_owned(),
            value,
            range,
            change,
        };
        vec![
            declaration(
                "speed",
                ParameterValue::Double(1.0),
                Range::Double { from: 0.5, to: 9.0 },
                Change::AtRunTime,
            ),
            declaration(
                "limits.count",
                ParameterValue::Integer(3),
                Range::Integer { from: 1, to: 5 },
                Change::AtRunTime,
            ),
            declaration(
                "quiet",
                ParameterValue::Boolean(false),
                Range::Any,
                Change::AtRunTime,
            ),
            declaration(
                "mode",
                ParameterValue::String("fast".to_owned()),
                Range::OneOf(vec!["fast", "slow"]),
                Change::AtStart("it is built in"),
            ),
        ]
    }

    fn declared(arguments: &str) -> Result<(Parameters, Vec<String>), String> {
        let words = format!("program --ros-args {arguments}");
        let words = words.split_whitespace().map(OsString::from);
        let file =
            "/**: {ros__parameters: {sped: 1, speed: 4}}\n/one: {ros__parameters: {quit: 1}}";
        let (_, ros) = RosArguments::extract(words, |_| Ok(file.to_owned()))
            .map_err(|error| error.to_string())?;
        let node = ros.remaps.identity("one", &Namespace::default());
        Parameters::declare(declarations(), &ros.parameters.of_node(&node))
            .map_err(|error| error.to_string())
    }

    fn change(name: &str, value: ParameterValue) -> raw::Parameter {
        raw::Parameter {
            name: name.to_owned(),
            value: value.into(),
        }
    }

    #[test]
    fn assignments_at_the_start_take_precedence_over_defaults() {
        let (parameters, _) = declared("-p speed:=2 -p quiet:=yes -p mode:=slow").unwrap();
        let expected = [
            ("limits.count", ParameterValue::Integer(3)),
            ("mode", ParameterValue::String("slow".to_owned())),
            ("quiet", ParameterValue::Boolean(true)),
            ("speed", ParameterValue::Double(2.0)),
        ];
        assert_eq!(*parameters.values(), expected.into());
    }

    #[test]
    fn a_value_that_cannot_be_assigned_is_refused_with_the_values_that_can() {
        for (arguments, error) in [
            (
                "-p speed:=0.1",
                "parameter `speed`: the command line: must be from 0.5 to 9, got 0.1",
            ),
            (
                "-p speed:=fast",
                "parameter `speed`: the command line: must be a number, got a string",
            ),
            (
                "-p limits.count:=6",
                "parameter `limits.count`: the command line: must be from 1 to 5, got 6",
            ),
            (
                "-p mode:=idle",
                "parameter `mode`: the command line: must be one of fast, slow, got `idle`",
            ),
            (
                "-p sped:=2",
                "parameter `sped`: the command line assigns it, but there is none; did you mean `speed`?",
            ),
        ] {
            assert_eq!(declared(arguments).unwrap_err(), error);
        }
    }

    #[test]
    fn files_may_hold_parameters_of_many_nodes_but_are_checked_where_they_name_this_one() {
        let (parameters, warnings) = declared("--params-file f.yaml").unwrap();
        assert_eq!(parameters.values()["speed"], ParameterValue::Double(4.0));
        assert_eq!(
            warnings,
            ["parameter `quit`: f.yaml assigns it, but there is none; did you mean `quiet`?"]
        );
    }

    #[test]
    fn changes_are_made_together_or_not_at_all() {
        let (mut parameters, _) = declared("").unwrap();
        let before = parameters.values().clone();
        let mut applied = 0;
        for (bad, error) in [
            (
                change("mode", ParameterValue::String("slow".to_owned())),
                "can only be set at the start: it is built in",
            ),
            (
                change("speed", ParameterValue::Double(f64::NAN)),
                "must be from 0.5 to 9, got NaN",
            ),
            (
                change("speed", ParameterValue::NotSet),
                "must be a number, got nothing",
            ),
            (
                change("sped", ParameterValue::Double(1.0)),
                "did you mean `speed`?",
            ),
        ] {
            let good = change("quiet", ParameterValue::Boolean(true));
            let outcome = parameters.set(vec![good, bad], &mut |_| {
                applied += 1;
                Ok(())
            });
            assert!(outcome.unwrap_err().contains(error), "{error}");
        }
        let refused = parameters.set(
            vec![change("speed", ParameterValue::Double(2.0))],
            &mut |_| Err("no".to_owned()),
        );
        assert_eq!(refused, Err("no".to_owned()));
        assert_eq!((parameters.values(), applied), (&before, 0));
        let unchanged = change("mode", ParameterValue::String("fast".to_owned()));
        let outcome = parameters.set(
            vec![unchanged, change("speed", ParameterValue::Integer(2))],
            &mut |values| {
                assert_eq!(values["speed"], ParameterValue::Double(2.0));
                Ok(())
            },
        );
        let changed = ("speed", ParameterValue::Double(2.0));
        assert_eq!(outcome, Ok(vec![changed.clone()]));
        assert_eq!(parameters.values()["speed"], changed.1);
    }

    #[test]
    fn tools_find_names_types_and_ranges() {
        let (parameters, _) = declared("").unwrap();
        let list = |prefixes: &[&str], depth| {
            let prefixes: Vec<String> = prefixes.iter().map(|&prefix| prefix.to_owned()).collect();
            let listed = parameters.list(&prefixes, depth);
            (listed.names.join(" "), listed.prefixes.join(" "))
        };
        let all = (
            "limits.count mode quiet speed".to_owned(),
            "limits".to_owned(),
        );
        assert_eq!(list(&[], 0), all);
        assert_eq!(list(&[], 1).0, "mode quiet speed");
        assert_eq!(list(&["limits", "mode"], 1).0, "limits.count mode");
        assert_eq!(list(&["limit"], 0).0, "");
        let names = ["speed", "mode", "none"].map(str::to_owned);
        let described = parameters.describe(&names);
        assert_eq!(
            described[0].floating_point_range[0].to_value.to_string(),
            "9"
        );
        assert!(described[1].read_only && !described[0].read_only);
        assert!(
            described[1]
                .additional_constraints
                .contains("one of fast, slow")
        );
        assert_eq!(described[2].r#type, raw::ParameterType::NOT_SET);
        assert_eq!(parameters.get(&names)[2], ParameterValue::NotSet);
    }
}
