//! `formation run`: every module in a process of its own, and a verdict from an independent one.

mod attendance;
mod attended;
mod claim;
mod display;
mod domain;
mod lines;
mod network;
pub mod operator;
mod operator_commands;
mod outputs;
mod page;
mod processes;
mod programs;
mod recording;
mod report;
mod roles;
mod router;
mod run_loop;
mod sockets;
mod start;
mod stores;
mod supervisor;
mod tail;
mod view;
mod watch;

use std::collections::BTreeSet;
use std::process::ExitStatus;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use formation_model::Scenario;
use formation_offline::CheckedPlan;
use ros_runtime::exit::Failure;
use serde::Serialize;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::arguments::RunArguments;
use crate::plan_output::PlanOutput;
use crate::report::ReportDirectory;
use crate::{check, console, scenario_file};
use attendance::Attendance;
#[cfg(feature = "studio")]
pub use attendance::{OrderLine, RunOrder};
use display::Display;
pub use display::progress_line;
pub use lines::RunLine;
#[cfg(feature = "studio")]
pub use lines::RunVerdict;
pub use network::environment_of_runs;
pub use programs::Programs;
use programs::RECORDER;
#[cfg(feature = "recordings")]
pub use recording::Recording;
use report::{RunOutcome, RunReport};
use router::Carrier;
use run_loop::{Judgement, Observed, RunEnd, RunLoop};
use start::Start;
use stores::RunStores;
use supervisor::{ProcessId, Supervisor};
#[cfg(feature = "studio")]
pub use tail::for_each_line;
pub use watch::watch;

/// How long a process may take to leave the ROS 2 graph after SIGTERM.
const STOP_GRACE: Duration = Duration::from_secs(5);
/// The verifier judges when the time is up, unless it waits for what may be mended; the launcher waits this much longer for the verdict.
const VERDICT_MARGIN: Duration = Duration::from_secs(10);

/// Runs a scenario with real processes and prints the result.
///
/// # Errors
/// Says why the run cannot begin, which process failed, or what is wrong with the formation.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    let path = arguments.scenario.as_path();
    // Every process reads it again, and so does the launcher when it restarts itself.
    if scenario_file::is_standard_input(path)
        || path
            .metadata()
            .is_ok_and(|file| !file.is_file() && !file.is_dir())
    {
        return Err(Failure::BadInput(anyhow!(
            "{}: is no regular file, but every process has to read it",
            scenario_file::named(path)
        )));
    }
    let scenario = scenario_file::load_formable(path)?;
    let programs = Programs::next_to_launcher()?;
    if arguments.motion.world.world {
        programs.require(start::WORLD)?;
    }
    if arguments.record.is_some() {
        programs.require(RECORDER)?;
    }
    outputs::check(arguments)?;
    let hosts = processes::hosts(scenario.problem(), arguments.modules_per_process);
    let modules = scenario.problem().modules().len();
    let middleware = router::middleware(arguments, hosts.len())?;
    router::check_security(arguments, middleware)?;
    let mut place = network::prepare(arguments, middleware, modules, hosts.len())?;
    let plan = planned(arguments, &scenario)?;
    let directory = arguments
        .report
        .as_deref()
        .map(ReportDirectory::create)
        .transpose()?;
    let stores = RunStores::prepare(arguments)?;
    place.announce(stores.session);
    // Ends after the processes, when all has been printed.
    let carrier = Carrier::start(middleware, arguments.security.as_deref())?;
    let start = Start {
        arguments,
        carrier: &carrier,
        stores: &stores,
        problem: scenario.problem(),
        module_size: scenario.module_size().unwrap_or_default(),
        programs: &programs,
        hosts: &hosts,
        environment: place.environment,
    };
    let mut display = match arguments.attended {
        true => {
            lines::print(&RunLine::Place {
                domain: start.environment.domain.number(),
                session: stores.session.into(),
            });
            Display::Program
        }
        false => Display::start(scenario.name(), &plan),
    };
    let (judgement, observed) = form(&start, &mut display)?;
    let Some(judgement) = judgement.transpose() else {
        return Ok(());
    };
    let result =
        judgement.map(|judgement| RunReport::new(&plan, judgement, &observed, arguments.timeout));
    let session = stores.session;
    if let Some(directory) = directory {
        // What was observed of a run without a verdict may say why there is none.
        let report = result.as_ref();
        if let Ok(report) = report {
            directory.write_json(&OfSession { session, report })?;
        }
        let course = observed.recording.entries();
        let subject = page::subject(&plan, scenario.name(), course, report.ok());
        let summary = page::summary(&plan, arguments, &observed.recording, report);
        directory.write_pictures(&subject, course, &summary)?;
    }
    let report = result?;
    if arguments.json {
        let report = &report;
        console::result_json(&OfSession { session, report })?;
    } else {
        console::result_text(&report.text(&plan, scenario.name()))?;
    }
    report.conclusion()?;
    // Modules that only agree find nothing wrong with a hole that all of them plan.
    match report.outcome() {
        RunOutcome::Agreed => plan.refuse_hole(path),
        RunOutcome::Judged(_) => Ok(()),
    }
}

