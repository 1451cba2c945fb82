//! One run from the first process to the verdict.

use std::process::ExitStatus;
use std::time::{Duration, Instant};

use formation::chronicle::Entry;
use serde::Deserialize;
use serde_json::Value;

use super::progress::{Display, Progress};
use super::recording::Recording;
use super::supervisor::{Happening, ProcessId, Supervisor};

/// After its verdict, the verifier is given so long to end by itself.
const LINGER_MAX: Duration = Duration::from_secs(10);

/// How a run ended.
#[derive(Debug)]
pub enum End {
    /// The verifier has judged.
    Judged(Value),
    /// A process ended that should not have.
    ProcessEnded(ProcessId, ExitStatus),
    /// A signal asked the launcher to end.
    Interrupted(i32),
    /// The time was up; where it stood.
    TimedOut(Progress),
}

/// What was seen on the way.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// How far it came.
    pub progress: Progress,
    /// How long after the start the last module had joined.
    pub discovery: Option<Duration>,
    /// Everything that the verifier heard.
    pub recording: Recording,
}

/// A line of the verifier.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Progress(Progress),
    Entry(Entry),
    Verdict(Value),
    Agreement(Value),
}

/// Watches the processes until the verifier has judged, something failed or `deadline` has passed.
pub fn conduct(
    supervisor: &mut Supervisor,
    verifier: ProcessId,
    modules: usize,
    start: Instant,
    deadline: Instant,
    display: &mut Display<'_>,
) -> (End, Course) {
    let mut course = Course::default();
    loop {
        let wake = display.due().map_or(deadline, |due| due.min(deadline));
        match supervisor.next(wake) {
            Happening::Result(process, line) if process == verifier => {
                match serde_json::from_str(&line) {
                    Ok(Line::Progress(progress)) => {
                        let progress = Progress {
                            expected: modules,
                            ..progress
                        };
                        if course.discovery.is_none() && progress.joined >= modules {
                            course.discovery = Some(start.elapsed());
                        }
                        display.show(&progress);
                        course.progress = progress;
                    }
                    Ok(Line::Entry(entry)) => {
                        display.hear(&entry);
                        course.recording.keep(entry);
                    }
                    Ok(Line::Agreement(mut agreement)) => {
                        agreement["outcome"] = "AGREED".into();
                        display.refresh();
                        let end = linger(supervisor, verifier, agreement);
                        return (end, course);
                    }
                    Ok(Line::Verdict(verdict)) => {
                        display.refresh();
                        let end = linger(supervisor, verifier, verdict);
                        return (end, course);
                    }
                    Err(error) => display.note(&format!(
                        "warning: the verifier wrote a line that cannot be read ({error}): {line}"
                    )),
                }
            }
            Happening::Result(..) => {}
            Happening::Exited(process, status) => {
                return (End::ProcessEnded(process, status), course);
            }
            Happening::Interrupted(signal) => return (End::Interrupted(signal), course),
            Happening::TimedOut if Instant::now() < deadline => display.refresh(),
            Happening::TimedOut => {
                return (End::TimedOut(course.progress.clone()), course);
            }
        }
    }
}

/// The verifier stays for a while, so that those who listen to its topic get the verdict; it is let finish.
fn linger(supervisor: &mut Supervisor, verifier: ProcessId, verdict: Value) -> End {
    let deadline = Instant::now() + LINGER_MAX;
    loop {
        match supervisor.next(deadline) {
            Happening::Exited(process, _) if process == verifier => break,
            Happening::TimedOut | Happening::Interrupted(_) => break,
            Happening::Exited(..) | Happening::Result(..) => {}
        }
    }
    End::Judged(verdict)
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::super::supervisor::Output;
    use super::*;

    /// Conducts a run whose processes are shell scripts, the first of them the verifier.
    fn conducted(scripts: &[&str]) -> (End, Course, Supervisor) {
        let mut supervisor = Supervisor::new(&[]).unwrap();
        let processes: Vec<ProcessId> = scripts
            .iter()
            .enumerate()
            .map(|(index, script)| {
                let mut command = Command::new("sh");
                command.args(["-c", script]);
                supervisor
                    .start(format!("process {index}"), &mut command, Output::Results)
                    .unwrap()
            })
            .collect();
        let start = Instant::now();
        let (end, course) = conduct(
            &mut supervisor,
            processes[0],
            2,
            start,
            start + Duration::from_secs(30),
            &mut Display::Lines(super::super::progress::LineThrottle::default()),
        );
        (end, course, supervisor)
    }

    #[test]
    fn a_run_ends_with_the_verdict() {
        let (end, course, mut supervisor) = conducted(&[
            r#"echo '{"progress":{"phase":"gathering","joined":1}}'
               echo 'no JSON'
               echo '{"progress":{"phase":"acting","joined":2,"planned":2,"settled":1,"new_key":3}}'
               echo '{"verdict":{"outcome":"COMPLETE"}}'"#,
            "echo '{\"verdict\":\"of no verifier\"}'; exec sleep 30",
        ]);
        let End::Judged(verdict) = end else {
            panic!("expected a verdict, got {end:?}");
        };
        assert_eq!(verdict["outcome"], "COMPLETE");
        assert_eq!(course.progress.settled, 1);
        assert!(course.discovery.is_some());
        assert_eq!(
            supervisor.stop(Duration::from_secs(30)),
            Vec::<String>::new()
        );
    }

    #[test]
    fn a_process_that_ends_early_ends_the_run() {
        let (end, _, supervisor) =
            conducted(&["exec sleep 30", "echo out of battery >&2; kill -9 $$"]);
        let End::ProcessEnded(process, status) = end else {
            panic!("expected an end, got {end:?}");
        };
        assert_eq!(supervisor.name(process), "process 1");
        assert_eq!(status.code(), None);
        assert_eq!(
            supervisor.last_lines(process).collect::<Vec<_>>(),
            ["out of battery"]
        );
    }

    #[test]
    fn a_run_that_does_not_go_on_says_where_it_stands() {
        let mut supervisor = Supervisor::new(&[]).unwrap();
        let mut command = Command::new("sh");
        command.args([
            "-c",
            r#"echo '{"progress":{"phase":"gathering","joined":1,"waiting_for":[4]}}'; exec sleep 30"#,
        ]);
        let verifier = supervisor
            .start("verifier".to_owned(), &mut command, Output::Results)
            .unwrap();
        let start = Instant::now();
        let (end, _) = conduct(
            &mut supervisor,
            verifier,
            2,
            start,
            start + Duration::from_secs(1),
            &mut Display::Lines(super::super::progress::LineThrottle::default()),
        );
        let End::TimedOut(progress) = end else {
            panic!("expected to run out of time, got {end:?}");
        };
        assert!(progress.standstill().ends_with("waiting for module 4"));
    }
}
