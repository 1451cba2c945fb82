//! Type hashes of ROS 2 interfaces (RIHS01), computed from the text of their files.
//!
//! A publisher and a subscription match over Zenoh only if they name the same hash. REP 2011 defines it: the SHA-256 digest
//! of the description of a type and of all types that it refers to, as JSON. This module does no I/O.

mod description;
mod field;

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use description::{Description, described, full_description};

/// An interface: its name, such as `std_msgs/msg/Header`, and the text of its `.msg`, `.srv` or `.action` file.
pub type Interface = (&'static str, &'static str);

/// The standard interfaces that nodes use.
const STANDARD: &str = include_str!("standard_interfaces.txt");

/// The interfaces that a process knows.
#[derive(Clone, Debug)]
pub struct Interfaces(BTreeMap<String, Description>);

impl Interfaces {
    /// The standard interfaces, and `more`.
    ///
    /// # Errors
    /// Names the line that is no field of an interface.
    pub fn with(more: &[Interface]) -> Result<Self, String> {
        let standard = STANDARD.split("\n== ").skip(1).map(|section| {
            let (name, text) = section.split_once('\n').unwrap_or((section, ""));
            (name, text)
        });
        let mut descriptions = BTreeMap::new();
        for (name, text) in standard.chain(more.iter().copied()) {
            descriptions
                .extend(described(name, text).map_err(|reason| format!("{name}: {reason}"))?);
        }
        Ok(Self(descriptions))
    }

    /// The names of all types: those of services and actions include the types that ROS 2 derives from them.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// The hash of a type, such as `RIHS01_` and 64 hexadecimal digits.
    ///
    /// # Errors
    /// Names the type that is unknown: this one, or one that it refers to.
    pub fn hash(&self, name: &str) -> Result<String, String> {
        let text = full_description(&self.0, name)?;
        let digits = Sha256::digest(text.as_bytes())
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>();
        Ok(format!("RIHS01_{digits}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_that_the_packages_of_ros_2_publish() {
        let interfaces = Interfaces::with(&[("std_msgs/msg/String", "string data")]).unwrap();
        // The example of the design document of rmw_zenoh.
        assert_eq!(
            interfaces.hash("std_msgs/msg/String").unwrap(),
            "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
        );
    }

    #[test]
    fn comments_constants_and_defaults_do_not_count() {
        let hash = |text| {
            let interfaces = Interfaces::with(&[("a/msg/B", text)]).unwrap();
            interfaces.hash("a/msg/B").unwrap()
        };
        let plain = hash("uint8 kind\nstring<=8 name\nuint32[<=4] list");
        assert_eq!(
            hash(
                "# What it is.\nuint8 FIRST=1\nuint8 SECOND = 2\nuint8 kind 1 # one\n\nstring<=8 name \"a=b\"\nuint32[<=4] list []"
            ),
            plain
        );
        assert_ne!(hash("uint8 kind\nstring name\nuint32[<=4] list"), plain);
        assert_ne!(hash("uint8 kind\nstring<=8 name\nuint32[4] list"), plain);
    }

    #[test]
    fn what_is_no_interface_is_named() {
        let error = |text| Interfaces::with(&[("a/msg/B", text)]).unwrap_err();
        assert_eq!(error("uint8"), "a/msg/B: `uint8` has no name");
        assert!(error("uint8[x] list").contains("`uint8[x]`"));
        let interfaces = Interfaces::with(&[("a/msg/B", "C c")]).unwrap();
        assert!(interfaces.hash("a/msg/B").unwrap_err().contains("a/msg/C"));
        assert!(interfaces.hash("a/msg/D").is_err());
        assert!(Interfaces::with(&[("a/topic/B", "")]).is_err());
    }
}
