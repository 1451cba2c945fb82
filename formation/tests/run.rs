//! `formation run` as a user meets it, with shell scripts in place of the nodes: how it starts, watches and stops
//! processes, whatever they do. What the real ones do together is tested elsewhere.

use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Tool, on_path, tool_or_skip};
use formation_verify::Outcome;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::verifier_lines::{gathering, judges, verdict, verdict_after};

const PATIENCE: Duration = Duration::from_secs(60);

/// Two modules with one obvious plan: each takes the spot below it.
const SCENARIO: &str = "\
name: two
target: {spots: [{id: 1, x: 0.0, y: 0.0}, {id: 2, x: 1.0, y: 0.0}], edges: [[1, 2]]}
singletons: [{id: 7, x: 0.0, y: 1.0}, {id: 8, x: 1.0, y: 1.0}]
";

/// A program that stays until it is asked to end.
const POLITE: &str = "exec sleep 60";

/// A directory with the launcher and scripts in place of the nodes.
struct Sandbox {
    directory: tempfile::TempDir,
    /// A script that is being written cannot be started by a test that runs at the same time, and processes are many enough one test
    /// at a time.
    _alone: MutexGuard<'static, ()>,
}

impl Sandbox {
    fn new(verifier: &str) -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let directory = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        fs::hard_link(
            env!("CARGO_BIN_EXE_formation"),
            directory.path().join("formation"),
        )
        .unwrap();
        fs::write(directory.path().join("scenario.yaml"), SCENARIO).unwrap();
        let sandbox = Self {
            directory,
            _alone: alone,
        };
        for program in ["module_agent", "leader_agent", "target_publisher"] {
            sandbox.program(program, POLITE);
        }
        sandbox.program("verifier", verifier);
        sandbox
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// A script that first notes its process number under its name and arguments.
    fn program(&self, name: &str, script: &str) {
        self.program_after(":", name, script);
    }

