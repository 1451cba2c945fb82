use std::path::Path;
use std::process::Command;

use formation_event_log::{Entry, LogEvent};
use formation_model::{Assignment, Epoch, FormationStage, SpotId};

use super::*;
use crate::run::display::{LineThrottle, progress_line};

/// Runs processes that are shell scripts until the time is up: the verifier, the target publisher, and processes of
/// modules 1, 2 and so on.
fn run_for(seconds: u64, scripts: &[&str]) -> (RunEnd, Observed, Supervisor) {
    let mut supervisor = Supervisor::new(&[]).unwrap();
    let processes: Vec<ProcessId> = scripts
        .iter()
        .enumerate()
        .map(|(index, script)| {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            supervisor
                .start(
                    format!("process {index}"),
                    &mut command,
                    ProcessOutput::Results,
                )
                .unwrap()
        })
        .collect();
    let agents = processes[2..].iter().copied().zip(1..);
    let roles = ProcessRoles {
        verifier: processes[0],
        target_publisher: processes[1],
        world: None,
        recorder: None,
        agents: agents
            .map(|(process, module)| (process, vec![ModuleId(module)]))
            .collect(),
    };
    let start = Instant::now();
    let (end, observed) = RunLoop {
        supervisor: &mut supervisor,
        roles,
        modules: 2,
        start,
        deadline: start + Duration::from_secs(seconds),
        patience: Duration::from_secs(seconds),
        display: &mut Display::Lines(LineThrottle::new(Duration::from_secs(1), false)),
        observed: Observed::default(),
        orders: Orders {
            command: Box::new(|_| Command::new("true")),
            bodies_vanish: false,
        },
        order_givers: BTreeSet::new(),
        attendance: None,
    }
    .run();
    (end, observed, supervisor)
}

fn run(scripts: &[&str]) -> (RunEnd, Observed, Supervisor) {
    run_for(30, scripts)
}

/// A script that prints a line of the verifier.
fn prints(line: &ReportLine) -> String {
    format!("echo '{}'", serde_json::to_string(line).unwrap())
}

fn progress(stage: FormationStage, joined: usize, waiting_for: &[u32]) -> String {
    prints(&ReportLine::Progress(Progress {
        stage,
        epoch: None,
        joined,
        expected: None,
        planned: 0,
        agreed: 0,
        settled: joined,
        to_fill: 2,
        stopped: false,
        waiting_for: waiting_for.iter().copied().map(ModuleId).collect(),
    }))
}

const EPOCH: Epoch = Epoch {
    number: 1,
    convener: ModuleId(1),
};

/// The roster of the only epoch.
fn roster(modules: &[u32], out_of_service: &[u32]) -> String {
    let ids = |ids: &[u32]| ids.iter().copied().map(ModuleId).collect();
    prints(&ReportLine::Entry(Entry {
        at_ms: 1,
        event: LogEvent::Roster {
            epoch: EPOCH,
            modules: ids(modules),
            out_of_service: ids(out_of_service),
            problem: None,
        },
    }))
}

/// Settled on spot 1, and nothing else.
fn verdict(outcome: Outcome, module: u32) -> String {
    let open_spots = match outcome {
        Outcome::Partial => vec![SpotId(2)],
        _ => Vec::new(),
    };
    prints(&ReportLine::Verdict(VerdictReport {
        outcome,
        epoch: Some(EPOCH),
        filled_spots: 1,
        assignments: vec![Assignment {
            module: ModuleId(module),
            spot: SpotId(1),
        }],
        unassigned: Vec::new(),
        open_spots,
        blocked_spots: Vec::new(),
        violations: Vec::new(),
        missing: Vec::new(),
        timings_ms: Default::default(),
        planning_ms: None,
        acting_ms: None,
        counts: Default::default(),
        collision_free: true,
        collision_reason: None,
        not_judged: Vec::new(),
    }))
}

fn judged(end: RunEnd) -> VerdictReport {
    match end {
        RunEnd::Judged(Judgement::Verdict(verdict)) => verdict,
        other => panic!("expected a verdict, got {other:?}"),
    }
}

#[test]
fn a_run_ends_with_the_verdict() {
    let verifier = [
        progress(FormationStage::Gathering, 1, &[]),
        "echo 'no JSON'".to_owned(),
        progress(FormationStage::Acting, 2, &[]),
        verdict(Outcome::Complete, 1),
    ];
    let (end, observed, mut supervisor) = run(&[
        &verifier.join("\n"),
        "echo '{\"verdict\":\"of no verifier\"}'; exec sleep 30",
        "exec sleep 30",
    ]);
    assert_eq!(judged(end).outcome, Outcome::Complete);
    assert_eq!(observed.progress.unwrap().settled, 2);
    assert!(observed.discovery.is_some());
    assert_eq!(
        supervisor.stop(Duration::from_secs(30)),
        Vec::<String>::new()
    );
}

