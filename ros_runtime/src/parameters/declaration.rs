//! The declaration of a parameter: name, type, range, default, and when it can change.

use std::fmt::Display;

use ros2_client::ParameterValue;
use ros2_client::parameters::{NumericRange, ParameterDescriptor, raw};

/// The values that a parameter can have, beyond its type.
#[derive(Clone, Debug, PartialEq)]
pub enum Range {
    /// Any of its type.
    Any,
    /// Whole numbers, both bounds included.
    Integer {
        /// The least.
        from: i64,
        /// The greatest.
        to: i64,
    },
    /// Numbers, both bounds included.
    Double {
        /// The least.
        from: f64,
        /// The greatest.
        to: f64,
    },
    /// One of these words.
    OneOf(Vec<&'static str>),
}

/// When a parameter can change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// While the process runs.
    AtRunTime,
    /// At its start only, for this reason.
    AtStart(&'static str),
}

/// What a parameter is, and the value that it has unless another is assigned.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// Its name.
    pub name: &'static str,
    /// What it means, with its unit.
    pub description: String,
    /// Its value; this also gives its type.
    pub value: ParameterValue,
    /// Which values it can have.
    pub range: Range,
    /// When it can change.
    pub change: Change,
}

/// The words for "yes" and "no" of YAML 1.1, which ROS 2 reads.
const YES: [&str; 4] = ["y", "yes", "true", "on"];
const NO: [&str; 4] = ["n", "no", "false", "off"];

impl Declaration {
    /// The value as one of this parameter, or why it cannot be one.
    pub(super) fn accept(&self, value: ParameterValue) -> Result<ParameterValue, String> {
        let value = self.coerce(value);
        if std::mem::discriminant(&value) != std::mem::discriminant(&self.value) {
            let (wanted, got) = (type_name(&self.value), type_name(&value));
            return Err(format!("must be {wanted}, got {got}"));
        }
        match (&self.range, &value) {
            (Range::Integer { from, to }, ParameterValue::Integer(number)) => {
                check_bounds(number, from, to)?;
            }
            (Range::Double { from, to }, ParameterValue::Double(number)) => {
                check_bounds(number, from, to)?;
            }
            (Range::OneOf(words), ParameterValue::String(word))
                if !words.contains(&word.as_str()) =>
            {
                return Err(format!("must be one of {}, got `{word}`", words.join(", ")));
            }
            _ => {}
        }
        Ok(value)
    }

    /// The value that a word of the command line stands for.
    pub(super) fn parse(&self, word: &str) -> Result<ParameterValue, String> {
        let word = word.trim();
        let value = match &self.value {
            ParameterValue::Double(_) => word.parse().ok().map(ParameterValue::Double),
            ParameterValue::Integer(_) => word.parse().ok().map(ParameterValue::Integer),
            _ => Some(ParameterValue::String(word.to_owned())),
        };
        let value =
            value.ok_or_else(|| format!("must be {}, got `{word}`", type_name(&self.value)));
        self.accept(value?)
    }

    /// Takes `2` for 2.0 and `yes` for true.
    fn coerce(&self, value: ParameterValue) -> ParameterValue {
        let is_in =
            |words: &[&str], word: &str| words.iter().any(|one| one.eq_ignore_ascii_case(word));
        match (&self.value, value) {
            #[expect(clippy::cast_precision_loss, reason = "a double is what was asked for")]
            (ParameterValue::Double(_), ParameterValue::Integer(number)) => {
                ParameterValue::Double(number as f64)
            }
            (ParameterValue::Boolean(_), ParameterValue::String(word)) if is_in(&YES, &word) => {
                ParameterValue::Boolean(true)
            }
            (ParameterValue::Boolean(_), ParameterValue::String(word)) if is_in(&NO, &word) => {
                ParameterValue::Boolean(false)
            }
            (_, value) => value,
        }
    }

    /// What tools show of it.
    pub(super) fn descriptor(&self) -> raw::ParameterDescriptor {
        let words = match &self.range {
            Range::OneOf(words) => Some(format!("one of {}", words.join(", "))),
            _ => None,
        };
        let fixed = match self.change {
            Change::AtRunTime => None,
            Change::AtStart(reason) => Some(format!("fixed at the start: {reason}")),
        };
        ParameterDescriptor {
            name: self.name.to_owned(),
            param_type: self.value.to_parameter_type(),
            description: self.description.clone(),
            read_only: fixed.is_some(),
            additional_constraints: words
                .into_iter()
                .chain(fixed)
                .collect::<Vec<_>>()
                .join("; "),
            dynamic_typing: false,
            range: match self.range {
                Range::Integer { from, to } => NumericRange::IntegerRange {
                    from_value: from,
                    to_value: to,
                    step: 0,
                },
                Range::Double { from, to } => NumericRange::FloatingPointRange {
                    from_value: from,
                    to_value: to,
                    step: 0.0,
                },
                Range::Any | Range::OneOf(_) => NumericRange::NotSpecified,
            },
        }
        .into()
    }
}

fn check_bounds<T: PartialOrd + Display>(value: &T, from: &T, to: &T) -> Result<(), String> {
    // A value that is no number lies within no bounds.
    if (from..=to).contains(&value) {
        Ok(())
    } else {
        Err(format!("must be from {from} to {to}, got {value}"))
    }
}

/// A value as people write it.
pub(crate) fn shown(value: &ParameterValue) -> String {
    match value {
        ParameterValue::Boolean(value) => value.to_string(),
        ParameterValue::Integer(value) => value.to_string(),
        ParameterValue::Double(value) => value.to_string(),
        ParameterValue::String(value) => value.clone(),
        other => format!("{other:?}"),
    }
}

fn type_name(value: &ParameterValue) -> &'static str {
    match value {
        ParameterValue::NotSet => "nothing",
        ParameterValue::Boolean(_) => "a boolean",
        ParameterValue::Integer(_) => "an integer",
        ParameterValue::Double(_) => "a number",
        ParameterValue::String(_) => "a string",
        ParameterValue::ByteArray(_)
        | ParameterValue::BooleanArray(_)
        | ParameterValue::IntegerArray(_)
        | ParameterValue::DoubleArray(_)
        | ParameterValue::StringArray(_) => "an array",
    }
}
