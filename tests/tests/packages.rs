//! What packages hold: the Debian package, completions, versions, and the schema of scenario files.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use formation_tests::{
    Domain, Finished, Python, Running, Tool, on_path, program, root, scenario_path, tool_or_skip,
};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(90);

/// Every program, with an option that only it has.
const PROGRAMS: [(&str, &str); 8] = [
    ("formation", "--modules-per-process"),
    ("leader_agent", "--pose-interval-s"),
    ("module_agent", "--modules"),
    ("recorder", "--discovery-range"),
    ("target_publisher", "--scenario-folder"),
    ("verifier", "--keep-watching"),
    ("visualiser", "--no-labels"),
    ("world", "--slip"),
];

fn output(command: &mut Command) -> String {
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_program_prints_its_version_and_its_completions() {
    for (name, option) in PROGRAMS {
        let version = output(Command::new(program(name)).arg("--version"));
        let expected = format!("{name} {}", env!("CARGO_PKG_VERSION"));
        assert!(version.starts_with(&expected), "{version}");
        let arguments = match name {
            "formation" => ["completions", "bash"],
            _ => ["--completions", "bash"],
        };
        let script = output(Command::new(program(name)).args(arguments));
        assert!(script.contains(option), "{name}: {script}");
        let checked = Command::new("bash")
            .args(["-n", "-c", &script])
            .status()
            .unwrap();
        assert!(checked.success(), "{name}");
        let refused = Command::new(program(name))
            .args([arguments[0], "tcsh"])
            .output()
            .unwrap();
        assert_eq!(refused.status.code(), Some(2), "{name}");
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(
            said,
            "error: `tcsh` is none of bash, elvish, fish, powershell, zsh\n"
        );
    }
}

#[test]
fn the_schema_accepts_the_scenarios_and_refuses_others() {
    let Some(python) = Python::find() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let wrong = [
        ("no_target", "name: x"),
        ("unknown_field", "target: {map: o, colour: red}"),
        (
            "text_for_number",
            "target: {spots: [{id: 1, x: left, y: 0}]}",
        ),
    ];
    let wrong = wrong.map(|(name, text)| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path
    });
    let shipped = fs::read_dir(root().join("launch_scripts/scenarios")).unwrap();
    let shipped = shipped.map(|entry| entry.unwrap().path());
    let shipped: Vec<PathBuf> = shipped.filter(|path| path.is_file()).collect();
    assert!(shipped.len() >= 5);
    let paths: Vec<&str> = shipped
        .iter()
        .chain(&wrong)
        .map(|path| path.to_str().unwrap())
        .collect();
    let script = "tests/python/validate_scenarios.py";
    let mut validator = python.start(script, &paths, Stdio::inherit());
    let schema = output(Command::new(program("formation")).arg("schema"));
    let mut input = validator.stdin.take().unwrap();
    input.write_all(schema.as_bytes()).unwrap();
    drop(input);
    let found = validator.wait_with_output().unwrap();
    assert!(found.status.success(), "{}", python.advice());
    let found: BTreeMap<PathBuf, Vec<String>> = serde_json::from_slice(&found.stdout).unwrap();
    for path in &shipped {
        assert_eq!(found[path], Vec::<String>::new(), "{}", path.display());
    }
    for path in &wrong {
        assert!(!found[path].is_empty(), "{}", path.display());
    }
}

/// Builds the package of the programs of this build, and unpacks it; `None`, after a line that says so, without dpkg.
fn unpacked(folder: &Path) -> Option<PathBuf> {
    let tools = on_path(&["dpkg-shlibdeps"]).and_then(|_| on_path(&["strip"]));
    tool_or_skip(Tool::Debian, tools)?;
    let formation = program("formation");
    let mut build = Command::new(root().join("launch_scripts/debian/build.sh"));
    build
        .arg(folder)
        .env("FORMATION_PROGRAMS", formation.parent().unwrap())
        .env("FORMATION_DEB_COMPRESSION", "none");
    let package = output(&mut build);
    let root = folder.join("root");
    output(
        Command::new("dpkg")
            .arg("-x")
            .arg(package.trim())
            .arg(&root),
    );
    let fields = output(Command::new("dpkg").arg("-I").arg(package.trim()));
    assert!(fields.contains("Package: formation\n"), "{fields}");
    assert!(fields.contains("Depends: libc6 "), "{fields}");
    Some(root)
}

/// The units, with the programs where they were unpacked.
fn check_units(root: &Path) {
    let units = root.join("usr/lib/systemd/system");
    let Ok(analyser) = on_path(&["systemd-analyze"]) else {
        return;
    };
    let mut found = Vec::new();
    for unit in fs::read_dir(&units).unwrap() {
        let unit = unit.unwrap().path();
        let text = fs::read_to_string(&unit).unwrap();
        let programs = root.join("usr/lib/formation");
        let moved = text.replace("/usr/lib/formation", programs.to_str().unwrap());
        // A template is checked as the unit of one module.
        let name = unit.file_name().unwrap().to_str().unwrap();
        let copy = root.join(name.replace("@.", "@4."));
        fs::write(&copy, moved).unwrap();
        let checked = Command::new(&analyser)
            .args(["verify", "--man=no"])
            .arg(&copy)
            .output()
            .unwrap();
        let said = String::from_utf8(checked.stderr).unwrap();
        // It also reports on units of the machine that have nothing to do with this one.
        let about = said.lines().filter(|line| line.contains("formation"));
        assert_eq!(about.collect::<Vec<_>>(), Vec::<&str>::new());
        found.push(name.to_owned());
    }
    found.sort();
    assert_eq!(
        found,
        [
            "formation-module@.service",
            "formation-target-publisher.service",
            "formation-verifier.service"
        ]
    );
}

#[test]
fn the_debian_package_forms_a_target_from_a_clean_root() {
    let folder = tempfile::tempdir().unwrap();
    let Some(root) = unpacked(folder.path()) else {
        return;
    };
    check_units(&root);
    for completion in [
        "bash-completion/completions/formation",
        "zsh/vendor-completions/_formation",
        "fish/vendor_completions.d/formation.fish",
    ] {
        let script = fs::read_to_string(root.join("usr/share").join(completion)).unwrap();
        assert!(script.contains("simulate"), "{completion}");
    }
    let manual = root.join("usr/share/man/man1/formation-run.1.gz");
    assert!(manual.is_file(), "{}", manual.display());
    let defaults = fs::read_to_string(root.join("etc/default/formation")).unwrap();
    assert!(defaults.contains("MODULE_OPTIONS="));
    let name = scenario_path("mcs_detach");
    let name = name.file_name().unwrap();
    let scenario = root.join("usr/share/formation/scenarios").join(name);
    let domain = Domain::for_processes(4);
    let arguments = [
        "run",
        scenario.to_str().unwrap(),
        "--modules-per-process",
        "4",
        "--timeout",
        "60",
        "--json",
    ];
    let launcher = root.join("usr/bin/formation");
    let run: Finished =
        Running::start_from(&launcher, "formation", &domain, &arguments).finish(PATIENCE);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(run.json()["verdict"], Value::from("COMPLETE"));
}
