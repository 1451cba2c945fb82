//! Tables of what can be tuned, from which the options of the command line and the parameters of ROS 2 come.

use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use ros2_client::ParameterValue;

use super::declaration::{Change, Declaration, Range, shown};
use super::store::{ParameterError, Values};
use crate::words::Words;

/// How a field of type `T` is written as the value of a parameter.
pub struct ValueType<T> {
    range: Range,
    /// What stands for the value in the help of the command line.
    value_name: &'static str,
    /// What the description of a parameter ends with.
    unit: &'static str,
    write: fn(&T) -> ParameterValue,
    read: fn(&ParameterValue) -> Option<T>,
}

impl<T> ValueType<T> {
    /// A type whose values lie in `range`; `read` takes none but such values.
    #[must_use]
    pub fn new(
        value_name: &'static str,
        range: Range,
        write: fn(&T) -> ParameterValue,
        read: fn(&ParameterValue) -> Option<T>,
    ) -> Self {
        Self {
            range,
            value_name,
            unit: "",
            write,
            read,
        }
    }
}

/// The number of a value, if it is one.
#[must_use]
pub fn as_number(value: &ParameterValue) -> Option<f64> {
    match value {
        ParameterValue::Double(number) => Some(*number),
        _ => None,
    }
}

fn as_text(value: &ParameterValue) -> Option<&str> {
    match value {
        ParameterValue::String(text) => Some(text),
        _ => None,
    }
}

/// A number, both bounds included.
#[must_use]
pub fn number(value_name: &'static str, from: f64, to: f64) -> ValueType<f64> {
    let write = |number: &f64| ParameterValue::Double(*number);
    ValueType::new(value_name, Range::Double { from, to }, write, as_number)
}

/// A length in metres from 0 to `to`, of which 0 stands for none.
#[must_use]
pub fn metres(to: f64) -> ValueType<Option<f64>> {
    let write = |length: &Option<f64>| ParameterValue::Double(length.unwrap_or_default());
    let read = |value: &_| as_number(value).map(|length| (length > 0.0).then_some(length));
    ValueType::new("METRES", Range::Double { from: 0.0, to }, write, read)
}

/// A time in seconds, from a millisecond to a week.
#[must_use]
pub fn seconds() -> ValueType<Duration> {
    seconds_in(0.001, 604_800.0)
}

/// A time in seconds, both bounds included.
#[must_use]
pub fn seconds_in(from: f64, to: f64) -> ValueType<Duration> {
    let write = |time: &Duration| ParameterValue::Double(time.as_secs_f64());
    let read = |value: &_| Duration::try_from_secs_f64(as_number(value)?).ok();
    ValueType {
        unit: ", in seconds",
        ..ValueType::new("SECONDS", Range::Double { from, to }, write, read)
    }
}

/// A time in milliseconds, from 0 to `to`.
#[must_use]
pub fn milliseconds(to: f64) -> ValueType<Duration> {
    let write = |time: &Duration| ParameterValue::Double(time.as_secs_f64() * 1_000.0);
    let read = |value: &_| Duration::try_from_secs_f64(as_number(value)? / 1_000.0).ok();
    ValueType::new("MILLISECONDS", Range::Double { from: 0.0, to }, write, read)
}

/// A whole number from 0 to `to`, of which 0 stands for none.
#[must_use]
pub fn whole_number(to: u32) -> ValueType<Option<u32>> {
    let to = to.into();
    let write = |number: &Option<u32>| ParameterValue::Integer(number.unwrap_or_default().into());
    ValueType::new(
        "NUMBER",
        Range::Integer { from: 0, to },
        write,
        |value| match value {
            ParameterValue::Integer(number) => {
                let number = u32::try_from(*number).ok()?;
                Some((number > 0).then_some(number))
            }
            _ => None,
        },
    )
}

/// Yes or no.
#[must_use]
pub fn switch() -> ValueType<bool> {
    let write = |value: &bool| ParameterValue::Boolean(*value);
    ValueType::new("", Range::Any, write, |value| match value {
        ParameterValue::Boolean(value) => Some(*value),
        _ => None,
    })
}

/// A text, of which the empty one stands for none.
#[must_use]
pub fn text(value_name: &'static str) -> ValueType<Option<String>> {
    let write = |text: &Option<String>| ParameterValue::String(text.clone().unwrap_or_default());
    ValueType::new(value_name, Range::Any, write, |value| {
        let text = as_text(value)?;
        Some((!text.is_empty()).then(|| text.to_owned()))
    })
}

/// One of a few words.
#[must_use]
pub fn choice<T: Words>(value_name: &'static str) -> ValueType<T> {
    let words = Range::OneOf(T::WORDS.iter().map(|(word, _)| *word).collect());
    let write = |value: &T| ParameterValue::String(value.word().to_owned());
    ValueType::new(value_name, words, write, |value| {
        T::from_word(as_text(value)?).ok()
    })
}

type Get<P> = Box<dyn Fn(&P) -> ParameterValue>;
type Set<P> = Box<dyn Fn(&mut P, &ParameterValue) -> bool>;

/// One row of a table: a parameter, and the field of `P` that holds it.
pub struct Tunable<P> {
    name: &'static str,
    help: &'static str,
    unit: &'static str,
    range: Range,
    change: Change,
    /// Whether it is a parameter of ROS 2, and not only an option of the command line.
    is_parameter: bool,
    option: String,
    alias: Option<&'static str>,
    /// What the option sets a boolean to; it takes no value then.
    flag_sets: bool,
    value_name: &'static str,
    get: Get<P>,
    /// Sets the field; returns whether the value could be read.
    set: Set<P>,
}

