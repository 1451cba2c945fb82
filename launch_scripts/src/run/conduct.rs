//! One run from the first process to the verdict.

use std::process::ExitStatus;
use std::time::{Duration, Instant};

use formation::event_log::Entry;
use serde::Deserialize;
use serde_json::Value;

use super::deaths::{Cast, Death, Deaths};
use super::progress::{Display, Progress};
use super::recording::Recording;
use super::supervisor::{Happening, ProcessId, Supervisor};

/// After its verdict, the verifier stays for so long, so that those who listen to its topic get it.
const LINGER: Duration = Duration::from_millis(500);
/// The verdict on what is not done in time.
const FAILED: &str = "FAILED";

/// How a run ended.
#[derive(Debug)]
pub enum End {
    /// The verifier has judged.
    Judged(Value),
    /// A process ended without which the run cannot go on.
    ProcessEnded(ProcessId, ExitStatus),
    /// All processes of modules ended, this one last.
    NobodyLeft(ProcessId, ExitStatus),
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
    /// The processes that died, and without which the run went on.
    pub deaths: Deaths,
}

impl Course {
    /// Whether the verifier counts on a module that is dead, which it may not know yet.
    fn counts_on_the_dead(&self, verdict: &Value) -> bool {
        let dead = self.deaths.modules();
        let assignments = verdict["assignments"].as_array().into_iter().flatten();
        assignments
            .filter_map(|taken| taken["module"].as_u64())
            .any(|module| dead.iter().any(|dead| u64::from(dead.0) == module))
    }
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
///
/// A process of modules that dies is told of, and the run goes on. A verdict that counts on its modules is set aside: the
/// verifier, which finds out by their silence, will take it back and give another.
pub fn conduct(
    supervisor: &mut Supervisor,
    cast: &Cast,
    modules: usize,
    start: Instant,
    deadline: Instant,
    display: &mut Display<'_>,
) -> (End, Course) {
    let mut course = Course::default();
    let mut set_aside: Option<Value> = None;
    loop {
        let wake = display.due().map_or(deadline, |due| due.min(deadline));
        match supervisor.next(wake) {
            Happening::Result(process, line) if process == cast.verifier => {
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
                        linger(supervisor, cast.verifier);
                        return (End::Judged(agreement), course);
                    }
                    Ok(Line::Verdict(verdict)) => {
                        let may_change = if verdict["outcome"] == FAILED {
                            set_aside.is_some()
                        } else {
                            course.counts_on_the_dead(&verdict)
                        };
                        if may_change {
                            set_aside = Some(verdict);
                            continue;
                        }
                        display.refresh();
                        linger(supervisor, cast.verifier);
                        return (End::Judged(verdict), course);
                    }
                    Err(error) => display.note(&format!(
                        "warning: the verifier wrote a line that cannot be read ({error}): {line}"
                    )),
                }
            }
            Happening::Result(..) => {}
            Happening::Exited(process, status) => {
                let all_joined = course.discovery.is_some();
                let target_is_known = course.progress.knows_target();
                if !cast.can_spare(process, status, all_joined, target_is_known) {
                    return (End::ProcessEnded(process, status), course);
                }
                let modules = cast.agents.get(&process).cloned().unwrap_or_default();
                let death = Death {
                    name: supervisor.name(process).to_owned(),
                    modules,
                    status,
                    after: start.elapsed(),
                };
                display.note(&format!("{death}; the run goes on without it"));
                course.deaths.push(death);
                if course.deaths.of_agents() == cast.agents.len() {
                    return (End::NobodyLeft(process, status), course);
                }
            }
            Happening::Interrupted(signal) => return (End::Interrupted(signal), course),
            Happening::TimedOut if Instant::now() < deadline => display.refresh(),
            Happening::TimedOut => {
                let end = match set_aside {
                    Some(mut verdict) => {
                        verdict["outcome"] = FAILED.into();
                        End::Judged(verdict)
                    }
                    None => End::TimedOut(course.progress.clone()),
                };
                return (end, course);
            }
        }
    }
}

