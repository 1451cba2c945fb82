//! CycloneDDS for Python: a DDS implementation that shares nothing with ours.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::Value;

use crate::programs::root;

/// CycloneDDS for Python at work on one topic; it ends with its input, and at the latest with this value.
pub struct Peer {
    child: Child,
    output: BufReader<ChildStdout>,
    advice: String,
}

impl Peer {
    /// Starts `command` (`take`, `put` or `garble`) on a topic; `None`, said aloud, where the user chose to go without
    /// Python.
    #[must_use]
    pub fn start(command: &str, topic: &str, domain: &str) -> Option<Self> {
        if std::env::var_os("FORMATION_SKIP_PYTHON").is_some_and(|value| value == "1") {
            // Not by a macro: the test harness would keep it to itself.
            let told = "SKIPPED: FORMATION_SKIP_PYTHON=1, so CycloneDDS was not talked to";
            let mut stderr = std::io::stderr();
            writeln!(stderr, "{told}").unwrap();
            return None;
        }
        let root = root();
        let mut python = std::env::var("FORMATION_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        // Cargo runs tests within their package, but people name a path as seen from the repository.
        if python.contains('/') && !python.starts_with('/') {
            python = root.join(&python).display().to_string();
        }
        let advice = format!(
            "run `{python} -m pip install -r {}`, name another interpreter in FORMATION_PYTHON, or set \
             FORMATION_SKIP_PYTHON=1 to go without this test",
            root.join("tests/requirements.txt").display()
        );
        let mut child = Command::new(&python)
            .arg(root.join("tests/python/formation_dds.py"))
            .args([command, topic, "--domain", domain])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start `{python}`: {error}; {advice}"));
        let output = BufReader::new(child.stdout.take().unwrap());
        Some(Self {
            child,
            output,
            advice,
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
            self.advice
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
