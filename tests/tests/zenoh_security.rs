//! Who may take part over Zenoh: real processes with certificates, and three that may not do what they try.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use formation_tests::{Domain, Python, Running, scenario_path};
use serde_json::Value;

use crate::zenoh::free_port;

const PATIENCE: Duration = Duration::from_secs(60);

/// The files of an authority, and the router that uses them.
struct Protected {
    folder: tempfile::TempDir,
    endpoint: String,
    domain: String,
}

impl Protected {
    fn new(domain: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        create(&folder.path().join("ours"), domain);
        Self {
            folder,
            endpoint: format!("tls/127.0.0.1:{}", free_port()),
            domain: domain.to_owned(),
        }
    }

    fn file(&self, role: &str) -> PathBuf {
        self.folder.path().join(format!("ours/{role}.json5"))
    }

    fn router(&self) -> Running {
        self.router_at(&["--listen", &self.endpoint])
    }

    /// Starts a router with these options.
    fn router_at(&self, options: &[&str]) -> Running {
        let file = self.file("router");
        let variables = [
            ("ZENOH_ROUTER_CONFIG_URI", file.to_str().unwrap()),
            ("ROS_SECURITY_ENABLE", "true"),
            ("ROS_SECURITY_STRATEGY", "Enforce"),
        ];
        let arguments = [&["router"], options].concat();
        Running::start_with(&variables, "formation", &self.domain, &arguments).await_routing()
    }

    /// Starts a program with the session file of a role.
    fn run(&self, role: &str, name: &str, arguments: &[&str]) -> Running {
        self.run_with(&self.file(role), "Enforce", name, arguments)
    }

    fn run_with(&self, file: &Path, strategy: &str, name: &str, arguments: &[&str]) -> Running {
        self.run_at(&self.endpoint, (file, strategy), name, arguments)
    }

    /// Starts a program with a session file and a strategy, as a client of one router.
    fn run_at(
        &self,
        endpoint: &str,
        (file, strategy): (&Path, &str),
        name: &str,
        arguments: &[&str],
    ) -> Running {
        let router = format!("connect/endpoints=[\"{endpoint}\"]");
        let variables = [
            ("ZENOH_SESSION_CONFIG_URI", file.to_str().unwrap()),
            ("ZENOH_CONFIG_OVERRIDE", router.as_str()),
            ("ROS_SECURITY_ENABLE", "true"),
            ("ROS_SECURITY_STRATEGY", strategy),
        ];
        let arguments = [&["--middleware", "zenoh"], arguments].concat();
        Running::start_with(&variables, name, &self.domain, &arguments)
    }
}

/// Makes the files of a new authority.
fn create(directory: &Path, domain: &str) {
    let arguments = ["security", "create", directory.to_str().unwrap()];
    let created = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert_eq!(created.status, 0, "{}", created.stderr);
}

/// What stands for the certificate of a session in its file.
const CERTIFICATE: [&str; 2] = ["connect_certificate_base64", "connect_private_key_base64"];

/// Writes a copy of a session file with the certificate of another one, or without any.
fn with_certificate_of(other: Option<&Path>, file: &Path, copy: &Path) {
    let read = |file: &Path| -> Value {
        serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
    };
    let mut settings = read(file);
    let section = &mut settings["transport"]["link"]["tls"];
    let other = other.map(|other| read(other)["transport"]["link"]["tls"].take());
    section["enable_mtls"] = other.is_some().into();
    for key in CERTIFICATE {
        section.as_object_mut().unwrap().remove(key).unwrap();
        if let Some(other) = &other {
            section[key] = other[key].clone();
        }
    }
    fs::write(copy, settings.to_string()).unwrap();
}

/// Calls `query_status` with the certificate of a role, and returns whether an answer came.
fn status_is_answered(python: &Python, protected: &Protected, role: &str) -> bool {
    let file = protected.file(role);
    let arguments = [
        file.to_str().unwrap(),
        &protected.endpoint,
        &protected.domain,
    ];
    let mut caller = python.start("tests/python/zenoh_caller.py", &arguments, Stdio::inherit());
    let mut said = String::new();
    let stdout = caller.stdout.take();
    stdout.unwrap().read_to_string(&mut said).unwrap();
    assert!(caller.wait().unwrap().success(), "{said}");
    match said.trim() {
        "answered" => true,
        "no answer" => false,
        other => panic!("{other}"),
    }
}

#[test]
fn a_run_gives_each_process_the_file_of_its_role() {
    let domain = &*Domain::for_processes(12);
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("files");
    create(&files, domain);
    let scenario = scenario_path("singletons_10");
    let recording = folder.path().join("run.mcap");
    let run = |files: &Path| {
        let arguments = [
            "run",
            scenario.to_str().unwrap(),
            "--json",
            "--domain",
            domain,
            "--security",
            files.to_str().unwrap(),
            "--record",
            recording.to_str().unwrap(),
        ];
        Running::start("formation", domain, &arguments).finish(PATIENCE)
    };
    let protected = run(&files);
    assert_eq!(protected.status, 0, "{}", protected.stderr);
    assert_eq!(protected.json()["verdict"], "COMPLETE");
    let said = &protected.stderr;
    assert!(said.contains("routing on [\"tls/127.0.0.1:"), "{said}");
    assert!(
        !said.contains("refused Put"),
        "what belongs to a role: {said}"
    );
    fs::remove_file(files.join("verifier.json5")).unwrap();
    let incomplete = run(&files);
    assert_eq!(incomplete.status, 2, "{}", incomplete.stderr);
    assert!(
        incomplete.stderr.contains("verifier.json5 is missing"),
        "{}",
        incomplete.stderr
    );
}

