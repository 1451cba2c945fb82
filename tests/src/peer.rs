//! CycloneDDS for Python: a DDS implementation that shares nothing with ours.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Stdio};

use serde_json::Value;

use crate::python::Python;

/// CycloneDDS for Python at work on one topic; it ends with its input, and at the latest with this value.
pub struct Peer {
    child: Child,
    output: BufReader<ChildStdout>,
    python: Python,
}

impl Peer {
    /// Starts `command` (`take`, `put` or `garble`) on a topic; `None`, said aloud, where the user chose to go without
    /// Python.
    #[must_use]
    pub fn start(command: &str, topic: &str, domain: &str) -> Option<Self> {
        Self::start_with(&[command, topic, "--domain", domain])
    }

    /// Takes samples of a topic of any type that ROS 2 knows, such as `tf2_msgs/msg/TFMessage`.
    #[must_use]
    pub fn take(topic: &str, type_name: &str, latched: bool, domain: &str) -> Option<Self> {
        let mut arguments = vec!["take", topic, "--type", type_name, "--domain", domain];
        arguments.extend(["--count", "0"]);
        arguments.extend(latched.then_some("--latched"));
        Self::start_with(&arguments)
    }

    fn start_with(arguments: &[&str]) -> Option<Self> {
        let python = Python::find("CycloneDDS was not talked to")?;
        let mut child = python.start("tests/python/formation_dds.py", arguments, Stdio::inherit());
        let output = BufReader::new(child.stdout.take().unwrap());
        Some(Self {
            child,
            output,
            python,
        })
    }

    /// Publishes one sample.
    pub fn put(&mut self, sample: &Value) {
        let input = self.child.stdin.as_mut().unwrap();
        writeln!(input, "{sample}")
            .unwrap_or_else(|error| panic!("{error}; {}", self.missing_package()));
    }

    /// Waits for the next sample that it took.
    pub fn taken(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert!(
            !line.is_empty(),
            "CycloneDDS took nothing; {}",
            self.missing_package()
        );
        serde_json::from_str(&line).unwrap()
    }

    fn missing_package(&self) -> String {
        format!(
            "if a Python package is missing, as is said above, {}",
            self.python.advice()
        )
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself, which leaves nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
