//! Several runs on one machine do not mix, and others watch them.

use std::time::Duration;

use formation_tests::{Domain, Running, Signal, scenario_path};

const PATIENCE: Duration = Duration::from_secs(120);

/// Starts a run of the shipped scenario with seven modules. The empty domain is none: the run takes one by itself.
fn start(domain: &str, more: &[&str]) -> Running {
    let scenario = scenario_path("mcs_detach");
    let arguments = ["run", scenario.to_str().unwrap(), "--json"];
    Running::start("formation", domain, &[&arguments[..], more].concat())
}

#[test]
fn two_runs_that_start_at_once_with_default_options_both_form() {
    // For the places of the processes: the runs choose other domains.
    let _alone = Domain::alone();
    let runs = [start("", &[]), start("", &[])];
    let mut moved = 0;
    let mut sessions = Vec::new();
    for run in runs {
        let finished = run.finish(PATIENCE);
        assert_eq!(finished.status, 0, "{}", finished.stderr);
        let report = finished.json();
        assert_eq!(report["verdict"], "COMPLETE");
        assert_eq!(report["replanned"], false, "{report}");
        sessions.push(report["session"].clone());
        moved += usize::from(finished.stderr.contains("so this runs in domain "));
    }
    assert!(moved >= 1, "one of the runs moves to another domain");
    assert_ne!(sessions[0], sessions[1]);
}

#[test]
fn a_run_is_refused_in_a_domain_that_another_run_has_and_takes_it_afterwards() {
    let domain = &*Domain::for_processes(9);
    let first = start(domain, &["--session", "77", "--speed", "0.2"]);
    let joined = first.wait_for_log(0, ": joined 7/7", PATIENCE);
    assert!(joined.is_some(), "{:?}", first.log_since(0));
    let refused = start(domain, &[]).finish(PATIENCE);
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    let expected = format!(
        "error: a `formation run` of session 77, process {} has domain {domain} and namespace /formation; end it, or use \
         another domain with --domain or ROS_DOMAIN_ID, or another namespace with ROS_NAMESPACE\n",
        first.id()
    );
    assert_eq!(refused.stderr, expected);
    assert_eq!(first.stop().status, 143);
    let second = start(domain, &["--plan-only"]).finish(PATIENCE);
    assert_eq!(second.status, 0, "{}", second.stderr);
}

#[test]
fn a_run_is_refused_in_a_domain_of_modules_that_were_started_without_a_launcher() {
    let domain = &*Domain::for_processes(3);
    let scenario = scenario_path("mcs_detach");
    let hosted = ["--scenario", scenario.to_str().unwrap(), "--modules", "1-7"];
    let agent = Running::start("module_agent", domain, &hosted);
    let joined = agent.wait_for_log(0, "joined the ROS 2 graph", PATIENCE);
    assert!(joined.is_some(), "{:?}", agent.log_since(0));
    let refused = start(domain, &[]).finish(PATIENCE);
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    let expected =
        format!("error: a formation of session 0 has domain {domain} and namespace /formation; ");
    assert!(refused.stderr.starts_with(&expected), "{}", refused.stderr);
    // Who names the session of the modules means their formation.
    let own = start(domain, &["--session", "0", "--plan-only", "--timeout", "1"]);
    let own = own.finish(PATIENCE);
    assert!(!own.stderr.contains("has domain"), "{}", own.stderr);
}

#[test]
fn a_run_is_watched_until_its_verdict_or_until_a_signal() {
    let domain = &*Domain::for_processes(11);
    let run = start(domain, &["--session", "78", "--speed", "1.5"]);
    let joined = run.wait_for_log(0, ": joined 7/7", PATIENCE);
    assert!(joined.is_some(), "{:?}", run.log_since(0));
    let watch = || Running::start("formation", domain, &["watch"]);
    let (whole, part) = (watch(), watch());
    for watch in [&whole, &part] {
        let acting = watch.wait_for_log(0, "acting: joined 7/7", PATIENCE);
        assert!(acting.is_some(), "{:?}", watch.log_since(0));
    }
    part.signal(Signal::INT);
    let part = part.finish(PATIENCE);
    assert_eq!(part.status, 130, "{}", part.stderr);
    let expected = "error: watching was ended by SIGINT (Ctrl-C); the formation goes on\n";
    assert!(part.stderr.ends_with(expected), "{}", part.stderr);
    let whole = whole.finish(PATIENCE);
    assert_eq!(whole.status, 0, "{}", whole.stderr);
    assert_eq!(whole.stdout, "COMPLETE: 7 of 7 spots are filled\n");
    let run = run.finish(PATIENCE);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(run.json()["replanned"], false, "it was not disturbed");
}

#[test]
fn a_watch_without_a_formation_says_where_it_looked() {
    let domain = &*Domain::for_processes(1);
    let watch = Running::start("formation", domain, &["watch"]).finish(PATIENCE);
    assert_eq!(watch.status, 1, "{}", watch.stderr);
    let expected = format!(
        "error: no formation sent a message within 10 s in domain {domain} and namespace /formation, range LOCALHOST; "
    );
    assert!(watch.stderr.starts_with(&expected), "{}", watch.stderr);
}
