//! YAML as parameters are written in it.

use std::fmt;

use ros2_client::ParameterValue;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// A YAML value whose mappings may have a key twice, as parameter files may: the last entry holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Yaml {
    Null,
    Scalar(ParameterValue),
    Sequence(Vec<Yaml>),
    Mapping(Vec<(String, Yaml)>),
}

impl<'de> Deserialize<'de> for Yaml {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(YamlVisitor)
    }
}

struct YamlVisitor;

impl<'de> Visitor<'de> for YamlVisitor {
    type Value = Yaml;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a YAML value")
    }

    fn visit_unit<E>(self) -> Result<Yaml, E> {
        Ok(Yaml::Null)
    }

    fn visit_none<E>(self) -> Result<Yaml, E> {
        Ok(Yaml::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(ParameterValue::Boolean(value)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(ParameterValue::Integer(value)))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Yaml, E> {
        let number = i64::try_from(value);
        let number = number.map_err(|_| E::custom(format!("{value} is too large for an integer")));
        self.visit_i64(number?)
    }

    fn visit_f64<E>(self, value: f64) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(ParameterValue::Double(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(ParameterValue::String(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Yaml, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = sequence.next_element()? {
            values.push(value);
        }
        Ok(Yaml::Sequence(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut mapping: A) -> Result<Yaml, A::Error> {
        let mut entries = Vec::new();
        while let Some(key) = mapping.next_key::<Yaml>()? {
            let key = match key {
                Yaml::Scalar(ParameterValue::String(text)) => text,
                Yaml::Scalar(ParameterValue::Integer(number)) => number.to_string(),
                Yaml::Scalar(ParameterValue::Boolean(value)) => value.to_string(),
                _ => return Err(A::Error::custom("a name must be a word")),
            };
            entries.push((key, mapping.next_value()?));
        }
        Ok(Yaml::Mapping(entries))
    }
}

/// The value of a parameter, with the type that YAML gives it.
pub(super) fn parameter_value(yaml: Yaml) -> Result<ParameterValue, String> {
    match yaml {
        Yaml::Null => Err("has no value".to_owned()),
        Yaml::Scalar(value) => Ok(value),
        Yaml::Sequence(values) => {
            array(&values).ok_or_else(|| "must be a list of values of one type".to_owned())
        }
        Yaml::Mapping(_) => Err("must be one value, not a mapping".to_owned()),
    }
}

/// An array, whose elements are all of one type; a whole number counts as a number among numbers. An empty list is one of
/// strings.
fn array(values: &[Yaml]) -> Option<ParameterValue> {
    macro_rules! all {
        ($($scalar:ident($value:ident) => $element:expr),+) => {
            values
                .iter()
                .map(|value| match value {
                    $(Yaml::Scalar(ParameterValue::$scalar($value)) => Some($element),)+
                    _ => None,
                })
                .collect::<Option<Vec<_>>>()
        };
    }
    #[expect(
        clippy::cast_precision_loss,
        reason = "a number is what the others are"
    )]
    let numbers = || all!(Double(value) => *value, Integer(value) => *value as f64);
    all!(String(value) => value.clone())
        .map(ParameterValue::StringArray)
        .or_else(|| all!(Boolean(value) => *value).map(ParameterValue::BooleanArray))
        .or_else(|| all!(Integer(value) => *value).map(ParameterValue::IntegerArray))
        .or_else(|| numbers().map(ParameterValue::DoubleArray))
}