/// The plan of a scenario that processes may carry out, with its warnings.
///
/// # Errors
/// It takes too long, does not keep its guarantees, or moves nothing.
fn planned(arguments: &RunArguments, scenario: &Scenario) -> Result<Arc<CheckedPlan>, Failure> {
    let path = arguments.scenario.as_path();
    check::refuse_long_plans(path, scenario)?;
    check::warn(path, scenario);
    let plan = Arc::new(CheckedPlan::of(scenario)?);
    plan.refuse_without_motion(path)?;
    if arguments.motion.world.is_differential() {
        check::refuse_turning(path, scenario)?;
    }
    plan.warn(path);
    if let Some(hole) = plan.hole_text() {
        console::note(&format!("warning: {}: {hole}", scenario_file::named(path)));
    }
    Ok(plan)
}

/// A report as `--json` prints it.
#[derive(Serialize)]
struct OfSession<'a> {
    session: u32,
    #[serde(flatten)]
    report: &'a RunReport,
}

/// Starts all processes, waits for the verdict and stops them again. Returns what was observed also of a run without a
/// verdict. There is none of a run that a program attended to its end.
///
/// # Errors
/// Says what could not be started.
fn form(
    start: &Start<'_>,
    display: &mut Display,
) -> Result<(Result<Option<Judgement>, Failure>, Observed), Failure> {
    let mut supervisor = Supervisor::new(&[SIGINT, SIGTERM, SIGHUP])
        .context("cannot handle signals")
        .map_err(Failure::Failed)?;
    let is_attended = start.arguments.attended;
    if is_attended {
        let reading = supervisor.read_orders();
        reading
            .context("cannot read orders")
            .map_err(Failure::Failed)?;
    }
    let began = Instant::now();
    let ended = start.all(&mut supervisor).map(|roles| {
        // The verifier's time begins with the target, which is announced last.
        let patience = match is_attended {
            true => attendance::WITHOUT_END,
            false => start.arguments.timeout + VERDICT_MARGIN,
        };
        for modules in roles.agents.values() {
            display.show_process(modules, true);
        }
        RunLoop {
            supervisor: &mut supervisor,
            roles,
            modules: start.problem.modules().len(),
            start: began,
            deadline: Instant::now() + patience,
            patience,
            display,
            observed: Observed::default(),
            orders: start.orders(),
            order_givers: BTreeSet::new(),
            attendance: is_attended.then(|| Attendance::new(start)),
        }
        .run()
    });
    display.finish();
    let killed = supervisor.stop(STOP_GRACE);
    for (name, line) in supervisor.errors() {
        console::note(&format!("{name}: {line}"));
    }
    if !killed.is_empty() {
        console::note(&format!(
            "warning: had to be killed, as SIGTERM did not end it: {}",
            killed.join(", ")
        ));
    }
    let (end, observed) = ended?;
    let failed = |what: String| Err(Failure::Failed(anyhow!(what)));
    let judgement = match end {
        RunEnd::Judged(judgement) => Ok(Some(judgement)),
        RunEnd::Dismissed => Ok(None),
        RunEnd::ProcessEnded(process, status) => {
            let what = anyhow!(process_ended(&supervisor, process, status));
            Err(match roles::is_bad_input(status) {
                true => Failure::BadInput(what),
                false => Failure::Failed(what),
            })
        }
        RunEnd::NoAgentLeft(process, status) => failed(format!(
            "no process of modules is left before there was a verdict; {} ended last, with {status}",
            supervisor.name(process)
        )),
        RunEnd::Interrupted(signal) => Err(Failure::Interrupted(
            format!(
                "interrupted by {}; every process was stopped",
                signal_name(signal)
            ),
            signal,
        )),
        RunEnd::TimedOut => failed(format!(
            "no verdict within {} s; {}",
            start.arguments.timeout.as_secs_f64(),
            match &observed.progress {
                Some(progress) => progress_line(progress),
                None => "the verifier reported no progress".to_owned(),
            }
        )),
    };
    Ok((judgement, observed))
}

/// Names the process that ended, and shows its last lines.
fn process_ended(supervisor: &Supervisor, process: ProcessId, status: ExitStatus) -> String {
    let name = supervisor.name(process);
    let mut words = "it wrote nothing";
    for line in supervisor.last_lines(process) {
        console::note(&format!("{name}: {line}"));
        words = "its last lines are above";
    }
    format!("{name} ended with {status} before there was a verdict; {words}")
}

fn signal_name(signal: i32) -> &'static str {
    match signal {
        SIGINT => "SIGINT (Ctrl-C)",
        SIGTERM => "SIGTERM",
        SIGHUP => "SIGHUP",
        _ => "a signal",
    }
}
