//! What a parameter is.

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
    OneOf(&'static [&'static str]),
}

/// When a parameter can change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// While the process runs.
    AtRunTime,
    /// At its start only, for this reason.
    AtStart(&'static str),
}

/// What a parameter is, and the value that it has unless something is assigned to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// Its name.
    pub name: &'static str,
    /// What it means, with its unit.
    pub description: &'static str,
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
    /// The value as one of this parameter, or why it cannot be.
    pub(super) fn accept(&self, value: ParameterValue) -> Result<ParameterValue, String> {
        let value = self.coerce(value);
        if std::mem::discriminant(&value) != std::mem::discriminant(&self.value) {
            return Err(format!(
                "must be {}, got {}",
                type_name(&self.value),
                type_name(&value)
            ));
        }
        match (&self.range, &value) {
            (Range::Integer { from, to }, ParameterValue::Integer(number))
                if !(from..=to).contains(&number) =>
            {
                Err(format!("must be from {from} to {to}, got {number}"))
            }
            (Range::Double { from, to }, ParameterValue::Double(number))
                if !(*from..=*to).contains(number) =>
            {
                Err(format!("must be from {from} to {to}, got {number}"))
            }
            (Range::OneOf(words), ParameterValue::String(word))
                if !words.contains(&word.as_str()) =>
            {
                Err(format!("must be one of {}, got `{word}`", words.join(", ")))
            }
            _ => Ok(value),
        }
    }

    /// People write `2` for 2.0 and `yes` for true.
    fn coerce(&self, value: ParameterValue) -> ParameterValue {
        let word_in =
            |words: &[&str], word: &str| words.iter().any(|other| other.eq_ignore_ascii_case(word));
        match (&self.value, value) {
            #[expect(clippy::cast_precision_loss, reason = "a double is what was asked for")]
            (ParameterValue::Double(_), ParameterValue::Integer(number)) => {
                ParameterValue::Double(number as f64)
            }
            (ParameterValue::Boolean(_), ParameterValue::String(word)) if word_in(&YES, &word) => {
                ParameterValue::Boolean(true)
            }
            (ParameterValue::Boolean(_), ParameterValue::String(word)) if word_in(&NO, &word) => {
                ParameterValue::Boolean(false)
            }
            (_, value) => value,
        }
    }

    /// What tools show of it.
    pub(super) fn descriptor(&self) -> raw::ParameterDescriptor {
        let (constraints, read_only) = match self.change {
            Change::AtRunTime => (String::new(), false),
            Change::AtStart(reason) => (format!("fixed at the start: {reason}"), true),
        };
        let words = match self.range {
            Range::OneOf(words) => format!("one of {}", words.join(", ")),
            _ => String::new(),
        };
        let constraints: Vec<String> = [words, constraints]
            .into_iter()
            .filter(|text| !text.is_empty())
            .collect();
        ParameterDescriptor {
            name: self.name.to_owned(),
            param_type: self.value.to_parameter_type(),
            description: self.description.to_owned(),
            additional_constraints: constraints.join("; "),
            read_only,
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

/// A value as people write it.
pub fn shown(value: &ParameterValue) -> String {
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