#[test]
fn a_process_without_which_a_run_cannot_continue_ends_it() {
    let stay = "exec sleep 30";
    for (scripts, name) in [
        (["exit 3", stay, stay, stay], "process 0"),
        ([stay, "kill -9 $$", stay, stay], "process 1"),
        (
            [stay, stay, stay, "echo out of battery >&2; exit 9"],
            "process 3",
        ),
    ] {
        let (end, _, supervisor) = run(&scripts);
        let RunEnd::ProcessEnded(process, _) = end else {
            panic!("expected an end, got {end:?}");
        };
        assert_eq!(supervisor.name(process), name);
    }
}

/// Two scripts: one kills itself while a child of its own keeps its output open for a while, the other waits until the
/// supervisor has found that.
fn dies_and_awaits_death(directory: &Path) -> [String; 2] {
    let died = directory.join("died");
    let died = died.display();
    [
        format!("sleep 2 & echo $$ > {died}.part; mv {died}.part {died}; kill -9 $$"),
        // A process that ended keeps its number until its parent has waited for it.
        format!("until [ -e {died} ] && ! kill -0 $(cat {died}) 2>&-; do sleep 0.02; done"),
    ]
}

#[test]
fn a_run_continues_without_some_agents_and_ends_with_the_last() {
    let directory = tempfile::tempdir().unwrap();
    let [dies, awaits_death] = dies_and_awaits_death(directory.path());
    let last = awaits_death + "; kill -9 $$";
    let (end, observed, supervisor) = run(&["exec sleep 30", "exec sleep 30", &dies, &last]);
    let RunEnd::NoAgentLeft(process, status) = end else {
        panic!("expected that no agent is left, got {end:?}");
    };
    assert_eq!(supervisor.name(process), "process 3");
    assert_eq!(status.code(), None);
    assert_eq!(listed_in_full(observed.deaths.modules()), "modules 1-2");
    let first = observed.deaths.iter().next().unwrap().to_string();
    assert!(
        first.starts_with("process 2 ended with signal: 9 (SIGKILL) after "),
        "{first}"
    );
}

#[test]
fn a_verdict_that_relies_on_the_dead_is_not_final() {
    let directory = tempfile::tempdir().unwrap();
    let [dies, awaits_death] = dies_and_awaits_death(directory.path());
    let verifier = [
        awaits_death,
        verdict(Outcome::Complete, 1),
        verdict(Outcome::Failed, 1),
        verdict(Outcome::Complete, 2),
        "exec sleep 30".to_owned(),
    ];
    let (end, observed, _) = run(&[
        &verifier.join("\n"),
        "exec sleep 30",
        &dies,
        "exec sleep 30",
    ]);
    assert_eq!(judged(end).assignments[0].module, ModuleId(2));
    assert_eq!(observed.deaths.modules(), [ModuleId(1)].into());
}

#[test]
fn partial_is_not_final_while_living_modules_are_left_out() {
    let stay = "exec sleep 30";
    let partial = [roster(&[1], &[]), verdict(Outcome::Partial, 1)].join("\n");
    let healed = [&partial, "sleep 1", &verdict(Outcome::Complete, 1), stay].join("\n");
    let (end, ..) = run(&[&healed, stay, stay, stay]);
    assert_eq!(judged(end).outcome, Outcome::Complete);
    // The time is up before module 2 is back.
    let verifier = format!("{partial}\n{stay}");
    let (end, observed, _) = run_for(2, &[&verifier, stay, stay, stay]);
    assert_eq!(judged(end).outcome, Outcome::Partial);
    assert!(observed.timed_out);
    // No further module can come.
    for roster in [roster(&[1, 2], &[2]), roster(&[1, 2], &[])] {
        let verifier = [&roster, verdict(Outcome::Partial, 1).as_str(), stay].join("\n");
        let (end, observed, _) = run(&[&verifier, stay, stay, stay]);
        assert_eq!(judged(end).outcome, Outcome::Partial);
        assert!(!observed.timed_out);
    }
}

#[test]
fn a_run_without_a_verdict_keeps_its_last_progress() {
    let verifier = progress(FormationStage::Gathering, 1, &[4]) + "; exec sleep 30";
    let (end, observed, _) = run_for(1, &[&verifier, "exec sleep 30", "exec sleep 30"]);
    assert!(matches!(end, RunEnd::TimedOut), "{end:?}");
    assert!(progress_line(&observed.progress.unwrap()).ends_with("waiting for module 4"));
}