fn linger(supervisor: &mut Supervisor, verifier: ProcessId) {
    let deadline = Instant::now() + LINGER;
    loop {
        match supervisor.next(deadline) {
            Happening::Exited(process, _) if process == verifier => break,
            Happening::TimedOut | Happening::Interrupted(_) => break,
            Happening::Exited(..) | Happening::Result(..) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::process::Command;

    use formation::model::ModuleId;

    use super::super::supervisor::Output;
    use super::*;

    /// Conducts a run whose processes are shell scripts: the verifier, the target publisher, and processes of modules 1, 2
    /// and so on.
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
        let agents = processes[2..].iter().copied().zip(1..);
        let cast = Cast {
            verifier: processes[0],
            target_publisher: processes[1],
            agents: agents
                .map(|(process, module)| (process, vec![ModuleId(module)]))
                .collect(),
        };
        let start = Instant::now();
        let (end, course) = conduct(
            &mut supervisor,
            &cast,
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
            "exec sleep 30",
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

    /// Waits until a file is there that another script makes; the scripts of a test share a directory.
    fn await_file(name: &str) -> String {
        format!("while [ ! -e {name} ]; do sleep 0.02; done")
    }

    #[test]
    fn a_process_without_which_nothing_goes_on_ends_the_run() {
        let stay = "exec sleep 30";
        for (scripts, name) in [
            (["exit 3", stay, stay, stay], "process 0"),
            ([stay, "kill -9 $$", stay, stay], "process 1"),
            (
                [stay, stay, stay, "echo out of battery >&2; exit 9"],
                "process 3",
            ),
        ] {
            let (end, _, supervisor) = conducted(&scripts);
            let End::ProcessEnded(process, _) = end else {
                panic!("expected an end, got {end:?}");
            };
            assert_eq!(supervisor.name(process), name);
        }
    }

    #[test]
    fn a_run_goes_on_without_the_dead_and_ends_with_the_last_of_them() {
        let (end, course, supervisor) = conducted(&[
            "exec sleep 30",
            "exec sleep 30",
            "kill -9 $$",
            "sleep 0.5; kill -9 $$",
        ]);
        let End::NobodyLeft(process, status) = end else {
            panic!("expected that nobody is left, got {end:?}");
        };
        assert_eq!(supervisor.name(process), "process 3");
        assert_eq!(status.code(), None);
        assert_eq!(course.deaths.modules_text(), "modules 1-2");
        let told: Vec<String> = course.deaths.iter().map(ToString::to_string).collect();
        assert!(
            told[0].starts_with("process 2 ended with signal: 9 (SIGKILL) after 0."),
            "{told:?}"
        );
    }

    #[test]
    fn a_verdict_that_counts_on_the_dead_is_not_the_last_word() {
        let directory = tempfile::tempdir().unwrap();
        let died = directory.path().join("died").display().to_string();
        let verdict = |outcome: &str, module: u32| {
            format!(
                r#"echo '{{"verdict":{{"outcome":"{outcome}","assignments":[{{"module":{module},"spot":1}}]}}}}'"#
            )
        };
        let verifier = [
            await_file(&died),
            "sleep 1".to_owned(),
            verdict("COMPLETE", 1),
            verdict("FAILED", 1),
            verdict("COMPLETE", 2),
            "exec sleep 30".to_owned(),
        ]
        .join("\n");
        let (end, course, _) = conducted(&[
            &verifier,
            "exec sleep 30",
            &format!("touch {died}; kill -9 $$"),
            "exec sleep 30",
        ]);
        let End::Judged(verdict) = end else {
            panic!("expected a verdict, got {end:?}");
        };
        assert_eq!(verdict["assignments"][0]["module"], 2);
        assert_eq!(course.deaths.modules_text(), "module 1");
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
        let cast = Cast {
            verifier,
            target_publisher: verifier,
            agents: BTreeMap::new(),
        };
        let start = Instant::now();
        let (end, _) = conduct(
            &mut supervisor,
            &cast,
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
