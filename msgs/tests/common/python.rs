//! Runs `interfaces.py`, which reads the `.msg` files and CDR with another implementation.

use std::io::Write;
use std::process::Stdio;

use formation_tests::Python;

/// What the script answers; `None`, after a line that says so, where Python is missing.
pub fn ask(arguments: &[&str], input: &str) -> Option<String> {
    let python = Python::find()?;
    let mut child = python.start("msgs/tests/interfaces.py", arguments, Stdio::piped());
    let mut stdin = child.stdin.take();
    let output = std::thread::scope(|scope| {
        // A script that failed early reads nothing; the assertion below shows its error output.
        scope.spawn(move || {
            stdin
                .take()
                .map(|mut stdin| stdin.write_all(input.as_bytes()))
        });
        child.wait_with_output()
    })
    .unwrap();
    assert!(
        output.status.success(),
        "interfaces.py {} failed:\n{}\nif a Python package is missing, {}",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stderr),
        python.advice()
    );
    Some(String::from_utf8(output.stdout).unwrap())
}
