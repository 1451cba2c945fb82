//! CycloneDDS for Python: a DDS implementation that shares nothing with ours.

use std::cell::Cell;
use std::io::Write;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::python::Python;
use crate::transcript::{Line, Transcript};

/// A peer that waits longer than this for a sample waits for nothing.
const PATIENCE: Duration = Duration::from_secs(60);

/// CycloneDDS for Python at work on one topic; it ends with its input, and at the latest with this value.
pub struct Peer {
    child: Child,
    output: Transcript,
    /// How many samples were looked at.
    taken: Cell<usize>,
    python: Python,
}

impl Peer {
    /// Starts `command` (`take`, `put` or `garble`) on a topic; `None`, after a line that says so, where Python is missing.
    #[must_use]
    pub fn start(command: &str, topic: &str, domain: &str) -> Option<Self> {
        let mut arguments = vec![command, topic, "--domain", domain];
        if command == "take" {
            arguments.extend(["--count", "0", "--timeout", "3600"]);
        }
        Self::start_with(&arguments)
    }

    /// Takes samples of a topic of any type that ROS 2 knows, such as `tf2_msgs/msg/TFMessage`.
    #[must_use]
    pub fn take(topic: &str, type_name: &str, latched: bool, domain: &str) -> Option<Self> {
        let mut arguments = vec!["take", topic, "--type", type_name, "--domain", domain];
        arguments.extend(["--count", "0"]);
        arguments.extend(latched.then_some("--latched"));
        Self::start_with(&arguments)
    }

    /// Takes samples of a topic whose publishers may be best effort.
    #[must_use]
    pub fn take_best_effort(topic: &str, type_name: &str, domain: &str) -> Option<Self> {
        let arguments = ["take", topic, "--type", type_name, "--domain", domain];
        let more = ["--count", "0", "--best-effort"];
        Self::start_with(&[&arguments[..], &more].concat())
    }

    /// Publishes samples on a topic of any type that ROS 2 knows.
    #[must_use]
    pub fn publish(topic: &str, type_name: &str, domain: &str) -> Option<Self> {
        Self::start_with(&["put", topic, "--type", type_name, "--domain", domain])
    }

    fn start_with(arguments: &[&str]) -> Option<Self> {
        let python = Python::find()?;
        let mut child = python.start("tests/python/formation_dds.py", arguments, Stdio::inherit());
        let output = Transcript::of(child.stdout.take().unwrap());
        Some(Self {
            child,
            output,
            taken: Cell::new(0),
            python,
        })
    }

    /// Waits until it is in the domain, if it was started to publish.
    pub fn await_ready(&self) {
        let ready = self.output.wait_for(0, PATIENCE, |_| Some(()));
        assert!(
            ready.is_some(),
            "CycloneDDS did not start; {}",
            self.missing_package()
        );
    }

    /// Publishes one sample.
    pub fn put(&mut self, sample: &Value) {
        let input = self.child.stdin.as_mut().unwrap();
        writeln!(input, "{sample}")
            .unwrap_or_else(|error| panic!("{error}; {}", self.missing_package()));
    }

    /// Waits for a sample that comes from now on.
    #[must_use]
    pub fn next_taken(&self) -> Value {
        self.taken.set(self.output.len());
        self.taken()
    }

    /// Waits for the next sample that it took.
    #[must_use]
    pub fn taken(&self) -> Value {
        let next = self.taken.get();
        let text = self
            .output
            .wait_for(next, PATIENCE, |line| Some(line.text.clone()));
        let text = text.unwrap_or_else(|| {
            panic!("CycloneDDS took nothing; {}", self.missing_package());
        });
        self.taken.set(next + 1);
        serde_json::from_str(&text).unwrap()
    }

    /// Waits for `count` more samples than it has taken so far.
    pub fn await_more(&self, count: usize) {
        let mut left = count;
        let came = self.output.wait_for(self.output.len(), PATIENCE, |_| {
            left -= 1;
            (left == 0).then_some(())
        });
        assert!(
            came.is_some(),
            "{left} of {count} samples did not come; {}",
            self.missing_package()
        );
    }

    /// Every pose of a module among the samples of `module_states` so far, and when it came.
    #[must_use]
    pub fn poses_of(&self, module: u32) -> Vec<(Instant, (f64, f64))> {
        let samples = self.output.since(0);
        let poses = samples.iter().filter_map(|line| pose_in(line, module));
        poses.collect()
    }

    /// Waits for a state of a module among the samples of `module_states`, for which this holds together with when it came.
    #[track_caller]
    pub fn await_state_of(&self, module: u32, is_it: impl Fn(Instant, &Value) -> bool) {
        let came = self.output.wait_for(0, PATIENCE, |line| {
            state_in(line, module).filter(|state| is_it(line.at, state))
        });
        assert!(
            came.is_some(),
            "no such state of module {module} came by {:?}; those that came: {:?}; {} samples in all, the last at {:?}; {}",
            Instant::now(),
            self.poses_of(module),
            self.output.len(),
            self.output.since(0).last().map(|line| line.at),
            self.missing_package()
        );
    }

    fn missing_package(&self) -> String {
        format!(
            "if a Python package is missing, as is said above, {}",
            self.python.advice()
        )
    }
}

/// The state of a module in a sample of `module_states`.
fn state_in(line: &Line, module: u32) -> Option<Value> {
    let sample: Value = serde_json::from_str(&line.text).unwrap();
    let mut states = sample["modules"].as_array()?.iter();
    states.find(|state| state["module_id"] == module).cloned()
}

/// The pose of a module in a sample of `module_states`, and when it came.
fn pose_in(line: &Line, module: u32) -> Option<(Instant, (f64, f64))> {
    let state = state_in(line, module)?;
    let coordinate = |name: &str| state[name].as_f64().unwrap();
    Some((line.at, (coordinate("x"), coordinate("y"))))
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself, which leaves nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
