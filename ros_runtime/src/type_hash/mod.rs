//! Type hashes of ROS 2 interfaces (RIHS01), computed from the text of their files.
//!
//! A publisher and a subscription match over Zenoh only if they name the same hash. REP 2011 defines it: the SHA-256 digest
//! of the description of a type and of all types that it refers to, as JSON. This module does no I/O.

mod description;
mod field;

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use description::{Description, described, full_description, referred};

/// An interface: its name, such as `std_msgs/msg/Header`, and the text of its `.msg`, `.srv` or `.action` file.
pub type Interface = (&'static str, &'static str);

/// The standard interfaces that nodes use.
const STANDARD: &str = include_str!("standard_interfaces.txt");

/// What separates the definition of a message from those of the messages that it refers to.
const SEPARATOR: &str =
    "================================================================================";

/// The interfaces that a process knows.
#[derive(Clone, Debug)]
pub struct Interfaces {
    descriptions: BTreeMap<String, Description>,
    /// The text of each file, by the name of its interface.
    texts: BTreeMap<&'static str, &'static str>,
}

impl Interfaces {
    /// The standard interfaces, and `more`.
    ///
    /// # Errors
    /// Names the line that is no field of an interface.
    pub fn with(more: &[Interface]) -> Result<Self, String> {
        let standard = STANDARD.split("\n== ").skip(1);
        let standard = standard.map(|section| section.split_once('\n').unwrap_or((section, "")));
        let texts: BTreeMap<_, _> = standard.chain(more.iter().copied()).collect();
        let mut descriptions = BTreeMap::new();
        for (name, text) in &texts {
            descriptions
                .extend(described(name, text).map_err(|reason| format!("{name}: {reason}"))?);
        }
        Ok(Self {
            descriptions,
            texts,
        })
    }

    /// The names of all types: those of services and actions include the types that ROS 2 derives from them.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.descriptions.keys().map(String::as_str)
    }

    /// The hash of a type, such as `RIHS01_` and 64 hexadecimal digits.
    ///
    /// # Errors
    /// Names the type that is unknown: this one, or one that it refers to.
    pub fn hash(&self, name: &str) -> Result<String, String> {
        let text = full_description(&self.descriptions, name)?;
        let digits = Sha256::digest(text.as_bytes())
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>();
        Ok(format!("RIHS01_{digits}"))
    }

    /// The text of a message's file, followed by those of all messages that it refers to, as recordings hold it (the
    /// encoding `ros2msg` of MCAP).
    ///
    /// # Errors
    /// Names the message that is unknown: this one, or one that it refers to.
    pub fn definition(&self, name: &str) -> Result<String, String> {
        let text = |name: &str| {
            let text = self.texts.get(name).map(|text| text.trim());
            text.ok_or_else(|| format!("there is no message `{name}`"))
        };
        let mut definition = text(name)?.to_owned();
        for referred in referred(&self.descriptions, name)? {
            // Without the folder, as ROS 2 writes it.
            let short = referred.replace("/msg/", "/");
            let text = text(&referred)?;
            definition.push_str(&format!("\n{SEPARATOR}\nMSG: {short}\n{text}"));
        }
        definition.push('\n');
        Ok(definition)
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
    fn a_definition_is_followed_by_those_that_it_refers_to() {
        let more = &[
            ("a/msg/B", "# B.\nC[] list\nstd_msgs/Header header\n"),
            ("a/msg/C", "bool flag"),
        ];
        let interfaces = Interfaces::with(more).unwrap();
        let line = "=".repeat(80);
        let expected = format!(
            "# B.\nC[] list\nstd_msgs/Header header\n{line}\nMSG: a/C\nbool flag\n{line}\n\
             MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n{line}\nMSG: std_msgs/Header\n\
             builtin_interfaces/Time stamp\nstring frame_id\n"
        );
        assert_eq!(interfaces.definition("a/msg/B").unwrap(), expected);
        assert!(
            interfaces
                .definition("a/msg/D")
                .unwrap_err()
                .contains("a/msg/D")
        );
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
