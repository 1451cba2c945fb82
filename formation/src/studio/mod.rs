//! `formation studio`: a page on loopback where formations are drawn, planned, run and watched.

mod run;

use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::thread;

use anyhow::Context;
use async_channel::{Receiver, bounded};
use formation_studio_server::{EventLog, Server};
use ros_runtime::exit::{Failure, STATUS_FAILED};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::arguments::StudioArguments;
use crate::run::Programs;
use crate::{console, scenario_file};
use run::{StudioRun, Work};

/// Serves the page until a signal ends it.
///
/// # Errors
/// The scenario or the port is refused, or the programs of a run are missing.
pub fn run(arguments: &StudioArguments) -> Result<(), Failure> {
    let stop = stop_requested()?;
    let scenario = arguments.scenario.as_deref();
    let scenario = scenario.map(|path| {
        scenario_file::load(path)?;
        let text = std::fs::read_to_string(path);
        text.with_context(|| format!("cannot read {}", path.display()))
            .map_err(Failure::BadInput)
    });
    let scenario = scenario.transpose()?;
    let folder = tempfile::Builder::new()
        .prefix("formation-studio-")
        .tempdir()
        .context("cannot create a folder for what is drawn")
        .map_err(Failure::Failed)?;
    let log = EventLog::default();
    let work = work(arguments, folder.path().to_owned())?;
    let server = Server::listen(arguments.port);
    let server = server.map_err(|error| Failure::Failed(error.into()))?;
    let studio = Arc::new(StudioRun::new(work, log.clone(), scenario)?);
    console::result_line(&server.address())?;
    console::note(
        "open this address in a browser on this machine; Ctrl-C ends the studio and its run",
    );
    let stopped = async move {
        // It is closed only by a signal.
        let _ = stop.recv().await;
    };
    let served = server.serve(Arc::clone(&studio) as _, log, stopped);
    studio.end();
    served.map_err(|error| Failure::Failed(error.into()))
}

/// What the page may do, and by which command.
fn work(arguments: &StudioArguments, folder: PathBuf) -> Result<Work, Failure> {
    let launcher = std::env::current_exe().context("cannot find the launcher's own program");
    let launcher = launcher.map_err(Failure::Failed)?;
    let verb = match arguments.attach {
        true => ["watch", "--events"],
        false => ["run", "--control"],
    };
    let mut options: Vec<String> = verb.map(str::to_owned).into();
    options.extend(arguments.domain.map(|domain| format!("--domain={domain}")));
    options.extend(arguments.run_option.iter().cloned());
    let command = Box::new(move || {
        let mut command = Command::new(&launcher);
        command.args(&options);
        command
    });
    if arguments.attach {
        return Ok(Work::Watches { command });
    }
    Programs::next_to_launcher()?;
    Ok(Work::Runs { command, folder })
}

/// Yields at the first signal that asks the studio to end; the second ends it at once, and its run ends with it.
fn stop_requested() -> Result<Receiver<()>, Failure> {
    let (sender, receiver) = bounded(1);
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let threads = thread::Builder::new().name("signals".to_owned());
    threads.spawn(move || {
        for _ in signals.forever() {
            if sender.try_send(()).is_err() {
                std::process::exit(STATUS_FAILED.into());
            }
        }
    })?;
    Ok(receiver)
}
