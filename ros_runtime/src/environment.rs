//! The network of a process: its domain, its range of discovery and its namespace, as ROS 2 has them.

use std::fmt;
use std::str::FromStr;

use crate::arguments::Namespace;
use crate::middleware::RMW_ZENOH;
use crate::words::{Words, by_words};

/// The greatest domain whose ports fit into 16 bits.
pub const DOMAIN_MAX: u16 = 232;

/// A DDS domain; processes in different domains do not discover each other.
///
/// It is read as ROS 2 reads `ROS_DOMAIN_ID`, which is as `strtoul` does with base 0: decimal, hexadecimal after `0x`, or octal
/// after `0`. Unlike ROS 2, which reads `7x` as 7, it is refused where other characters follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Domain(u16);

impl Domain {
    /// The number of the domain.
    #[must_use]
    pub fn number(self) -> u16 {
        self.0
    }
}

impl FromStr for Domain {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let domain = number_in_any_base(text).and_then(|number| Self::try_from(number).ok());
        domain.ok_or_else(|| wrong_domain(&text))
    }
}

impl TryFrom<u16> for Domain {
    type Error = String;

    fn try_from(number: u16) -> Result<Self, String> {
        match number {
            0..=DOMAIN_MAX => Ok(Self(number)),
            _ => Err(wrong_domain(&number)),
        }
    }
}

/// A number as C writes it, with spaces around it and a plus before it.
fn number_in_any_base(text: &str) -> Option<u16> {
    let text = text.trim_matches(|symbol: char| symbol.is_ascii_whitespace() || symbol == '\u{b}');
    let text = text.strip_prefix('+').unwrap_or(text);
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let (digits, base) = match hexadecimal {
        Some(digits) => (digits, 16),
        None if text.starts_with('0') => (text, 8),
        None => (text, 10),
    };
    // A second sign would pass otherwise.
    let is_number = digits.chars().all(|digit| digit.is_digit(base));
    u16::from_str_radix(digits, base).ok().filter(|_| is_number)
}

fn wrong_domain(got: &dyn fmt::Display) -> String {
    format!("must be a whole number from 0 to {DOMAIN_MAX}, got `{got}`")
}

impl fmt::Display for Domain {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// How far a process looks for others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// No process, not even on the same machine.
    Off,
    /// This machine only, over the loopback interface.
    Localhost,
    /// Every machine that multicast reaches.
    #[default]
    Subnet,
    /// The default of the DDS library.
    SystemDefault,
}

impl Words for DiscoveryRange {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("OFF", Self::Off),
        ("LOCALHOST", Self::Localhost),
        ("SUBNET", Self::Subnet),
        ("SYSTEM_DEFAULT", Self::SystemDefault),
    ];
}

by_words!(DiscoveryRange);

/// The network of a process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Environment {
    /// Its domain.
    pub domain: Domain,
    /// How far it looks for others.
    pub range: DiscoveryRange,
    /// Whether `ROS_STATIC_PEERS` is set, which the DDS library has no use for.
    pub names_static_peers: bool,
    /// Whether `ROS_DISCOVERY_SERVER` is set, which the DDS library has no use for.
    pub names_discovery_server: bool,
}

