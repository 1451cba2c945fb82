//! Tools that some tests need and that not every machine has.

use std::env;
use std::ffi::OsStr;
use std::io::Write;
use std::path::PathBuf;
use std::thread;

/// Which tools must be present: `1` for all of them, or names from [`Tool::name`] separated by commas.
const REQUIRED: &str = "FORMATION_REQUIRE_TOOLS";

/// Something that a test needs beyond Rust and a C linker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// Python with the packages of `tests/requirements.txt`.
    Python,
    /// rclpy over Fast DDS, from wheels, and a C++ compiler for our interface package.
    Rclpy,
    /// Wireshark's dissector on the command line.
    Tshark,
    /// Chromium and its WebDriver.
    Browser,
    /// The tools by which Debian packages are built.
    Debian,
    /// The peer in `tests/hiroz_peer`.
    Hiroz,
    /// The right to create network namespaces, and `ip` to connect them.
    Namespaces,
}

impl Tool {
    fn name(self) -> &'static str {
        match self {
            Self::Python => "python",
            Self::Rclpy => "rclpy",
            Self::Tshark => "tshark",
            Self::Browser => "browser",
            Self::Debian => "debian",
            Self::Hiroz => "hiroz",
            Self::Namespaces => "namespaces",
        }
    }

    /// How to have it.
    fn advice(self) -> &'static str {
        match self {
            Self::Python => {
                "install Python 3.11 or later with venv and pip (Debian, Ubuntu: `apt-get install python3-venv`), or set \
                 FORMATION_PYTHON to an interpreter that has the packages of tests/requirements.txt"
            }
            Self::Rclpy => {
                "its wheels need Python 3.11 as `python3`, with venv and pip, on x86-64; and a C++ compiler (Debian, Ubuntu: \
                 `apt-get install g++`)"
            }
            Self::Tshark => "install it (Debian, Ubuntu: `apt-get install tshark`)",
            Self::Browser => {
                "install it (Debian, Ubuntu: `apt-get install chromium chromium-driver`)"
            }
            Self::Debian => "install them (Debian, Ubuntu: `apt-get install dpkg-dev binutils`)",
            Self::Hiroz => {
                "build it: `cargo build --locked --manifest-path tests/hiroz_peer/Cargo.toml`"
            }
            Self::Namespaces => {
                "run the tests as root or allow user namespaces, with `unshare`, `nsenter` and `ip` installed \
                 (Debian, Ubuntu: `apt-get install util-linux iproute2`)"
            }
        }
    }

    fn is_required(self) -> bool {
        let required = env::var(REQUIRED).unwrap_or_default();
        let mut names = required.split(',').map(str::trim);
        names.any(|name| name == "1" || name == self.name())
    }
}

/// What was found of a tool. Where it is missing, writes one line that names the calling test, what is missing and how to
/// have it, and returns `None`: the test is to return.
///
/// # Panics
/// When the tool is missing and `FORMATION_REQUIRE_TOOLS` names it.
pub fn tool_or_skip<T>(tool: Tool, found: Result<T, String>) -> Option<T> {
    let missing = match found {
        Ok(found) => return Some(found),
        Err(missing) => missing,
    };
    let advice = tool.advice();
    assert!(
        !tool.is_required(),
        "{missing}, but {REQUIRED} is set; {advice}"
    );
    let thread = thread::current();
    // The test harness names each test's thread after the test, unless it runs them on its own.
    let test = thread.name().filter(|name| *name != "main");
    let test = test.map_or_else(|| env::args().next().unwrap_or_default(), str::to_owned);
    report(&format!("SKIPPED {test}: {missing}; {advice}"));
    None
}

/// Writes a line to the standard error even if the test passes, when the test harness hides what macros write.
pub fn report(line: &str) {
    let mut stderr = std::io::stderr();
    writeln!(stderr, "{line}").unwrap();
}

/// Where a program is that may have any of these names. The folders of system programs count as well, which Debian leaves
/// out of most users' paths.
///
/// # Errors
/// A sentence that names the first of them as missing.
pub fn on_path(names: &[&str]) -> Result<PathBuf, String> {
    let mut path = env::var_os("PATH").unwrap_or_default();
    path.push(":/usr/sbin:/sbin");
    find_in(&path, names).ok_or_else(|| format!("`{}` is missing", names[0]))
}

fn find_in(path: &OsStr, names: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = env::split_paths(path).collect();
    let mut places = names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    places.find(|place| place.is_file())
}
