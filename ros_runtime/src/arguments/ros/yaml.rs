//! YAML as parameters are written in it.

use std::fmt;

use ros2_client::ParameterValue;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

/// A YAML value whose mappings may name a key twice, as parameter files may: the last one holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Yaml {
    Null,
    Boolean(bool),
    Integer(i64),
    Double(f64),
    String(String),
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
        Ok(Yaml::Boolean(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Yaml, E> {
        Ok(Yaml::Integer(value))
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Yaml, E> {
        i64::try_from(value)
            .map(Yaml::Integer)
            .map_err(|_| E::custom(format!("{value} is too large for an integer")))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Yaml, E> {
        Ok(Yaml::Double(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Yaml, E> {
        Ok(Yaml::String(value.to_owned()))
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
                Yaml::String(text) => text,
                Yaml::Integer(number) => number.to_string(),
                Yaml::Boolean(value) => value.to_string(),
                _ => return Err(serde::de::Error::custom("a name must be a word")),
            };
            entries.push((key, mapping.next_value()?));
        }
        Ok(Yaml::Mapping(entries))
    }
}

/// The value of a parameter, with the type that YAML gives it.
pub(super) fn parameter_value(yaml: &Yaml) -> Result<ParameterValue, String> {
    Ok(match yaml {
        Yaml::Null => return Err("has no value".to_owned()),
        Yaml::Boolean(value) => ParameterValue::Boolean(*value),
        Yaml::Integer(value) => ParameterValue::Integer(*value),
        Yaml::Double(value) => ParameterValue::Double(*value),
        Yaml::String(value) => ParameterValue::String(value.clone()),
        Yaml::Sequence(values) => array(values)?,
        Yaml::Mapping(_) => return Err("must be one value, not a mapping".to_owned()),
    })
}

/// An array, whose elements are all of one type; whole numbers among others count as such.
fn array(values: &[Yaml]) -> Result<ParameterValue, String> {
    fn all<T>(values: &[Yaml], pick: impl Fn(&Yaml) -> Option<T>) -> Option<Vec<T>> {
        values.iter().map(pick).collect()
    }
    let strings = all(values, |value| match value {
        Yaml::String(text) => Some(text.clone()),
        _ => None,
    });
    let booleans = || {
        all(values, |value| match value {
            Yaml::Boolean(value) => Some(*value),
            _ => None,
        })
    };
    let integers = || {
        all(values, |value| match value {
            Yaml::Integer(value) => Some(*value),
            _ => None,
        })
    };
    let doubles = || {
        all(values, |value| match value {
            Yaml::Double(value) => Some(*value),
            #[expect(clippy::cast_precision_loss, reason = "a double is what was asked for")]
            Yaml::Integer(value) => Some(*value as f64),
            _ => None,
        })
    };
    strings
        .map(ParameterValue::StringArray)
        .or_else(|| booleans().map(ParameterValue::BooleanArray))
        .or_else(|| integers().map(ParameterValue::IntegerArray))
        .or_else(|| doubles().map(ParameterValue::DoubleArray))
        .ok_or_else(|| "must be a list of values of one type".to_owned())
}
