//! Which middleware carries the messages of a process.

use crate::words::{Words, by_words};

/// The middleware that carries the messages of a process. Processes with different ones do not discover each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Middleware {
    /// DDS, as most middlewares of ROS 2 use it.
    #[default]
    Dds,
    /// Zenoh, as `rmw_zenoh_cpp` uses it.
    Zenoh,
}

/// The name of the middleware of ROS 2 that uses Zenoh.
pub const RMW_ZENOH: &str = "rmw_zenoh_cpp";

/// What to do when this program was built without Zenoh.
pub const NOT_BUILT: &str = "this program was built without Zenoh; `cargo build --release --workspace --features zenoh` \
    includes it";

impl Middleware {
    /// Whether this program was built with Zenoh.
    pub const HAS_ZENOH: bool = cfg!(feature = "zenoh");

    /// The one that an argument names, or else that of the middleware of ROS 2 with this name; DDS if neither names one.
    #[must_use]
    pub fn choose(given: Option<Self>, implementation: Option<&str>) -> Self {
        given.unwrap_or_else(|| match implementation.map(str::trim) {
            Some(RMW_ZENOH) => Self::Zenoh,
            _ => Self::Dds,
        })
    }

    /// Refuses a middleware that this program was built without.
    ///
    /// # Errors
    /// Names the command that builds it.
    pub fn check(self) -> Result<Self, String> {
        if self == Self::Zenoh && !Self::HAS_ZENOH {
            return Err(NOT_BUILT.to_owned());
        }
        Ok(self)
    }
}

impl Words for Middleware {
    const WORDS: &'static [(&'static str, Self)] = &[("dds", Self::Dds), ("zenoh", Self::Zenoh)];
}

by_words!(Middleware);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_argument_takes_precedence_over_the_variable() {
        use Middleware::{Dds, Zenoh};
        for (given, implementation, chosen) in [
            (None, None, Dds),
            (None, Some("rmw_zenoh_cpp"), Zenoh),
            (None, Some("rmw_fastrtps_cpp"), Dds),
            (Some(Dds), Some("rmw_zenoh_cpp"), Dds),
            (Some(Zenoh), Some("rmw_cyclonedds_cpp"), Zenoh),
        ] {
            assert_eq!(Middleware::choose(given, implementation), chosen);
        }
        assert_eq!("Zenoh".parse(), Ok(Zenoh));
        assert_eq!(Zenoh.check().is_ok(), Middleware::HAS_ZENOH);
    }
}
