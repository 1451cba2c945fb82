//! What `ros2` tools do, done by CycloneDDS for Python.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use crate::python::Python;

/// A running script, ended when this value is dropped.
pub struct RosTool {
    child: Child,
    output: BufReader<ChildStdout>,
    /// Lines that were passed over.
    kept: VecDeque<Value>,
    advice: String,
}

impl RosTool {
    /// Starts `ros_tools.py`; `None`, after a line that says so, where Python is missing.
    #[must_use]
    pub fn start(arguments: &[&str]) -> Option<Self> {
        Self::start_script("ros_tools.py", arguments)
    }

    /// Starts `action_client.py`, likewise.
    #[must_use]
    pub fn start_action_client(arguments: &[&str]) -> Option<Self> {
        Self::start_script("action_client.py", arguments)
    }

    /// Starts `observer.py` for a domain, likewise.
    #[must_use]
    pub fn start_observer(domain: &str, limit_s: &str) -> Option<Self> {
        Self::start_script("observer.py", &["cyclone", domain, limit_s])
    }

    /// Starts `late_joiner.py` for a domain, likewise.
    #[must_use]
    pub fn start_late_joiner(domain: &str) -> Option<Self> {
        Self::start_script("late_joiner.py", &["cyclone", domain])
    }

    fn start_script(name: &str, arguments: &[&str]) -> Option<Self> {
        let python = Python::find()?;
        let script = format!("tests/python/{name}");
        let child = python.start(&script, arguments, Stdio::inherit());
        Some(Self::of_child(child, &python.advice()))
    }

    /// Starts a command whose input and output are piped; `advice` says what to do if it fails.
    pub(crate) fn of(mut command: Command, advice: &str) -> Self {
        Self::of_child(command.spawn().unwrap(), advice)
    }

    fn of_child(mut child: Child, advice: &str) -> Self {
        let output = BufReader::new(child.stdout.take().unwrap());
        Self {
            child,
            output,
            kept: VecDeque::new(),
            advice: advice.to_owned(),
        }
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

    /// The next line that has `key`, be it one that was passed over before; others are kept.
    pub fn next_with(&mut self, key: &str) -> Value {
        if let Some(kept) = self.kept.iter().position(|line| !line[key].is_null()) {
            return self.kept.remove(kept).unwrap();
        }
        loop {
            let line = self.next_line();
            if !line[key].is_null() {
                return line;
            }
            self.kept.push_back(line);
        }
    }

    /// Writes one line to its standard input.
    pub fn write_line(&mut self, line: &Value) {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
    }

    /// Calls a service, of a type such as `std_srvs/srv/Trigger`, and waits for the answer. A name that does not begin
    /// with a slash is private to the node that the script was started with.
    pub fn call(&mut self, service: &str, type_name: &str, request: &Value) -> Value {
        self.write_line(&json!({"service": service, "type": type_name, "request": request}));
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
