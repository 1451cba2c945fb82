//! A policy that is a program: it reads the instance as JSON and answers an allocation as JSON. docs/own_policy.md describes both.

use std::io::{Read, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use formation_model::{ModuleId, PlanningProblem, RawGiven, RawGivenSpot, SpotId};
use formation_offline::PolicyInstance;
use formation_planner::given_by;
use rustix::process::{Pid, Signal, kill_process_group};
use serde::Deserialize;
use thiserror::Error;

/// The longest answer.
const ANSWER_BYTES_MAX: u64 = 16 << 20;

/// Between two looks at whether the program has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Why a program gave no allocation that can be carried out.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// It could not be started.
    #[error("cannot be started: {0}")]
    Start(std::io::Error),
    /// It did not end in time, and was killed.
    #[error("has not ended within {} s, and was stopped; --program-timeout gives it longer", .0.as_secs_f64())]
    TimeOut(Duration),
    /// It ended with another status than 0.
    #[error("ended with {0}")]
    Ended(ExitStatus),
    /// Its output is longer than an answer can be.
    #[error("wrote more than {ANSWER_BYTES_MAX} bytes")]
    TooLong,
    /// Its output is no answer.
    #[error("wrote no answer as docs/own_policy.md describes it: {0}")]
    NotUnderstood(String),
    /// The allocation cannot be carried out.
    #[error("answered what cannot be carried out: {0}")]
    Refused(String),
}

/// What the program answers.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    allocation: Vec<RawGivenSpot>,
    /// The modules that leave their configuration; those that its spots tear off if left out.
    detached: Option<Vec<u32>>,
}

/// The problem under the policy `given`, with the allocation that the program answers.
///
/// # Errors
/// Says what the program did, or what is wrong with its answer.
pub fn ask(
    command: &str,
    problem: &PlanningProblem,
    limit: Duration,
) -> Result<Arc<PlanningProblem>, ProgramError> {
    let instance = serde_json::to_vec(&PolicyInstance::of(problem))
        .map_err(|error| ProgramError::NotUnderstood(error.to_string()))?;
    let output = output_of(command, instance, limit)?;
    let answer: Answer = serde_json::from_slice(&output)
        .map_err(|error| ProgramError::NotUnderstood(error.to_string()))?;
    let pairs = answer.allocation.iter();
    let pairs: Vec<(ModuleId, SpotId)> = pairs
        .map(|entry| (ModuleId(entry.module), SpotId(entry.spot)))
        .collect();
    let given = match answer.detached {
        None => given_by(problem, &pairs),
        Some(detached) => RawGiven {
            allocation: answer.allocation,
            detached,
        },
    };
    let under = problem.with_given(&given).map_err(|error| {
        let text = error.to_string();
        // The program knows no target section.
        ProgramError::Refused(text.replacen("target.", "", 1))
    })?;
    Ok(Arc::new(under))
}

/// What a program writes to its standard output, given this on its standard input.
fn output_of(command: &str, input: Vec<u8>, limit: Duration) -> Result<Vec<u8>, ProgramError> {
    let deadline = Instant::now() + limit;
    let mut child = Command::new("sh")
        .args(["-c", command])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        // What it starts is stopped with it.
        .process_group(0)
        .spawn()
        .map_err(ProgramError::Start)?;
    let (stdin, stdout) = (child.stdin.take(), child.stdout.take());
    // Ends with the program, which may not read all of it.
    thread::spawn(move || stdin.map(|mut stdin| stdin.write_all(&input)));
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut output = Vec::new();
        let mut stdout = stdout.map(|stdout| stdout.take(ANSWER_BYTES_MAX + 1));
        let read = stdout
            .as_mut()
            .map(|stdout| stdout.read_to_end(&mut output));
        // Nobody waits for it once the time is up.
        let _ = sender.send(read.transpose().map(|_| output));
    });
    let left = deadline.saturating_duration_since(Instant::now());
    let Ok(output) = receiver.recv_timeout(left) else {
        return Err(stop(&mut child, ProgramError::TimeOut(limit)));
    };
    let output = match output {
        Ok(output) if output.len() as u64 <= ANSWER_BYTES_MAX => output,
        Ok(_) => return Err(stop(&mut child, ProgramError::TooLong)),
        Err(error) => {
            let error = ProgramError::NotUnderstood(error.to_string());
            return Err(stop(&mut child, error));
        }
    };
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(output),
            Ok(Some(status)) => return Err(ProgramError::Ended(status)),
            Ok(None) if Instant::now() < deadline => thread::sleep(POLL_INTERVAL),
            Ok(None) => return Err(stop(&mut child, ProgramError::TimeOut(limit))),
            Err(error) => return Err(stop(&mut child, ProgramError::Start(error))),
        }
    }
}

/// Ends a program with all that it has started; hands on why.
fn stop(child: &mut Child, why: ProgramError) -> ProgramError {
    // If it has ended meanwhile, there is nothing to end.
    let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    let _ = child.wait();
    why
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{Assignment, Scenario};

    const PAIR: &str = "{target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}], edges: [[1, 2]]}, \
                        singletons: [{id: 3, x: 0, y: 0}, {id: 4, x: 2, y: 0}]}";
    const LIMIT: Duration = Duration::from_secs(60);

    fn answered(answer: &str) -> Result<Arc<PlanningProblem>, ProgramError> {
        let scenario = Scenario::from_yaml(PAIR).unwrap();
        ask(
            &format!("cat >/dev/null; echo '{answer}'"),
            scenario.problem(),
            LIMIT,
        )
    }

    #[test]
    fn an_answer_is_given_to_the_modules() {
        let pairs = [(3, 2), (4, 1)].map(|(module, spot)| Assignment {
            module: ModuleId(module),
            spot: SpotId(spot),
        });
        let problem = answered(&serde_json::json!({ "allocation": pairs }).to_string()).unwrap();
        let given = problem.target().given().unwrap();
        assert!(given.assignments().eq(pairs));
    }

    #[test]
    fn what_is_wrong_with_an_answer_is_named() {
        for (answer, expected) in [
            (
                r#"{"allocation": [{"module": 3, "spot": 9}]}"#,
                "answered what cannot be carried out: allocation[0].spot: spot 9 is not in the target",
            ),
            (
                r#"{"allocation": [{"module": 3, "spot": 1}]}"#,
                "answered what cannot be carried out: allocation: module 4 is missing, although there are spots for all modules",
            ),
            (
                r#"{"alocation": []}"#,
                "wrote no answer as docs/own_policy.md describes it: unknown field `alocation`, expected `allocation` or `detached` at line 1 column 12",
            ),
            (
                "",
                "wrote no answer as docs/own_policy.md describes it: EOF while parsing a value at line 2 column 0",
            ),
        ] {
            assert_eq!(answered(answer).unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn a_program_that_fails_or_hangs_is_named() {
        let scenario = Scenario::from_yaml(PAIR).unwrap();
        let ask = |command: &str, limit| {
            ask(command, scenario.problem(), limit)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(ask("exit 3", LIMIT), "ended with exit status: 3");
        let soon = Duration::from_millis(100);
        let expected =
            "has not ended within 0.1 s, and was stopped; --program-timeout gives it longer";
        assert_eq!(ask("sleep 1000", soon), expected);
        assert_eq!(ask("exec >&-; sleep 1000", soon), expected);
    }
}
