//! The status of a node, for `/diagnostics`, where aggregators and monitors look for it.

use serde::{Deserialize, Serialize};

use crate::stamp::Header;

/// How urgent a status is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum DiagnosticLevel {
    /// Nothing is wrong.
    Ok = 0,
    /// Worth a look.
    Warning = 1,
    /// A person has to act.
    Error = 2,
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct KeyValue {
    pub key: String,
    pub value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct DiagnosticStatus {
    pub level: u8,
    pub name: String,
    pub message: String,
    pub hardware_id: String,
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct DiagnosticArray {
    pub header: Header,
    pub status: Vec<DiagnosticStatus>,
}

/// The status of one part of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The part, such as `module 4`.
    pub part: String,
    /// The hardware that it stands for, if any.
    pub hardware_id: String,
    /// How urgent the status is.
    pub level: DiagnosticLevel,
    /// The status in a few words.
    pub message: String,
    /// Figures with their names.
    pub values: Vec<(String, String)>,
}

impl Report {
    pub(crate) fn into_status(self, node: &str) -> DiagnosticStatus {
        let values = self.values.into_iter();
        DiagnosticStatus {
            level: self.level as u8,
            name: format!("{node}: {}", self.part),
            message: self.message,
            hardware_id: self.hardware_id,
            values: values.map(|(key, value)| KeyValue { key, value }).collect(),
        }
    }
}