impl Environment {
    /// Reads `ROS_DOMAIN_ID`, `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_LOCALHOST_ONLY`, where `given` does not decide.
    ///
    /// As in ROS 2, an enabled `ROS_LOCALHOST_ONLY` takes precedence over the discovery range, an empty variable counts as
    /// unset, and a variable that a command-line argument overrides is not read.
    ///
    /// # Errors
    /// Names the variable that cannot be used, and why.
    pub fn resolve(
        given: Overrides,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, String> {
        let set = |name| variable(name).filter(|value| !value.trim().is_empty());
        let domain = match given.domain {
            Some(domain) => domain,
            None => parsed("ROS_DOMAIN_ID", set("ROS_DOMAIN_ID"))?.unwrap_or_default(),
        };
        let range = match given.range {
            Some(range) => range,
            None if localhost_only(set(LOCALHOST_ONLY).as_deref())? => DiscoveryRange::Localhost,
            None => parsed(RANGE, set(RANGE))?.unwrap_or_default(),
        };
        Ok(Self {
            domain,
            range,
            names_static_peers: set(STATIC_PEERS).is_some(),
            names_discovery_server: set(DISCOVERY_SERVER).is_some(),
        })
    }

    /// What the environment asks for and DDS does not do here, a sentence each.
    pub fn without_effect_over_dds(&self) -> impl Iterator<Item = String> + use<> {
        let asked = [
            (self.names_static_peers, STATIC_PEERS),
            (self.names_discovery_server, DISCOVERY_SERVER),
        ];
        let asked = asked.into_iter().filter(|(is_set, _)| *is_set);
        asked.map(|(_, variable)| {
            format!(
                "{variable} has no effect: over DDS this program finds others by multicast alone; where that does not pass, \
                 use Zenoh with a router (RMW_IMPLEMENTATION={RMW_ZENOH})"
            )
        })
    }
}

/// Reads `ROS_NAMESPACE`, if it is set.
///
/// # Errors
/// Says what is wrong with its value.
pub fn namespace(variable: impl Fn(&str) -> Option<String>) -> Result<Option<Namespace>, String> {
    let value = variable(NAMESPACE).filter(|value| !value.trim().is_empty());
    parsed(NAMESPACE, value)
}

const NAMESPACE: &str = "ROS_NAMESPACE";
const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";
const DISCOVERY_SERVER: &str = "ROS_DISCOVERY_SERVER";

/// What the command line sets instead of the environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overrides {
    /// Instead of `ROS_DOMAIN_ID`.
    pub domain: Option<Domain>,
    /// Instead of `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_LOCALHOST_ONLY`.
    pub range: Option<DiscoveryRange>,
}

fn parsed<T: FromStr<Err = String>>(
    variable: &'static str,
    value: Option<String>,
) -> Result<Option<T>, String> {
    let parsed = value.map(|value| value.parse()).transpose();
    parsed.map_err(|reason: String| wrong(variable, &reason))
}

fn localhost_only(value: Option<&str>) -> Result<bool, String> {
    match value.map(str::trim) {
        None | Some("0") => Ok(false),
        Some("1") => Ok(true),
        Some(other) => Err(wrong(
            LOCALHOST_ONLY,
            &format!("must be 0 or 1, got `{other}`"),
        )),
    }
}

