use std::path::PathBuf;

use signal_hook::consts::SIGTERM;

use super::*;

const PATIENCE: Duration = Duration::from_secs(30);

fn shell(script: &str) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", script]);
    command
}

fn supervise(script: &str) -> (Supervisor, ProcessId) {
    let mut supervisor = Supervisor::new(&[]).unwrap();
    let process = supervisor
        .start(
            "module 7".to_owned(),
            &mut shell(script),
            ProcessOutput::Results,
        )
        .unwrap();
    (supervisor, process)
}

/// Supervises a script that has said that it is ready.
fn supervise_until_ready(script: &str) -> (Supervisor, ProcessId) {
    let (mut supervisor, process) = supervise(script);
    let ready = ProcessEvent::Line(process, "ready".to_owned());
    assert_eq!(next(&mut supervisor), ready);
    (supervisor, process)
}

fn next(supervisor: &mut Supervisor) -> ProcessEvent {
    supervisor.next(Instant::now() + PATIENCE)
}

fn next_exit(supervisor: &mut Supervisor) -> Option<i32> {
    match next(supervisor) {
        ProcessEvent::Exited(_, status) => status.code(),
        other => panic!("expected an exit, got {other:?}"),
    }
}

fn proc_entry(supervisor: &Supervisor, process: ProcessId) -> PathBuf {
    PathBuf::from(format!(
        "/proc/{}",
        supervisor.processes[process.0].child.id()
    ))
}

#[test]
fn a_failing_process_is_named_with_its_last_lines() {
    let (mut supervisor, process) =
        supervise("for i in $(seq 30); do echo line $i >&2; done; printf 'no end' >&2; exit 3");
    assert_eq!(next_exit(&mut supervisor), Some(3));
    assert_eq!(supervisor.name(process), "module 7");
    let lines: Vec<&str> = supervisor.last_lines(process).collect();
    assert_eq!(lines.len(), super::super::tail::LINES_MAX);
    assert_eq!(lines.last(), Some(&"no end"));
    assert_eq!(lines.first(), Some(&"line 12"));
}

#[test]
fn results_come_in_order_and_before_the_exit() {
    let (mut supervisor, process) = supervise("echo first; echo noise >&2; echo second");
    for expected in ["first", "second"] {
        assert_eq!(
            next(&mut supervisor),
            ProcessEvent::Line(process, expected.to_owned())
        );
    }
    assert_eq!(next_exit(&mut supervisor), Some(0));
    assert_eq!(
        supervisor.next(Instant::now()),
        ProcessEvent::TimedOut,
        "an exit is reported once"
    );
}

#[test]
fn what_happens_in_a_pause_is_reported_after_it_in_order() {
    let (mut supervisor, process) = supervise("echo first; echo second; exit 5");
    // Long enough for the process to end; what is asserted does not depend on it.
    assert!(supervisor.pause(Duration::from_millis(300)));
    for expected in ["first", "second"] {
        assert_eq!(
            next(&mut supervisor),
            ProcessEvent::Line(process, expected.to_owned())
        );
    }
    assert_eq!(next_exit(&mut supervisor), Some(5));
}

#[test]
fn a_signal_cuts_pauses_short_and_is_reported() {
    let (mut supervisor, process) = supervise("echo first; sleep 60");
    assert_eq!(
        next(&mut supervisor),
        ProcessEvent::Line(process, "first".to_owned())
    );
    supervisor.sender.send(Input::Signal(SIGTERM)).unwrap();
    for _ in 0..2 {
        let before = Instant::now();
        assert!(!supervisor.pause(PATIENCE));
        assert!(before.elapsed() < PATIENCE);
    }
    assert_eq!(next(&mut supervisor), ProcessEvent::Interrupted(SIGTERM));
}

#[test]
fn a_signal_that_repeats_the_first_does_not_cut_the_end_of_the_processes_short() {
    let (mut supervisor, _) =
        supervise_until_ready("trap 'sleep 0.3; exit 0' TERM; echo ready; sleep 30 & wait");
    for signal in [SIGTERM, SIGTERM] {
        supervisor.sender.send(Input::Signal(signal)).unwrap();
    }
    assert_eq!(next(&mut supervisor), ProcessEvent::Interrupted(SIGTERM));
    assert_eq!(supervisor.stop(PATIENCE), Vec::<String>::new());
}

#[test]
fn a_flood_of_output_neither_blocks_nor_grows() {
    let (mut supervisor, process) = supervise("seq 200000 >&2");
    assert_eq!(next_exit(&mut supervisor), Some(0));
    assert_eq!(supervisor.last_lines(process).last(), Some("200000"));
}

#[test]
fn an_exit_is_reported_though_a_grandchild_holds_the_output_open() {
    let (mut supervisor, process) = supervise("(sleep 3; echo late >&2) & echo early >&2; exit 4");
    assert_eq!(next_exit(&mut supervisor), Some(4));
    let lines: Vec<&str> = supervisor.last_lines(process).collect();
    assert_eq!(lines, ["early"]);
}

#[test]
fn a_polite_process_ends_on_sigterm() {
    let (mut supervisor, process) = supervise_until_ready(
        "trap 'echo goodbye >&2; exit 0' TERM; echo ready; while :; do sleep 0.02; done",
    );
    assert_eq!(supervisor.stop(PATIENCE), Vec::<String>::new());
    assert!(!proc_entry(&supervisor, process).exists());
    let (status, _) = supervisor.processes[process.0].exit.unwrap();
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_process_that_ignores_sigterm_is_killed_and_named() {
    let (mut supervisor, process) =
        supervise_until_ready("trap '' TERM; echo ready; while :; do sleep 0.02; done");
    let entry = proc_entry(&supervisor, process);
    assert!(entry.exists());
    assert_eq!(supervisor.stop(Duration::from_millis(200)), ["module 7"]);
    assert!(!entry.exists());
}

#[test]
fn processes_that_write_without_end_are_killed_in_time() {
    for stream in ["", ">&2"] {
        let script = format!("trap '' TERM; while :; do echo more {stream}; done");
        let mut supervisor = Supervisor::new(&[]).unwrap();
        let names = ["first", "second", "third", "fourth"].map(str::to_owned);
        for name in names.clone() {
            supervisor
                .start(name, &mut shell(&script), ProcessOutput::Results)
                .unwrap();
        }
        assert!(supervisor.pause(Duration::from_millis(200)));
        assert_eq!(supervisor.stop(Duration::from_millis(200)), names);
    }
}

#[test]
fn dropping_the_supervisor_ends_what_runs() {
    let (supervisor, process) =
        supervise_until_ready("trap '' TERM; echo ready; while :; do sleep 0.02; done");
    let entry = proc_entry(&supervisor, process);
    drop(supervisor);
    assert!(!entry.exists());
}

#[test]
fn a_program_that_is_missing_is_an_error() {
    let mut supervisor = Supervisor::new(&[]).unwrap();
    let mut missing = Command::new("/no/such/program");
    assert_eq!(
        supervisor
            .start(
                "module 1".to_owned(),
                &mut missing,
                ProcessOutput::Discarded
            )
            .unwrap_err()
            .kind(),
        io::ErrorKind::NotFound
    );
}
