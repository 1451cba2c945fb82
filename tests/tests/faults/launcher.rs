//! A process of a run that a user started with the launcher dies, and the run goes on.

use std::fs;
use std::path::PathBuf;

use formation_tests::{Domain, Running, ScenarioFile, report, room_for_many_processes};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use super::{PATIENCE, SPARES};

/// The process that hosts a module of this scenario.
fn agent_of(scenario: &str, module: u64) -> Pid {
    let module = module.to_string();
    let hosts = |process: &PathBuf| {
        let line = fs::read(process.join("cmdline")).unwrap_or_default();
        let arguments: Vec<&[u8]> = line.split(|&byte| byte == 0).collect();
        let says = |option: &str, value: &str| {
            let said = [option.as_bytes(), value.as_bytes()];
            arguments.windows(2).any(|pair| pair == said)
        };
        says("--scenario", scenario) && says("--module", &module)
    };
    let processes = fs::read_dir("/proc").unwrap();
    let agent = processes
        .filter_map(|process| Some(process.ok()?.path()))
        .find(hosts);
    let agent = agent.unwrap_or_else(|| panic!("no process hosts module {module}"));
    let number = agent.file_name().unwrap().to_str().unwrap();
    Pid::from_raw(number.parse().unwrap()).unwrap()
}

#[test]
fn a_run_goes_on_when_one_of_its_processes_is_killed() {
    if room_for_many_processes().is_none() {
        return;
    }
    let domain = &*Domain::for_processes(12);
    let file = ScenarioFile::new("outlived", SPARES);
    let plan = Running::start("formation", domain, &["plan", file.path(), "--json"]);
    let plan = plan.finish(PATIENCE).json();
    // The module of the last spot still moves, or waits to move, while the others act.
    let last = plan["assembly_order"].as_array().unwrap().last().unwrap();
    let assignments = plan["assignments"].as_array().unwrap();
    let killed = assignments.iter().find(|taken| taken["spot"] == *last);
    let killed = killed.unwrap()["module"].as_u64().unwrap();
    let run = [
        "run",
        file.path(),
        "--json",
        "--module-option=--suspicion-s=2.5",
        "--module-option=--lease-s=1.25",
        "--module-option=--heartbeat-s=0.25",
    ];
    let run = Running::start("formation", domain, &run);
    let acting = run.wait_for_log(0, "acting: ", PATIENCE);
    let acting = acting.unwrap_or_else(|| panic!("nothing acted"));
    let process = agent_of(file.path(), killed);
    kill_process(process, Signal::KILL).unwrap();
    let death = run.wait_for_log(
        0,
        &format!("module {killed} ended with signal: 9 (SIGKILL)"),
        PATIENCE,
    );
    assert!(death.is_some(), "the death was not reported");
    let finished = run.finish(PATIENCE);
    assert_eq!(finished.status, 0, "{}{}", finished.stdout, finished.stderr);
    report(&format!(
        "module {killed} died; the run ended {:.1} s after the others began to act",
        acting.elapsed().as_secs_f64()
    ));
    let report = finished.json();
    assert_eq!(report["verdict"], "COMPLETE");
    assert_eq!(report["open_spots"], json!([]));
    let dead = report["dead"].as_array().unwrap();
    assert_eq!(dead.len(), 1, "{report}");
    assert_eq!(dead[0]["modules"], json!([killed]));
    let filled: Vec<&Value> = report["assignments"].as_array().unwrap().iter().collect();
    assert_eq!(filled.len(), assignments.len());
    assert!(filled.iter().all(|taken| taken["module"] != killed));
}
