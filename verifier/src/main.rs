//! Judges a formation, independently of the planner.

use std::io::{self, Write};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use formation::verify::ReportLine;
use ros_runtime::arguments::{self, NetworkArguments};
use ros_runtime::lifetime::{EXIT_GRACE, limit_exit, stop_requested};
use ros_runtime::outcome::{Failure, conclude};
use verifier::judging::JudgingArguments;
use verifier::verdict_report::{end_line, end_status, end_text};
use verifier::verification::{News, VerifierProcess};

/// After the verdict, subscribers have so long to take it.
const LINGER: Duration = Duration::from_millis(500);

/// Watches a formation from the topics alone and judges it: exit status 0 for COMPLETE and PARTIAL, 1 for FAILED.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Print the verdict as one line of JSON, {"verdict": ...}
    #[arg(long)]
    json: bool,
    /// Print a line of JSON, {"progress": ...}, whenever the progress changes, and the verdict likewise
    #[arg(long)]
    progress: bool,
    /// Print a line of JSON, {"entry": ...}, for everything that happens: claims, states, poses
    #[arg(long)]
    event_log: bool,
    /// Be content as soon as all members agree on a plan, print it as {"agreement": ...}, and do not wait for motion
    #[arg(long)]
    plan_only: bool,
    /// Stay after the verdict, and give another one whenever it changes, as when a module falls silent; the exit status
    /// is that of the last
    #[arg(long, conflicts_with = "plan_only")]
    keep_watching: bool,
    #[command(flatten)]
    judging: JudgingArguments,
    #[command(flatten)]
    network: NetworkArguments,
}

fn main() -> ExitCode {
    conclude(run())
}

fn run() -> Result<u8, Failure> {
    let (arguments, ros) = arguments::parse::<Arguments>()?;
    let settings = arguments.network.start(ros)?;
    let parameters = arguments.judging.parameters()?;
    let stop = stop_requested()?;
    let process = VerifierProcess {
        settings,
        parameters,
        plan_only: arguments.plan_only,
        event_log: arguments.event_log,
        keep_watching: arguments.keep_watching,
        linger: LINGER,
    };
    let judgement = process.run(&stop, |news| match news {
        News::Progress(progress) if arguments.progress => {
            print_line(&ReportLine::Progress(progress.clone()));
        }
        News::Progress(_) => {}
        News::Entry(entry) => print_line(&ReportLine::Entry(entry.clone())),
        News::End(end) => {
            if arguments.json || arguments.progress || arguments.event_log {
                print_line(&end_line(end));
            } else {
                print(&end_text(end));
            }
            if arguments.keep_watching {
                return;
            }
            limit_exit(LINGER + EXIT_GRACE, end_status(end));
        }
    })?;
    match &judgement.end {
        Some(end) => Ok(end_status(end)),
        None => Err(Failure::failed("stopped before there was a verdict")),
    }
}

fn print_line(line: &ReportLine) {
    match serde_json::to_string(line) {
        Ok(line) => print(&line),
        Err(error) => tracing::error!("cannot write a line of the report: {error}"),
    }
}

/// The verifier continues to judge when the reader of its output is gone.
fn print(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}
