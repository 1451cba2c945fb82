//! Judges a formation, independently of the planner.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use async_channel::Receiver;
use clap::Parser;
use formation_node_support::Program;
use formation_verifier_lines::ReportLine;
use ros_runtime::exit::{EXIT_GRACE, Failure, limit_exit};
use ros_runtime::settings::Settings;
use verifier::judging::JudgingArguments;
use verifier::verdict_report::{end_line, end_status, end_text};
use verifier::verification::{News, VerifierProcess};

/// How long subscribers have to take the verdict.
const LINGER: Duration = Duration::from_millis(500);

/// Observes a formation from the topics alone and judges it: exit status 0 for COMPLETE and PARTIAL, 1 for FAILED, 3 for NOT_JUDGED.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    /// Print the verdict as one line of JSON, {"verdict": ...}
    #[arg(long)]
    json: bool,
    /// Print a line of JSON, {"progress": ...}, whenever the progress changes, and the verdict likewise
    #[arg(long)]
    progress: bool,
    /// Print a line of JSON, {"entry": ...}, for every event: claims, states, poses
    #[arg(long)]
    event_log: bool,
    /// End as soon as all members agree on a plan, print it as {"agreement": ...}, and do not wait for motion
    #[arg(long)]
    plan_only: bool,
    /// Stay after the verdict, and give another one whenever it changes, as when a module falls silent; the exit status
    /// is that of the last
    #[arg(long, conflicts_with = "plan_only")]
    keep_watching: bool,
    /// Write every state that a module publishes to this file, one JSON object a line: t (by the sender's clock, in s since
    /// 1970), module, x, y (units), theta (radians), links, folding
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    judging: JudgingArguments,
}

impl Program for Arguments {
    fn run(self, mut settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        let judging = self.judging.resolve(&mut settings)?;
        let process = VerifierProcess {
            settings,
            judging,
            plan_only: self.plan_only,
            event_log: self.event_log,
            keep_watching: self.keep_watching,
            trace: self.trace,
            linger: LINGER,
        };
        let judgement = process.run(stop, |news| match news {
            News::Progress(progress) if self.progress => {
                print_line(&ReportLine::Progress(progress.clone()));
            }
            News::Progress(_) => {}
            News::Entry(entry) => print_line(&ReportLine::Entry(entry.clone())),
            News::End(end) => {
                if self.json || self.progress || self.event_log {
                    print_line(&end_line(end));
                } else {
                    print(&end_text(end));
                }
                if !self.keep_watching {
                    limit_exit(LINGER + EXIT_GRACE, end_status(end));
                }
            }
        })?;
        match &judgement.end {
            Some(end) => Ok(end_status(end)),
            None => Err(Failure::failed("stopped before there was a verdict")),
        }
    }
}

fn print_line(line: &ReportLine) {
    match serde_json::to_string(line) {
        Ok(line) => print(&line),
        Err(error) => tracing::error!("cannot write a line of the report: {error}"),
    }
}

/// Prints a line; the verifier continues to judge when the reader of its output is gone.
fn print(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