/// What is wrong with an environment variable.
pub(crate) fn wrong(variable: &str, reason: &str) -> String {
    format!("environment variable {variable}: {reason}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(
        given: Overrides,
        variables: &[(&str, &str)],
    ) -> Result<(u16, DiscoveryRange), String> {
        let variable = |name: &str| {
            variables
                .iter()
                .find(|(variable, _)| *variable == name)
                .map(|(_, value)| (*value).to_owned())
        };
        Environment::resolve(given, variable)
            .map(|environment| (environment.domain.number(), environment.range))
    }

    #[test]
    fn unset_or_empty_variables_leave_the_defaults_of_ros_2() {
        let default = Ok((0, DiscoveryRange::Subnet));
        assert_eq!(resolved(Overrides::default(), &[]), default);
        let empty = [("ROS_DOMAIN_ID", ""), (RANGE, " "), (LOCALHOST_ONLY, "")];
        assert_eq!(resolved(Overrides::default(), &empty), default);
    }

    #[test]
    fn what_is_asked_for_in_vain_is_named_with_what_works_instead() {
        let without_effect = |name: &str, value: &str| {
            let variable = |asked: &str| (asked == name).then(|| value.to_owned());
            let environment = Environment::resolve(Overrides::default(), variable).unwrap();
            environment.without_effect_over_dds().collect::<Vec<_>>()
        };
        for name in [STATIC_PEERS, DISCOVERY_SERVER] {
            let [said] = <[String; 1]>::try_from(without_effect(name, "10.2.0.2")).unwrap();
            assert!(said.starts_with(name) && said.contains(RMW_ZENOH), "{said}");
            assert_eq!(without_effect(name, " "), Vec::<String>::new());
        }
    }

    /// What `strtoul` with base 0 makes of them.
    #[test]
    fn domains_are_read_as_ros_2_reads_them() {
        for (text, number) in [
            ("0", 0),
            ("7", 7),
            ("232", 232),
            ("0x10", 16),
            ("0XE8", 232),
            ("010", 8),
            ("00", 0),
            ("0350", 232),
            (" \t7", 7),
            ("+0x7", 7),
            ("7 ", 7),
        ] {
            let domain = resolved(Overrides::default(), &[("ROS_DOMAIN_ID", text)]);
            assert_eq!(domain, Ok((number, DiscoveryRange::Subnet)), "{text}");
        }
        for text in [
            "0x", "08", "0b1", "0o7", "7x", "x7", "1 2", "1.0", "++7", "+-7", "0x+7", "1_0",
            "seven",
        ] {
            let refused = resolved(Overrides::default(), &[("ROS_DOMAIN_ID", text)]);
            let reason = format!("got `{text}`");
            assert!(refused.unwrap_err().contains(&reason), "{text}");
        }
    }

    #[test]
    fn localhost_only_takes_precedence_over_the_range() {
        let variables = [(RANGE, "SUBNET"), (LOCALHOST_ONLY, "1")];
        assert_eq!(
            resolved(Overrides::default(), &variables),
            Ok((0, DiscoveryRange::Localhost))
        );
        let variables = [
            (RANGE, "off"),
            (LOCALHOST_ONLY, "0"),
            ("ROS_DOMAIN_ID", "7"),
        ];
        assert_eq!(
            resolved(Overrides::default(), &variables),
            Ok((7, DiscoveryRange::Off))
        );
    }

    #[test]
    fn the_command_line_takes_precedence_over_the_environment_even_a_broken_one() {
        let given = Overrides {
            domain: Some(Domain(42)),
            range: Some(DiscoveryRange::Localhost),
        };
        let broken = [("ROS_DOMAIN_ID", "many"), (RANGE, "NEAR")];
        assert_eq!(
            resolved(given, &broken),
            Ok((42, DiscoveryRange::Localhost))
        );
    }

    #[test]
    fn namespaces_are_those_of_ros_2() {
        for good in ["/", "/fleet", "/robots/fleet_2/_a"] {
            assert_eq!(good.parse::<Namespace>().unwrap().as_str(), good);
        }
        for bad in ["", "fleet", "/fleet/", "//a", "/2a", "/a b", "/a__b", "~"] {
            assert!(bad.parse::<Namespace>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_namespace_is_that_of_the_environment_if_any() {
        let with = |value: Option<&str>| {
            namespace(|name| value.filter(|_| name == NAMESPACE).map(str::to_owned))
                .map(|namespace| namespace.map(|namespace| namespace.to_string()))
        };
        assert_eq!(with(None), Ok(None));
        assert_eq!(with(Some("")), Ok(None));
        assert_eq!(with(Some("/fleet")), Ok(Some("/fleet".to_owned())));
        assert!(with(Some("fleet")).unwrap_err().contains(NAMESPACE));
    }

    #[test]
    fn each_variable_that_cannot_be_used_is_named() {
        for (variable, value, reason) in [
            (
                "ROS_DOMAIN_ID",
                "233",
                "must be a whole number from 0 to 232, got `233`",
            ),
            (
                "ROS_DOMAIN_ID",
                "-1",
                "must be a whole number from 0 to 232, got `-1`",
            ),
            (
                "ROS_DOMAIN_ID",
                "08",
                "must be a whole number from 0 to 232, got `08`",
            ),
            (
                RANGE,
                "NEAR",
                "must be one of OFF, LOCALHOST, SUBNET, SYSTEM_DEFAULT, got `NEAR`",
            ),
            (LOCALHOST_ONLY, "yes", "must be 0 or 1, got `yes`"),
        ] {
            assert_eq!(
                resolved(Overrides::default(), &[(variable, value)]),
                Err(format!("environment variable {variable}: {reason}"))
            );
        }
    }
}