    /// The same; the program counts as started once it has done what `first` says.
    fn program_after(&self, first: &str, name: &str, script: &str) {
        let path = self.path(name);
        let note = self.directory.path().display();
        let script = format!(
            "#!/bin/sh\n{first}\nnoted='{note}/started-{name}-'$$\nprintf '%s\\n' \"$*\" > \"$noted.part\"\n\
             mv \"$noted.part\" \"$noted\"\n{script}\n"
        );
        fs::write(&path, script).unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o755)).unwrap();
    }

    /// The processes that were started: program, process number and arguments.
    fn started(&self) -> Vec<(String, u32, String)> {
        let mut started: Vec<(String, u32, String)> = fs::read_dir(self.directory.path())
            .unwrap()
            .filter_map(|entry| {
                let path = entry.unwrap().path();
                let name = path.file_name()?.to_str()?.strip_prefix("started-")?;
                let (program, number) = name.rsplit_once('-')?;
                let number = number.parse().ok()?;
                let arguments = fs::read_to_string(&path).unwrap().trim().to_owned();
                Some((program.to_owned(), number, arguments))
            })
            .collect();
        started.sort();
        started
    }

    fn await_started(&self, count: usize) {
        let deadline = Instant::now() + PATIENCE;
        while self.started().len() < count {
            assert!(
                Instant::now() < deadline,
                "only these started: {:?}",
                self.started()
            );
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn command(&self, options: &[&str]) -> Command {
        let mut command = Command::new(self.path("formation"));
        command
            .arg("run")
            .arg(self.path("scenario.yaml"))
            .args(options)
            .env_remove("ROS_DOMAIN_ID")
            .env_remove("ROS_AUTOMATIC_DISCOVERY_RANGE")
            .env_remove("ROS_LOCALHOST_ONLY")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn run(&self, options: &[&str]) -> Finished {
        Finished::of(self.command(options).output().unwrap())
    }

    /// Sends a signal once all four processes run, and waits for the launcher's end.
    fn run_until_signal(&self, signal: Signal) -> Finished {
        let launcher = self.command(&[]).spawn().unwrap();
        self.await_started(4);
        kill_process(Pid::from_child(&launcher), signal).unwrap();
        Finished::of(launcher.wait_with_output().unwrap())
    }

    fn assert_nothing_runs(&self) {
        for (program, number, _) in self.started() {
            assert!(!runs(number), "{program} still runs as {number}");
        }
    }
}

struct Finished {
    status: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Finished {
    fn of(output: Output) -> Self {
        Self {
            status: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

fn runs(process: u32) -> bool {
    Path::new(&format!("/proc/{process}")).exists()
}

#[test]
fn every_process_is_started_with_its_arguments_and_stopped_in_the_end() {
    let sandbox = Sandbox::new(&verdict(Outcome::Complete, [1, 2]));
    let report = sandbox.path("report");
    let domain = &*Domain::for_processes(4);
    let finished = sandbox.run(&[
        "--json",
        "--domain",
        domain,
        "--report",
        report.to_str().unwrap(),
    ]);
    assert_eq!(finished.status, Some(0), "{}", finished.stderr);
    let json: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(json["verdict"], "COMPLETE");
    assert_eq!(json["planning_ms"], 1);
    assert_eq!(json["acting_ms"], 2);
    assert!(json["discovery_ms"].is_u64());
    assert!(json["total_distance"].is_f64());
    assert_eq!(json["dead"], serde_json::json!([]));
    let written: Value =
        serde_json::from_str(&fs::read_to_string(report.join("report.json")).unwrap()).unwrap();
    assert_eq!(written, json);
    for name in ["before.svg", "after.svg", "report.html"] {
        assert!(
            fs::metadata(report.join(name)).unwrap().len() > 1_000,
            "{name}"
        );
    }
    let started = sandbox.started();
    let programs = started.iter().map(|(program, ..)| program.as_str());
    let programs: Vec<&str> = programs.collect();
    let expected = "module_agent module_agent target_publisher verifier";
    assert_eq!(programs.join(" "), expected);
    let session = &json["session"];
    for (program, _, arguments) in &started {
        assert!(
            arguments.contains(&format!("--domain {domain} --discovery-range LOCALHOST"))
                && arguments.contains("--stop-with-parent")
                && arguments.contains(&format!("-p session:={session}")),
            "{program} {arguments}"
        );
        assert!(arguments.contains("scenario.yaml"), "{program} {arguments}");
    }
    let mut modules: Vec<&str> = started[..2]
        .iter()
        .map(|(_, _, arguments)| arguments.split_once("--module ").unwrap().1)
        .collect();
    modules.sort_unstable();
    assert!(modules[0].starts_with("7 ") && modules[1].starts_with("8 "));
    assert!(started[2].2.contains("--expected-modules 2 --voters 7-8"));
    let printed = format!("session {session}\n");
    assert!(finished.stderr.contains(&printed), "{}", finished.stderr);
    let stores = state_dir_of(&started[0].2);
    assert_eq!(stores, state_dir_of(&started[1].2));
    assert!(!Path::new(stores).exists(), "they end with the run");
    sandbox.assert_nothing_runs();
}

/// The directory of the stores, from the arguments of an agent.
fn state_dir_of(arguments: &str) -> &str {
    let mut words = arguments
        .split(' ')
        .skip_while(|word| *word != "--state-dir");
    words.nth(1).unwrap()
}

#[test]
fn a_session_and_its_stores_are_kept_on_request() {
    let sandbox = Sandbox::new(&verdict(Outcome::Complete, [1, 2]));
    let stores = tempfile::tempdir().unwrap();
    let kept = stores.path().to_str().unwrap();
    let finished = sandbox.run(&["--session", "0", "--state-dir", kept]);
    assert_eq!(finished.status, Some(0), "{}", finished.stderr);
    assert!(!finished.stderr.contains("session"), "{}", finished.stderr);
    let (_, _, arguments) = &sandbox.started()[0];
    assert_eq!(state_dir_of(arguments), kept);
    assert!(arguments.contains("-p session:=0"), "{arguments}");
    assert!(stores.path().exists());
}

#[test]
fn people_read_the_verdict_last() {
    let sandbox = Sandbox::new(&verdict(Outcome::Complete, [1, 2]));
    let finished = sandbox.run(&[]);
    assert_eq!(finished.status, Some(0), "{}", finished.stderr);
    assert!(
        finished.stdout.ends_with("hole-free\n"),
        "{}",
        finished.stdout
    );
    assert!(
        finished.stderr.contains("joined 2/2"),
        "{}",
        finished.stderr
    );
}

#[test]
fn several_modules_share_a_process() {
    let sandbox = Sandbox::new(&verdict_after(2, Outcome::Complete, [1, 2]));
    let finished = sandbox.run(&["--modules-per-process", "25"]);
    assert_eq!(finished.status, Some(0), "{}", finished.stderr);
    let started = sandbox.started();
    assert_eq!(started[0].0, "module_agent");
    assert!(started[0].2.contains("--modules 7-8"), "{}", started[0].2);
    assert!(
        started[1..]
            .iter()
            .all(|(program, ..)| program != "module_agent")
    );
}

/// The film of a page that a run wrote.
fn film(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"film\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn a_run_that_broke_off_still_shows_what_was_seen() {
    let sandbox = Sandbox::new(
        r#"
echo '{"entry":{"at_ms":5,"state":{"module":7,"phase":"LISTENING","pose":{"x":0,"y":1000000,"theta":0},"links":[],"spot":null,"unit":null}}}'
echo '{"entry":{"at_ms":9,"pose":{"module":7,"pose":{"x":500000,"y":1000000,"theta":0}}}}'
echo '{"entry":{"at_ms":10,"something":"new"}}'
exec sleep 60"#,
    );
    let report = sandbox.path("report");
    let finished = sandbox.run(&["--timeout", "1", "--report", report.to_str().unwrap()]);
    assert_eq!(finished.status, Some(1));
    assert!(!report.join("report.json").exists(), "there is no result");
    let page = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains("Broken off: no verdict within 1 s"), "{page}");
    let film = film(&page);
    assert_eq!(film["modules"][0]["phases"][0][1], "LISTENING");
    assert_eq!(film["modules"][1]["phases"], serde_json::json!([]));
    assert!(
        finished
            .stderr
            .contains("the verifier wrote a line that cannot be read"),
        "{}",
        finished.stderr
    );
}

#[test]
fn a_formation_that_failed_is_status_1() {
    let sandbox = Sandbox::new(&verdict(Outcome::Failed, [1, 2]));
    let finished = sandbox.run(&["--json"]);
    assert_eq!(finished.status, Some(1));
    let json: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(json["verdict"], "FAILED");
    // The verifier lists what is missing when the time that the launcher gave it is up.
    let error =
        "error: the formation failed: the time was up after 120 s (--timeout); spot 9 is empty\n";
    assert!(finished.stderr.ends_with(error), "{}", finished.stderr);
    sandbox.assert_nothing_runs();
}

#[test]
fn an_allocation_other_than_planned_is_found_wrong() {
    let sandbox = Sandbox::new(&verdict(Outcome::Complete, [2, 1]));
    let finished = sandbox.run(&[]);
    assert_eq!(finished.status, Some(1));
    assert!(
        finished
            .stderr
            .contains("module 7 took spot 2 instead of spot 1"),
        "{}",
        finished.stderr
    );
}

/// With the status for bad input if it could not use its arguments, its files or its environment.
#[test]
fn the_process_that_failed_is_named_with_its_last_lines() {
    for (of_module, of_run) in [(9, 1), (2, 2)] {
        let sandbox = Sandbox::new(POLITE);
        let script = format!(
            "case \"$*\" in *'--module 8 '*) echo 'out of battery' >&2; exit {of_module};; esac; exec sleep 60"
        );
        sandbox.program("module_agent", &script);
        let finished = sandbox.run(&["--json"]);
        assert_eq!(finished.status, Some(of_run));
        assert_eq!(finished.stdout, "");
        for line in [
            "module_agent of module 8: out of battery\n",
            &format!("error: module_agent of module 8 ended with exit status: {of_module}"),
        ] {
            assert!(finished.stderr.contains(line), "{}", finished.stderr);
        }
        sandbox.assert_nothing_runs();
    }
}

#[test]
fn a_death_without_a_spare_leaves_a_hole_with_a_name() {
    // As the verifier sees it: one spot is left to one module.
    let wait =
        "until grep -q 'continues without it' \"$(dirname \"$0\")/log\"; do sleep 0.02; done\n";
    let verdict = judges(Outcome::Partial, &[(7, 1)], &[2]);
    let sandbox = Sandbox::new(&[wait, &verdict, POLITE].concat());
    sandbox.program(
        "module_agent",
        "case \"$*\" in *'--module 8 '*) kill -9 $$;; esac; exec sleep 60",
    );
    let log = File::create(sandbox.path("log")).unwrap();
    let launcher = sandbox.command(&["--json"]).stderr(log).output().unwrap();
    let stderr = fs::read_to_string(sandbox.path("log")).unwrap();
    assert_eq!(launcher.status.code(), Some(1), "{stderr}");
    assert!(
        stderr.contains("module_agent of module 8 ended with signal: 9 (SIGKILL) after "),
        "{stderr}"
    );
    assert!(
        stderr.ends_with(
            "error: not all spots are filled: spot 2 open; module 8 died, and no spare was left\n"
        ),
        "{stderr}"
    );
    let json: Value = serde_json::from_slice(&launcher.stdout).unwrap();
    assert_eq!(json["verdict"], "PARTIAL");
    assert_eq!(json["open_spots"], serde_json::json!([2]));
    let dead = &json["dead"][0];
    assert_eq!(dead["process"], "module_agent of module 8");
    assert_eq!(dead["modules"], serde_json::json!([8]));
    assert_eq!(dead["ended_with"], "signal: 9 (SIGKILL)");
    assert!(dead["after_ms"].is_u64());
    sandbox.assert_nothing_runs();
}

#[test]
fn a_run_of_which_no_agent_is_left_ends_at_once() {
    let sandbox = Sandbox::new(POLITE);
    sandbox.program("module_agent", "kill -9 $$");
    let finished = sandbox.run(&["--json"]);
    assert_eq!(finished.status, Some(1));
    assert!(
        finished
            .stderr
            .contains("error: no process of modules is left before there was a verdict; module_agent of module "),
        "{}",
        finished.stderr
    );
    sandbox.assert_nothing_runs();
}

#[test]
fn a_driver_knows_the_domain_and_is_stopped_with_the_run() {
    let sandbox = Sandbox::new(&verdict_after(4, Outcome::Complete, [1, 2]));
    sandbox.program(
        "my_driver",
        "echo $ROS_DOMAIN_ID $ROS_AUTOMATIC_DISCOVERY_RANGE > $0.written; exec sleep 60",
    );
    let driver = format!("{} --all", sandbox.path("my_driver").display());
    let domain = &*Domain::for_processes(5);
    let finished = sandbox.run(&[
        "--domain",
        domain,
        "--driver",
        &driver,
        "--module-option=--pose-source=odom",
    ]);
    assert_eq!(finished.status, Some(0), "{}", finished.stderr);
    let written = fs::read_to_string(sandbox.path("my_driver.written")).unwrap();
    assert_eq!(written.trim(), format!("{domain} LOCALHOST"));
    for (program, _, arguments) in sandbox.started() {
        let external = arguments.contains("--motion external --pose-source=odom");
        assert_eq!(external, program == "module_agent", "{program} {arguments}");
    }
    sandbox.assert_nothing_runs();
}

#[test]
fn what_processes_log_as_errors_is_shown() {
    let sandbox = Sandbox::new(&verdict(Outcome::Failed, [1, 2]));
    sandbox.program(
        "module_agent",
        "case \"$*\" in *'--module 8 '*) echo 'now ERROR wheel lost module=8' >&2;; esac; exec sleep 60",
    );
    let finished = sandbox.run(&["--json"]);
    assert_eq!(finished.status, Some(1));
    assert!(
        finished
            .stderr
            .contains("module_agent of module 8: now ERROR wheel lost module=8\n"),
        "{}",
        finished.stderr
    );
}

#[test]
fn signals_stop_everything() {
    for (name, signal) in [
        ("INT", Signal::INT),
        ("TERM", Signal::TERM),
        ("HUP", Signal::HUP),
    ] {
        // As a shell reports a process that the signal ended.
        let status = 128 + signal.as_raw();
        let sandbox = Sandbox::new(POLITE);
        let finished = sandbox.run_until_signal(signal);
        assert_eq!(finished.status, Some(status), "{name}");
        assert!(
            finished
                .stderr
                .contains(&format!("error: interrupted by SIG{name}")),
            "{}",
            finished.stderr
        );
        sandbox.assert_nothing_runs();
    }
}

#[test]
fn a_process_that_ignores_sigterm_is_killed_and_named() {
    let sandbox = Sandbox::new(POLITE);
    let script = "while :; do sleep 0.05; done";
    sandbox.program_after("trap '' TERM", "target_publisher", script);
    let finished = sandbox.run_until_signal(Signal::TERM);
    assert!(
        finished
            .stderr
            .contains("warning: had to be killed, as SIGTERM did not end it: target_publisher"),
        "{}",
        finished.stderr
    );
    sandbox.assert_nothing_runs();
}

#[test]
fn a_run_without_end_names_the_missing_modules() {
    let sandbox = Sandbox::new(&(gathering(1, &[8]) + POLITE));
    let finished = sandbox.run(&["--timeout", "1"]);
    assert_eq!(finished.status, Some(1));
    assert!(
        finished.stderr.contains(
            "error: no verdict within 1 s; gathering: joined 1/2, planned 0, agreed 0, settled 0; waiting for module 8"
        ),
        "{}",
        finished.stderr
    );
    sandbox.assert_nothing_runs();
}

#[test]
fn nothing_starts_on_bad_input() {
    let sandbox = Sandbox::new(POLITE);
    for (options, expected) in [
        (&["--modules-per-process", "0"][..], "from 1 to 100"),
        (&["--modules-per-process", "101"], "from 1 to 100"),
        (&["--domain", "233"], "0 to 232"),
        (&["--timeout", "0"], "must be seconds"),
        (&["--timeout", "NaN"], "must be seconds"),
        (
            &["--report", "/dev/null/report"],
            "--report /dev/null/report: `/dev/null` is no directory",
        ),
    ] {
        let finished = sandbox.run(options);
        assert_eq!(finished.status, Some(2), "{options:?}: {}", finished.stderr);
        assert!(finished.stderr.contains(expected), "{}", finished.stderr);
    }
    fs::remove_file(sandbox.path("verifier")).unwrap();
    let finished = sandbox.run(&[]);
    assert_eq!(finished.status, Some(2));
    assert!(
        finished.stderr.contains("verifier is missing"),
        "{}",
        finished.stderr
    );
    fs::write(sandbox.path("scenario.yaml"), "target: {spots: []}").unwrap();
    let finished = sandbox.run(&[]);
    assert_eq!(finished.status, Some(2));
    assert!(
        finished.stderr.contains("target.spots"),
        "{}",
        finished.stderr
    );
    assert_eq!(sandbox.started(), Vec::new());
}

#[test]
fn more_processes_than_loopback_lets_find_each_other_get_a_network_of_their_own() {
    let Some(ip) = tool_or_skip(Tool::Namespaces, on_path(&["ip"])) else {
        return;
    };
    let sandbox = Sandbox::new(&format!(
        "'{}' -o link > \"$(dirname \"$0\")/links\"\nexit 3",
        ip.display()
    ));
    let modules: Vec<String> = (1..=12)
        .map(|id| format!("{{id: {id}, x: {id}.0, y: 5.0}}"))
        .collect();
    fs::write(
        sandbox.path("scenario.yaml"),
        format!(
            "target: {{spots: [{{id: 1, x: 0.0, y: 0.0}}]}}\nsingletons: [{}]\n",
            modules.join(", ")
        ),
    )
    .unwrap();
    let finished = sandbox.run(&[]);
    let stderr = &finished.stderr;
    if finished.status == Some(2) {
        assert!(
            stderr.contains("no network namespace can be created"),
            "{stderr}"
        );
        assert!(
            stderr.contains("sudo ip link set lo up multicast on"),
            "{stderr}"
        );
        assert!(stderr.contains("--modules-per-process 2"), "{stderr}");
        assert_eq!(sandbox.started(), Vec::new());
        return;
    }
    assert!(
        stderr.contains("error: verifier ended with exit status: 3"),
        "{stderr}"
    );
    let links = fs::read_to_string(sandbox.path("links")).unwrap();
    assert!(links.contains("LOOPBACK,MULTICAST,UP"), "{links}");
    // With a loopback that takes multicast, nothing need be done; otherwise the network is another.
    if stderr.contains("in a network namespace of its own") {
        assert_eq!(links.lines().count(), 1, "{links}");
        assert!(stderr.contains("--modules-per-process 2"), "{stderr}");
    }
    sandbox.assert_nothing_runs();
}
