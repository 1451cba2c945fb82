//! Runs the tests that are written in Python, and the notebooks; builds a wheel, and has each Python import it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use formation_tests::{Python, program, root};
use tempfile::TempDir;

/// Where cargo put the extension module of this build.
fn native() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let built = test.parent().unwrap().join("libformation_native.so");
    assert!(built.is_file(), "{} is missing", built.display());
    built
}

/// The package as it is installed, in a folder that can be on the path of Python.
pub fn assembled() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("formation");
    fs::create_dir(&package).unwrap();
    for file in fs::read_dir(root().join("python/formation")).unwrap() {
        let path = file.unwrap().path();
        let kind = path.extension().unwrap_or_default();
        if ["py", "pyi", "typed"].iter().any(|known| kind == *known) {
            fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    fs::copy(native(), package.join("_native.abi3.so")).unwrap();
    folder
}

/// Runs a Python with the package, in the root of the repository; returns what it printed.
pub fn ran(python: &Path, package: &Path, arguments: &[&str]) -> String {
    let output = Command::new(python)
        .args(arguments)
        .current_dir(root())
        .env("PYTHONPATH", package)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("FORMATION_PROGRAM", program("formation"))
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let logged = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{arguments:?}: {printed}\n{logged}"
    );
    printed
}

#[test]
fn the_tests_in_python_pass() {
    let Some(python) = Python::with_package() else {
        return;
    };
    let package = assembled();
    let options = [
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "python/tests",
    ];
    let printed = ran(python.path(), package.path(), &options);
    assert!(printed.contains(" passed"), "{printed}");
}

#[test]
fn the_notebooks_run() {
    let Some(python) = Python::with_package() else {
        return;
    };
    let package = assembled();
    let printed = ran(
        python.path(),
        package.path(),
        &["python/tests/run_notebooks.py"],
    );
    assert!(printed.lines().count() >= 4, "{printed}");
}

/// Each Python of the machine, from 3.9 on, that is not just a name for another one.
fn interpreters() -> Vec<PathBuf> {
    let named = (9..=15).map(|minor| PathBuf::from(format!("python3.{minor}")));
    let others = std::env::var_os("FORMATION_PYTHONS").unwrap_or_default();
    let others: Vec<PathBuf> = std::env::split_paths(&others).collect();
    let mut found: Vec<PathBuf> = Vec::new();
    let mut versions = Vec::new();
    for python in others.into_iter().chain(named) {
        let asked = Command::new(&python)
            .args(["-c", "import sys; print(sys.version.split()[0])"])
            .output();
        let Ok(version) = asked else { continue };
        if version.status.success() && !versions.contains(&version.stdout) {
            versions.push(version.stdout);
            found.push(python);
        }
    }
    found
}

#[test]
fn each_python_of_the_machine_imports_the_wheel() {
    let Some(python) = Python::with_package() else {
        return;
    };
    let (package, out) = (assembled(), tempfile::tempdir().unwrap());
    let installed = out.path().join("installed");
    let [from, to, target] =
        [package.path(), out.path(), &installed].map(|path| path.to_str().unwrap());
    let nothing = tempfile::tempdir().unwrap();
    let packed = ran(
        python.path(),
        nothing.path(),
        &["python/tests/wheel.py", from, to],
    );
    assert!(packed.trim_end().contains("-cp39-abi3-linux_"), "{packed}");
    let wheel = out.path().join(packed.trim_end());
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--target",
        target,
    ];
    let arguments = [&pip[..], &[wheel.to_str().unwrap()]].concat();
    ran(python.path(), nothing.path(), &arguments);
    let plan = "import formation, sys; s = formation.Scenario.generate(12, 12, seed=1, mixed=True); \
                print(len(formation.plan(s).assignments), sys.version.split()[0])";
    for python in interpreters() {
        let printed = ran(&python, &installed, &["-c", plan]);
        assert!(
            printed.starts_with("12 "),
            "{}: {printed}",
            python.display()
        );
        println!("{}: {printed}", python.display());
    }
}
