//! Talks to `interfaces.py`, which reads the `.msg` files and CDR with a library that we did not write.

use std::io::Write;
use std::process::{Command, Stdio};

/// What the script answers; `None`, said aloud, where the user chose to go without Python.
pub fn ask(arguments: &[&str], input: &str) -> Option<String> {
    if std::env::var_os("FORMATION_SKIP_PYTHON").is_some_and(|value| value == "1") {
        // Not by a macro: the test harness would keep it to itself.
        let mut stderr = std::io::stderr();
        writeln!(
            stderr,
            "SKIPPED: FORMATION_SKIP_PYTHON=1, so the .msg files were not compared with rosbags"
        )
        .unwrap();
        return None;
    }
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .display();
    let mut python = std::env::var("FORMATION_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    // Cargo runs tests within their package, but people name a path as seen from the repository.
    if python.contains('/') && !python.starts_with('/') {
        python = format!("{root}/{python}");
    }
    let advice = format!(
        "run `{python} -m pip install -r {root}/tests/requirements.txt`, name another interpreter (3.10 or later) in \
         FORMATION_PYTHON, or set FORMATION_SKIP_PYTHON=1 to go without this test"
    );
    let mut child = Command::new(&python)
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/interfaces.py"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("cannot start `{python}`: {error}; {advice}"));
    let mut stdin = child.stdin.take();
    let output = std::thread::scope(|scope| {
        // A script that failed early reads nothing; what it says then is told below.
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
        "interfaces.py {} failed:\n{}\nif a Python package is missing, {advice}",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stderr)
    );
    Some(String::from_utf8(output.stdout).unwrap())
}
