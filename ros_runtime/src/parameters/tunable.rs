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
            write,
            read,
        }
    }
}

/// The range of times in seconds, from a millisecond to a week.
const SECONDS: Range = Range::Double {
    from: 0.001,
    to: 604_800.0,
};

/// A time in seconds.
#[must_use]
pub fn seconds() -> ValueType<Duration> {
    seconds_in(SECONDS)
}

/// A time in seconds in a range of its own.
#[must_use]
pub fn seconds_in(range: Range) -> ValueType<Duration> {
    ValueType::new(
        "SECONDS",
        range,
        |time| ParameterValue::Double(time.as_secs_f64()),
        |value| match value {
            ParameterValue::Double(seconds) => Duration::try_from_secs_f64(*seconds).ok(),
            _ => None,
        },
    )
}

/// A number, both bounds included.
#[must_use]
pub fn number(value_name: &'static str, from: f64, to: f64) -> ValueType<f64> {
    ValueType::new(
        value_name,
        Range::Double { from, to },
        |number| ParameterValue::Double(*number),
        |value| match value {
            ParameterValue::Double(number) => Some(*number),
            _ => None,
        },
    )
}

/// A whole number from 0 to `to`, of which 0 stands for none.
#[must_use]
pub fn whole_number(to: u32) -> ValueType<Option<u32>> {
    let to = to.into();
    ValueType::new(
        "NUMBER",
        Range::Integer { from: 0, to },
        |number| ParameterValue::Integer(number.unwrap_or_default().into()),
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
    ValueType::new(
        "",
        Range::Any,
        |value| ParameterValue::Boolean(*value),
        |value| match value {
            ParameterValue::Boolean(value) => Some(*value),
            _ => None,
        },
    )
}

/// A text, of which the empty one stands for none.
#[must_use]
pub fn text(value_name: &'static str) -> ValueType<Option<String>> {
    ValueType::new(
        value_name,
        Range::Any,
        |text| ParameterValue::String(text.clone().unwrap_or_default()),
        |value| match value {
            ParameterValue::String(text) if text.is_empty() => Some(None),
            ParameterValue::String(text) => Some(Some(text.clone())),
            _ => None,
        },
    )
}

/// One of a few words.
#[must_use]
pub fn choice<T: Words>(value_name: &'static str) -> ValueType<T> {
    ValueType::new(
        value_name,
        Range::OneOf(T::WORDS.iter().map(|(word, _)| *word).collect()),
        |value| ParameterValue::String(value.word().to_owned()),
        |value| match value {
            ParameterValue::String(word) => T::from_word(word).ok(),
            _ => None,
        },
    )
}

type Get<P> = Box<dyn Fn(&P) -> ParameterValue>;
type Set<P> = Box<dyn Fn(&mut P, &ParameterValue) -> bool>;

/// One row of a table: a parameter, and the field of `P` that holds it.
pub struct Tunable<P> {
    name: &'static str,
    help: &'static str,
    range: Range,
    change: Change,
    is_parameter: bool,
    option: Option<CommandLineOption>,
    value_name: &'static str,
    get: Get<P>,
    /// Sets the field; returns whether the value could be read.
    set: Set<P>,
}

/// The option of the command line that sets a tunable.
struct CommandLineOption {
    name: String,
    alias: Option<&'static str>,
    heading: Option<&'static str>,
    /// What the option sets a boolean to; it takes no value then.
    flag_sets: bool,
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
        let last = name.rsplit('.').next().unwrap_or(name);
        Self {
            name,
            help,
            range: value_type.range,
            change: Change::AtRunTime,
            is_parameter: true,
            option: Some(CommandLineOption {
                name: last.replace('_', "-"),
                alias: None,
                heading: None,
                flag_sets: true,
            }),
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

    /// The same, set at the start only, for this reason.
    #[must_use]
    pub fn at_start(self, reason: &'static str) -> Self {
        let change = Change::AtStart(reason);
        Self { change, ..self }
    }

    /// The same without a parameter of ROS 2: the command line alone sets it.
    #[must_use]
    pub fn without_parameter(self) -> Self {
        Self {
            is_parameter: false,
            ..self
        }
    }

    /// The same without an option of the command line.
    #[must_use]
    pub fn without_option(self) -> Self {
        Self {
            option: None,
            ..self
        }
    }

    /// The same with an option of this name.
    #[must_use]
    pub fn option(self, name: &str) -> Self {
        self.with(|option| option.name = name.to_owned())
    }

    /// The same with a second name of the option.
    #[must_use]
    pub fn alias(self, alias: &'static str) -> Self {
        self.with(|option| option.alias = Some(alias))
    }

    /// The same below this heading of the help.
    #[must_use]
    pub fn heading(self, heading: &'static str) -> Self {
        self.with(|option| option.heading = Some(heading))
    }

    /// The same with an option of this name, which sets it to false.
    #[must_use]
    pub fn unset_by(self, name: &str) -> Self {
        self.option(name).with(|option| option.flag_sets = false)
    }

    fn with(mut self, change: impl FnOnce(&mut CommandLineOption)) -> Self {
        if let Some(option) = &mut self.option {
            change(option);
        }
        self
    }

    fn declaration(&self, values: &P) -> Declaration {
        Declaration {
            name: self.name,
            description: self.help,
            value: (self.get)(values),
            range: self.range.clone(),
            change: self.change,
        }
    }

    fn argument(&self, defaults: &P, heading: &'static str) -> Option<Arg> {
        let option = self.option.as_ref()?;
        let argument = Arg::new(self.name)
            .long(option.name.clone())
            .visible_aliases(option.alias)
            .help(self.help)
            .help_heading(option.heading.unwrap_or(heading));
        let declaration = self.declaration(defaults);
        if let ParameterValue::Boolean(_) = declaration.value {
            return Some(argument.action(ArgAction::SetTrue));
        }
        let default = shown(&declaration.value);
        let argument = argument.value_name(self.value_name);
        let argument = match &self.range {
            Range::OneOf(words) => {
                let words = PossibleValuesParser::new(words.clone());
                argument.value_parser(words.map(ParameterValue::String))
            }
            _ => argument.value_parser(ValueParser::new(move |text: &str| declaration.parse(text))),
        };
        Some(if default.is_empty() {
            argument
        } else {
            argument.default_value(default)
        })
    }

    /// Takes the value that the command line has, if it has any.
    fn take(&self, matches: &ArgMatches, parameters: &mut P) {
        let Some(option) = &self.option else { return };
        let value = if let ParameterValue::Boolean(_) = (self.get)(parameters) {
            let is_set = matches.get_flag(self.name);
            is_set.then_some(ParameterValue::Boolean(option.flag_sets))
        } else {
            matches.get_one::<ParameterValue>(self.name).cloned()
        };
        let is_read = value.is_none_or(|value| (self.set)(parameters, &value));
        debug_assert!(
            is_read,
            "the parser of --{} takes what the field does not",
            option.name
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

    /// The same with the values that ROS 2 has now.
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
        let table = P::table();
        let arguments = table
            .iter()
            .filter_map(|row| row.argument(&defaults, P::HEADING));
        command.args(arguments)
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
