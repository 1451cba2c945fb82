//! The Python interpreter that has the parties that we did not write.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use crate::programs::root;

/// An interpreter, and what to do where it will not serve.
pub struct Python {
    path: PathBuf,
}

impl Python {
    /// The interpreter named in `FORMATION_PYTHON`, else `python3`; `None`, said aloud with `skipped`, where the user
    /// chose to go without.
    #[must_use]
    pub fn find(skipped: &str) -> Option<Self> {
        if std::env::var_os("FORMATION_SKIP_PYTHON").is_some_and(|value| value == "1") {
            // Not by a macro: the test harness would keep it to itself.
            let mut stderr = std::io::stderr();
            writeln!(stderr, "SKIPPED: FORMATION_SKIP_PYTHON=1, so {skipped}").unwrap();
            return None;
        }
        let named = std::env::var("FORMATION_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        // Cargo runs tests within their package, but people name a path as seen from the repository.
        let path = if named.contains('/') {
            root().join(named)
        } else {
            named.into()
        };
        Some(Self { path })
    }

    /// A shell command that runs a script of the repository, named as seen from its root.
    #[must_use]
    pub fn command(&self, script: &str) -> String {
        let quoted = |path: &std::path::Path| format!("'{}'", path.display());
        format!("{} {}", quoted(&self.path), quoted(&root().join(script)))
    }

    /// Starts a script of the repository, named as seen from its root, with input and output piped.
    #[must_use]
    pub fn start(&self, script: &str, arguments: &[&str], stderr: Stdio) -> Child {
        Command::new(&self.path)
            .arg(root().join(script))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(stderr)
            .spawn()
            .unwrap_or_else(|error| {
                panic!(
                    "cannot start `{}`: {error}; {}",
                    self.path.display(),
                    self.advice()
                )
            })
    }

    /// What to do when a package is missing.
    #[must_use]
    pub fn advice(&self) -> String {
        format!(
            "run `{} -m pip install -r {}`, name another interpreter (3.10 or later) in FORMATION_PYTHON, or set \
             FORMATION_SKIP_PYTHON=1 to go without this test",
            self.path.display(),
            root().join("tests/requirements.txt").display()
        )
    }
}
