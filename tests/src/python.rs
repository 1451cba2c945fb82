//! The Python interpreter that has the packages that tests compare with.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;

use crate::programs::{root, target_directory};
use crate::tools::{Tool, on_path, report, tool_or_skip};

/// Ends with the reason if this interpreter is too old.
const IS_RECENT: &str = "import sys; \
    sys.version_info >= (3, 11) or sys.exit('Python 3.11 is needed, but python3 is ' + sys.version.split()[0])";

/// An interpreter that has the packages of `tests/requirements.txt`.
pub struct Python {
    path: PathBuf,
}

impl Python {
    /// The interpreter that `FORMATION_PYTHON` names, else one in an environment under the build's target directory, which
    /// this makes where it is missing or made for other requirements. `None`, after a line that says so, where Python is
    /// missing.
    ///
    /// # Panics
    /// When Python is missing and `FORMATION_REQUIRE_TOOLS` names it.
    #[must_use]
    pub fn find() -> Option<Self> {
        static FOUND: OnceLock<Result<PathBuf, String>> = OnceLock::new();
        let found = FOUND.get_or_init(|| match std::env::var("FORMATION_PYTHON") {
            // Cargo runs tests within their package, but people name a path as seen from the repository.
            Ok(named) if named.contains('/') => Ok(root().join(named)),
            Ok(named) if !named.is_empty() => Ok(named.into()),
            _ => environment(
                &target_directory().join("python"),
                &requirements(),
                IS_RECENT,
            ),
        });
        tool_or_skip(Tool::Python, found.clone()).map(|path| Self { path })
    }

    /// An interpreter that has the packages of `tests/zenoh_requirements.txt`, made like the other.
    ///
    /// # Panics
    /// When Python is missing and `FORMATION_REQUIRE_TOOLS` names it.
    #[must_use]
    pub fn with_zenoh() -> Option<Self> {
        let made = environment(
            &target_directory().join("zenoh_python"),
            &root().join("tests/zenoh_requirements.txt"),
            IS_RECENT,
        );
        tool_or_skip(Tool::Python, made).map(|path| Self { path })
    }

    /// An interpreter that has the packages of `python/requirements.txt`, made like the other.
    ///
    /// # Panics
    /// When Python is missing and `FORMATION_REQUIRE_TOOLS` names it.
    #[must_use]
    pub fn with_package() -> Option<Self> {
        let made = environment(
            &target_directory().join("python_package"),
            &root().join("python/requirements.txt"),
            IS_RECENT,
        );
        tool_or_skip(Tool::Python, made).map(|path| Self { path })
    }

    /// The interpreter.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A shell command that runs a script of the repository, named as seen from its root.
    #[must_use]
    pub fn command(&self, script: &str) -> String {
        let quoted = |path: &Path| format!("'{}'", path.display());
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
            "run `{} -m pip install -r {}`, or unset FORMATION_PYTHON",
            self.path.display(),
            requirements().display()
        )
    }
}

fn requirements() -> PathBuf {
    root().join("tests/requirements.txt")
}

/// The interpreter of this environment, which is made unless it is complete; a copy of the requirements is the sign that it
/// is. `is_suitable` is code that ends with the reason if the interpreter on the path is not. Test processes that need the
/// environment at the same time wait for the one that makes it.
pub(crate) fn environment(
    environment: &Path,
    requirements: &Path,
    is_suitable: &str,
) -> Result<PathBuf, String> {
    let _lock = locked(environment)?;
    let python = environment.join("bin/python");
    let complete = environment.join("requirements.txt");
    let wanted = fs::read(requirements).unwrap();
    if python.is_file() && fs::read(&complete).is_ok_and(|made| made == wanted) {
        return Ok(python);
    }
    let base = on_path(&["python3"])?;
    run(Command::new(&base).args(["-c", is_suitable]))?;
    report(&format!(
        "Installing the Python packages of {} into {}, which takes about a minute, once.",
        requirements.display(),
        environment.display()
    ));
    if environment.exists() {
        fs::remove_dir_all(environment).unwrap();
    }
    let venv = |options: &[&str]| {
        run(Command::new(&base)
            .args(["-m", "venv"])
            .args(options)
            .arg(environment))
    };
    let install = [
        "install",
        "--quiet",
        "--no-input",
        "--disable-pip-version-check",
        "-r",
    ];
    if venv(&[]).is_ok() {
        run(Command::new(&python)
            .args(["-m", "pip"])
            .args(install)
            .arg(requirements))?;
    } else {
        // Debian splits `ensurepip` off into python3-venv; a pip of its own will do as well.
        venv(&["--clear", "--without-pip"])?;
        run(Command::new(&base)
            .args(["-m", "pip", "--python"])
            .arg(&python)
            .args(install)
            .arg(requirements))
        .map_err(|error| format!("python3 has neither `ensurepip` nor a recent pip ({error})"))?;
    }
    fs::write(complete, wanted).unwrap();
    Ok(python)
}

/// A lock that processes hold while they make this folder.
pub(crate) fn locked(folder: &Path) -> Result<File, String> {
    let path = folder.with_extension("lock");
    File::create(&path)
        .and_then(|lock| lock.lock().map(|()| lock))
        .map_err(|error| format!("cannot lock {}: {error}", path.display()))
}

/// Runs a command to its end; where it fails, the last line of what it said.
pub(crate) fn run(command: &mut Command) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("cannot start {command:?}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty());
    Err(last.unwrap_or("it said nothing").trim().to_owned())
}
