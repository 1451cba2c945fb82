//! How a node is doing, for `/diagnostics`, where aggregators and monitors look for it.

use serde::{Deserialize, Serialize};

use crate::stamp::Header;
use crate::traffic::Traffic;

/// How much a person should care.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum DiagnosticLevel {
    /// All is well.
    Ok = 0,
    /// Worth a look.
    Warning = 1,
    /// Something has to be mended.
    Error = 2,
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What is counted or shown.
    pub key: String,
    /// What it is now.
    pub value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// See [`DiagnosticLevel`].
    pub level: u8,
    /// Of what this is the status: the node and a part of it.
    pub name: String,
    /// How it is doing, in a few words.
    pub message: String,
    /// The hardware.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When it was so.
    pub header: Header,
    /// One for each part of the node.
    pub status: Vec<DiagnosticStatus>,
}

/// A part of a node, and how it is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The part, such as `module 4`.
    pub part: String,
    /// The hardware that it stands for, if any.
    pub hardware_id: String,
    /// How much a person should care.
    pub level: DiagnosticLevel,
    /// How it is doing, in a few words.
    pub message: String,
    /// The figures.
    pub values: Vec<(String, String)>,
}

impl Report {
    /// The report as a status of `node`.
    pub fn into_status(self, node: &str) -> DiagnosticStatus {
        DiagnosticStatus {
            level: self.level as u8,
            name: format!("{node}: {}", self.part),
            message: self.message,
            hardware_id: self.hardware_id,
            values: self
                .values
                .into_iter()
                .map(|(key, value)| KeyValue { key, value })
                .collect(),
        }
    }
}

/// What a process sent, received and refused, by topic.
pub fn traffic_report(traffic: &Traffic) -> Report {
    let mut values = Vec::new();
    let (mut lost, mut refused) = (0, 0);
    for (topic, counts) in traffic.topics() {
        let mut add = |what: &str, count: u64| {
            values.push((format!("{topic}.{what}"), count.to_string()));
        };
        add("sent", counts.sent);
        add("received", counts.received);
        for (kind, count) in &counts.refused {
            add(&format!("refused.{kind}"), *count);
            refused += count;
        }
        if counts.delayed > 0 {
            add("delayed", counts.delayed);
        }
        if counts.superseded > 0 {
            add("superseded", counts.superseded);
        }
        if counts.lost > 0 {
            add("lost", counts.lost);
            lost += counts.lost;
        }
    }
    let (level, message) = match (lost, refused) {
        (0, 0) => (DiagnosticLevel::Ok, "samples come and go".to_owned()),
        (0, refused) => (
            DiagnosticLevel::Warning,
            format!("{refused} samples were malformed or contradicted themselves"),
        ),
        (lost, _) => (
            DiagnosticLevel::Error,
            format!("{lost} samples could not be sent"),
        ),
    };
    Report {
        part: "traffic".to_owned(),
        hardware_id: String::new(),
        level,
        message,
        values,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::RefusalKind;

    #[test]
    fn what_is_lost_is_worse_than_what_is_refused() {
        let mut traffic = Traffic::default();
        traffic.on("claims").sent += 2;
        assert_eq!(traffic_report(&traffic).level, DiagnosticLevel::Ok);
        traffic.refuse("claims", RefusalKind::Malformed, &"no");
        let report = traffic_report(&traffic);
        assert_eq!(report.level, DiagnosticLevel::Warning);
        let refused = ("claims.refused.malformed".to_owned(), "1".to_owned());
        assert!(report.values.contains(&refused), "{:?}", report.values);
        traffic.lose("claims", &"gone");
        let status = traffic_report(&traffic).into_status("/formation/module_4");
        assert_eq!(
            (status.level, status.name.as_str()),
            (2, "/formation/module_4: traffic")
        );
    }
}