#[test]
fn strangers_are_refused_and_roles_keep_to_their_topics_and_services() {
    let Some(python) = Python::with_zenoh() else {
        return;
    };
    let domain = &*Domain::for_processes(10);
    let protected = Protected::new(domain);
    let router = protected.router();
    let scenario = scenario_path("singletons_10");
    let scenario = ["--scenario", scenario.to_str().unwrap()];
    let judged = [&scenario[..], &["--json"]].concat();
    let verifier = protected.run("verifier", "verifier", &judged);
    let halves = ["1-5", "6-10"].map(|modules| {
        let hosted = [&scenario[..], &["--modules", modules, "--speed", "0.3"]].concat();
        protected.run("module", "module_agent", &hosted)
    });
    let recording = protected.folder.path().join("run.mcap");
    let recording = recording.to_str().unwrap();
    let _observers = [
        protected.run("observer", "recorder", &[recording]),
        protected.run("observer", "visualiser", &[]),
    ];
    let _publisher = protected.run("publisher", "target_publisher", &scenario);
    for half in &halves {
        let moving = half.wait_for_log(0, "moving to spot", PATIENCE);
        assert!(moving.is_some(), "{:?}", half.log_since(0));
    }
    let logged = router.log_since(0);
    let refused = logged.iter().find(|line| line.text.contains("refused"));
    assert!(refused.is_none(), "what belongs to a role: {refused:?}");

    let [bare, forged, theirs] =
        ["bare.json5", "forged.json5", "theirs"].map(|name| protected.folder.path().join(name));
    let ours = protected.file("module");
    with_certificate_of(None, &ours, &bare);
    create(&theirs, domain);
    with_certificate_of(Some(&theirs.join("module.json5")), &ours, &forged);
    let module = ["--module", "1", "--x", "0", "--y", "0"];
    let strangers = [
        protected.run_with(&bare, "Permissive", "module_agent", &module),
        protected.run_with(&forged, "Enforce", "module_agent", &module),
    ];
    let other = scenario_path("undersupply");
    let other = ["--scenario", other.to_str().unwrap()];
    let _intruder = protected.run("module", "target_publisher", &other);
    assert!(!status_is_answered(&python, &protected, "observer"));
    assert!(status_is_answered(&python, &protected, "operator"));

    for stranger in strangers {
        let stranger = stranger.finish(PATIENCE);
        assert_eq!(stranger.status, 1, "{}", stranger.stderr);
        let is_refused = stranger.stderr.contains("cannot reach a Zenoh router");
        assert!(is_refused, "{}", stranger.stderr);
    }
    for refusal in [
        ["refused a link: ", "peer sent no certificates"],
        ["refused a link: ", "invalid peer certificate"],
        ["refused Put on ", "/formation/target/"],
        ["refused Query on ", "/formation/query_status/"],
    ] {
        let found = router.log_since(0).into_iter().find(|line| {
            let has = |part: &&str| line.text.contains(part);
            refusal.iter().all(has)
        });
        assert!(found.is_some(), "{refusal:?} in {:#?}", router.log_since(0));
    }
    let verdict = verifier.finish(PATIENCE).last_json();
    assert_eq!(verdict["verdict"]["outcome"], "COMPLETE", "{verdict}");
    assert_eq!(
        verdict["verdict"]["assignments"].as_array().unwrap().len(),
        10
    );
}

#[test]
fn a_configuration_without_certificates_is_refused_where_security_is_enforced() {
    let domain = &*Domain::for_processes(1);
    let variables = [
        ("ROS_SECURITY_ENABLE", "true"),
        ("ROS_SECURITY_STRATEGY", "Enforce"),
    ];
    let scenario = scenario_path("singletons_10");
    let scenario = scenario.to_str().unwrap();
    let programs: [(&str, &[&str], &str); 3] = [
        (
            "verifier",
            &["--middleware", "zenoh", "--scenario", scenario],
            "ZENOH_SESSION_CONFIG_URI",
        ),
        ("formation", &["router"], "ZENOH_ROUTER_CONFIG_URI"),
        (
            "formation",
            &["run", scenario, "--middleware", "zenoh"],
            "demands no certificates",
        ),
    ];
    for (name, arguments, named) in programs {
        let refused = Running::start_with(&variables, name, domain, arguments);
        let refused = refused.finish(PATIENCE);
        assert_eq!(refused.status, 2, "{name}: {}", refused.stderr);
        assert!(refused.stderr.contains(named), "{name}: {}", refused.stderr);
    }
}

/// The agents are clients of two routers, whose own link is protected as well.
#[test]
fn a_formation_passes_two_routers_with_certificates() {
    let domain = &*Domain::for_processes(6);
    let protected = Protected::new(domain);
    let second = format!("tls/127.0.0.1:{}", free_port());
    let _first = protected.router();
    let connect = ["--listen", &second, "--connect", &protected.endpoint];
    let _second = protected.router_at(&connect);
    let scenario = scenario_path("singletons_10");
    let of_scenario = ["--scenario", scenario.to_str().unwrap()];
    let start = |endpoint: &str, role: &str, name: &str, more: &[&str]| {
        let arguments = [&of_scenario[..], more].concat();
        let file = protected.file(role);
        protected.run_at(endpoint, (&file, "Enforce"), name, &arguments)
    };
    let verifier = start(&second, "verifier", "verifier", &["--json"]);
    let hosted = [(&protected.endpoint, "1-5"), (&second, "6-10")];
    let _agents = hosted
        .map(|(router, modules)| start(router, "module", "module_agent", &["--modules", modules]));
    let _publisher = start(&protected.endpoint, "publisher", "target_publisher", &[]);
    let verdict = verifier.finish(PATIENCE).last_json();
    assert_eq!(verdict["verdict"]["outcome"], "COMPLETE", "{verdict}");
}
