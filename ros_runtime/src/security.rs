//! Whether the messages of a process must be protected, as ROS 2 has it asked for.

use crate::environment::wrong;
use crate::words::Words;

/// Whether security is asked for.
const ENABLE: &str = "ROS_SECURITY_ENABLE";
/// Whether a process may go on without it.
const STRATEGY: &str = "ROS_SECURITY_STRATEGY";

/// Has a process refuse to start where its links would not be protected.
pub const ENFORCED: [(&str, &str); 2] = [(ENABLE, "true"), (STRATEGY, "Enforce")];

/// How a process treats links that are not protected. A link is protected if both sides show a certificate of the same
/// authority, and its content is encrypted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Security {
    /// Messages need no protection.
    #[default]
    Off,
    /// The process logs a warning and goes on without.
    Permissive,
    /// The process refuses to start without.
    Enforced,
}

/// The values of `ROS_SECURITY_STRATEGY`, of which [`Self::Off`] is none.
impl Words for Security {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("Permissive", Self::Permissive),
        ("Enforce", Self::Enforced),
    ];
}

impl Security {
    /// Reads `ROS_SECURITY_ENABLE` and `ROS_SECURITY_STRATEGY`, which is `Permissive` by default. ROS 2 takes every value but
    /// `true` and `Enforce` for an absent one; here another value than those that mean something is an error, so that a
    /// misspelled one does not switch security off.
    ///
    /// # Errors
    /// Names the variable that cannot be used, and why.
    pub fn resolve(variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let set = |name| variable(name).filter(|value| !value.trim().is_empty());
        let strategy = match set(STRATEGY) {
            Some(text) => Self::from_word(&text).map_err(|reason| wrong(STRATEGY, &reason))?,
            None => Self::Permissive,
        };
        match set(ENABLE).as_deref().map(str::trim) {
            None => Ok(Self::Off),
            Some(text) if text.eq_ignore_ascii_case("false") => Ok(Self::Off),
            Some(text) if text.eq_ignore_ascii_case("true") => Ok(strategy),
            Some(other) => Err(wrong(
                ENABLE,
                &format!("must be true or false, got `{other}`"),
            )),
        }
    }

    /// Decides about links that are not protected because of `shortfall`.
    ///
    /// # Errors
    /// Security is enforced; the error says what is missing.
    pub fn without(self, shortfall: &str) -> Result<(), String> {
        match self {
            Self::Off => Ok(()),
            Self::Permissive => {
                tracing::warn!("{ENABLE} is true, but messages are not protected: {shortfall}");
                Ok(())
            }
            Self::Enforced => Err(format!(
                "{STRATEGY}=Enforce demands protected messages, but {shortfall}"
            )),
        }
    }
}

/// Why messages over DDS are not protected.
pub const DDS_SHORTFALL: &str = "these programs have no security over DDS; use `--middleware zenoh` with the files that \
    `formation security create` makes";

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(enable: Option<&str>, strategy: Option<&str>) -> Result<Security, String> {
        Security::resolve(|name| match name {
            ENABLE => enable.map(str::to_owned),
            _ => strategy.map(str::to_owned),
        })
    }

    #[test]
    fn security_is_what_the_variables_of_ros_2_ask_for() {
        use Security::{Enforced, Off, Permissive};
        for (enable, strategy, security) in [
            (None, None, Off),
            (Some(""), Some("Enforce"), Off),
            (None, Some("Enforce"), Off),
            (Some("false"), Some("Enforce"), Off),
            (Some("true"), None, Permissive),
            (Some("true"), Some("Permissive"), Permissive),
            (Some("true"), Some("Enforce"), Enforced),
            (Some("TRUE"), Some("enforce"), Enforced),
        ] {
            assert_eq!(resolved(enable, strategy), Ok(security));
        }
    }

    #[test]
    fn a_misspelled_value_is_an_error_and_not_off() {
        let error = resolved(Some("yes"), None).unwrap_err();
        assert!(error.contains(ENABLE) && error.contains("`yes`"), "{error}");
        let error = resolved(Some("true"), Some("Enforced")).unwrap_err();
        assert!(
            error.contains(STRATEGY) && error.contains("`Enforced`"),
            "{error}"
        );
    }

    #[test]
    fn only_enforced_security_refuses() {
        assert_eq!(Security::Off.without("no"), Ok(()));
        assert_eq!(Security::Permissive.without("no"), Ok(()));
        let error = Security::Enforced.without(DDS_SHORTFALL).unwrap_err();
        assert!(error.contains("formation security create"), "{error}");
    }
}
