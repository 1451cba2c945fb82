//! What `ros2` tools do, done by CycloneDDS for Python.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdout, Stdio};

use serde_json::{Value, json};

use crate::python::Python;

const SCRIPT: &str = "tests/python/ros_tools.py";

/// The script at work; it is ended at the latest with this value.
pub struct RosTool {
    child: Child,
    output: BufReader<ChildStdout>,
    advice: String,
}

impl RosTool {
    /// Starts the script; `None`, said aloud, where the user chose to go without Python.
    #[must_use]
    pub fn start(arguments: &[&str]) -> Option<Self> {
        let python = Python::find("`ros2` tools were not stood in for")?;
        let mut child = python.start(SCRIPT, arguments, Stdio::inherit());
        let output = BufReader::new(child.stdout.take().unwrap());
        let advice = python.advice();
        Some(Self {
            child,
            output,
            advice,
        })
    }

    /// The next line that it prints.
    pub fn next_line(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert!(
            !line.is_empty(),
            "nothing came; if a Python package is missing, as is said above, {}",
            self.advice
        );
        serde_json::from_str(&line).unwrap()
    }

    /// Gives it a line.
    pub fn tell(&mut self, line: &Value) {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
    }

    /// Calls a service, of a type such as `std_srvs/srv/Trigger`, and waits for the answer. A name that does not begin
    /// with a slash is private to the node that the script was started with.
    pub fn call(&mut self, service: &str, type_name: &str, request: &Value) -> Value {
        self.tell(&json!({"service": service, "type": type_name, "request": request}));
        self.next_line()
    }

    /// Everything that it prints until its end, which must be a good one.
    pub fn finish(mut self) -> String {
        drop(self.child.stdin.take());
        let mut text = String::new();
        self.output.read_to_string(&mut text).unwrap();
        assert!(self.child.wait().unwrap().success(), "{}", self.advice);
        text
    }
}

impl Drop for RosTool {
    fn drop(&mut self) {
        // It may have ended by itself, which leaves nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