impl<P: Clone + 'static> Tunable<P> {
    /// The parameter `name`, which can change at run time. Its option is the last part of the name, with hyphens; that of
    /// a boolean takes no value and sets it.
    #[must_use]
    pub fn new<T: 'static>(
        name: &'static str,
        value_type: ValueType<T>,
        field: fn(&mut P) -> &mut T,
        help: &'static str,
    ) -> Self {
        let (write, read) = (value_type.write, value_type.read);
        Self {
            name,
            help,
            unit: value_type.unit,
            range: value_type.range,
            change: Change::AtRunTime,
            is_parameter: true,
            option: name.rsplit('.').next().unwrap_or(name).replace('_', "-"),
            alias: None,
            flag_sets: true,
            value_name: value_type.value_name,
            get: Box::new(move |parameters| write(field(&mut parameters.clone()))),
            set: Box::new(move |parameters, value| match read(value) {
                Some(value) => {
                    *field(parameters) = value;
                    true
                }
                None => false,
            }),
        }
    }

    /// Fixes the value at the start; `reason` is what a client that sets it later is told.
    #[must_use]
    pub fn at_start(self, reason: &'static str) -> Self {
        let change = Change::AtStart(reason);
        Self { change, ..self }
    }

    /// Makes it an option of the command line only, and no ROS parameter.
    #[must_use]
    pub fn option_only(self) -> Self {
        let is_parameter = false;
        Self {
            is_parameter,
            ..self
        }
    }

    /// Names its option.
    #[must_use]
    pub fn option(self, name: &str) -> Self {
        let option = name.to_owned();
        Self { option, ..self }
    }

    /// Gives its option a second name.
    #[must_use]
    pub fn alias(self, alias: &'static str) -> Self {
        let alias = Some(alias);
        Self { alias, ..self }
    }

    /// Names an option that sets it to false.
    #[must_use]
    pub fn unset_by(self, name: &str) -> Self {
        let flag_sets = false;
        Self {
            flag_sets,
            ..self.option(name)
        }
    }

    fn declaration(&self, values: &P) -> Declaration {
        Declaration {
            name: self.name,
            description: format!("{}{}", self.help, self.unit),
            value: (self.get)(values),
            range: self.range.clone(),
            change: self.change,
        }
    }

    fn argument(&self, defaults: &P, heading: &'static str) -> Arg {
        let argument = Arg::new(self.name)
            .long(self.option.clone())
            .aliases(self.alias)
            .help(self.help)
            .help_heading(heading);
        let declaration = self.declaration(defaults);
        if let ParameterValue::Boolean(_) = declaration.value {
            return argument.action(ArgAction::SetTrue);
        }
        let default = Some(shown(&declaration.value)).filter(|default| !default.is_empty());
        let parser = match &self.range {
            Range::OneOf(words) => {
                let words = PossibleValuesParser::new(words.clone());
                ValueParser::new(words.map(ParameterValue::String))
            }
            _ => ValueParser::new(move |text: &str| declaration.parse(text)),
        };
        argument
            .value_name(self.value_name)
            .value_parser(parser)
            .default_values(default)
    }

    /// Takes the value that the command line has, if it has any.
    fn take(&self, matches: &ArgMatches, parameters: &mut P) {
        let value = if let ParameterValue::Boolean(_) = (self.get)(parameters) {
            let is_set = matches.get_flag(self.name);
            is_set.then_some(ParameterValue::Boolean(self.flag_sets))
        } else {
            matches.get_one::<ParameterValue>(self.name).cloned()
        };
        let is_read = value.is_none_or(|value| (self.set)(parameters, &value));
        debug_assert!(
            is_read,
            "the parser of --{} takes what the field does not",
            self.option
        );
    }
}

/// Parameters of a node, declared by a table.
pub trait Tunables: Clone + Default + Send + Sync + 'static {
    /// The heading of their options in the help of the command line.
    const HEADING: &'static str;

    /// One row for each of them.
    fn table() -> Vec<Tunable<Self>>;

    /// Checks what no range of a single value can.
    ///
    /// # Errors
    /// Names a parameter that contradicts another.
    fn check(&self) -> Result<(), ParameterError> {
        Ok(())
    }

    /// Declares them for ROS 2, with these values unless others are assigned.
    fn declarations(&self) -> Vec<Declaration> {
        let rows = Self::table().into_iter().filter(|row| row.is_parameter);
        rows.map(|row| row.declaration(self)).collect()
    }

    /// Replaces the values by the present ones of the ROS parameters.
    ///
    /// # Errors
    /// Names a parameter that is not declared, or that contradicts another.
    fn read(mut self, values: &Values) -> Result<Self, ParameterError> {
        for row in Self::table().iter().filter(|row| row.is_parameter) {
            let value = values.get(row.name);
            if !value.is_some_and(|value| (row.set)(&mut self, value)) {
                return Err(ParameterError::new(row.name, "has no value of its type"));
            }
        }
        self.check()?;
        Ok(self)
    }
}

/// Tunables as options of a command line.
#[derive(Clone, Debug, Default)]
pub struct Tuned<P>(pub P);

impl<P: Tunables> Args for Tuned<P> {
    fn augment_args(command: Command) -> Command {
        let defaults = P::default();
        let table = P::table().into_iter();
        command.args(table.map(|row| row.argument(&defaults, P::HEADING)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<P: Tunables> FromArgMatches for Tuned<P> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut tuned = Self::default();
        tuned.update_from_arg_matches(matches)?;
        Ok(tuned)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for row in P::table() {
            row.take(matches, &mut self.0);
        }
        Ok(())
    }
}
