//! `formation studio`: a page on loopback where formations are drawn, planned, run and watched.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use formation_studio_server::{Studio, Work};
use ros_runtime::exit::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

use crate::arguments::StudioArguments;
use crate::run::Programs;
use crate::{console, scenario_file};

/// Serves the page until a signal ends it.
///
/// # Errors
/// The scenario or the port is refused, or the programs of a run are missing.
pub fn run(arguments: &StudioArguments) -> Result<(), Failure> {
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // The second one ends the program at once; runs end with it.
        flag::register_conditional_default(signal, Arc::clone(&end))?;
        flag::register(signal, Arc::clone(&end))?;
    }
    let scenario = arguments.scenario.as_deref();
    let scenario = scenario.map(|path| {
        scenario_file::load(path)?;
        let text = std::fs::read_to_string(path);
        text.with_context(|| format!("cannot read {}", path.display()))
            .map_err(Failure::BadInput)
    });
    let scenario = scenario.transpose()?;
    let launcher = std::env::current_exe().context("cannot find the launcher's own program");
    let launcher = launcher.map_err(Failure::Failed)?;
    let mut options = Vec::new();
    if let Some(domain) = arguments.domain {
        options.push(format!("--domain={domain}"));
    }
    options.extend(arguments.run_option.iter().cloned());
    let command = move |verb: &'static [&'static str]| -> Box<dyn Fn() -> Command + Send + Sync> {
        Box::new(move || {
            let mut command = Command::new(&launcher);
            command.args(verb).args(&options);
            command
        })
    };
    let folder = tempfile::Builder::new()
        .prefix("formation-studio-")
        .tempdir()
        .context("cannot create a folder for what is drawn")
        .map_err(Failure::Failed)?;
    let work = if arguments.attach {
        Work::Watches {
            command: command(&["watch", "--events"]),
        }
    } else {
        Programs::next_to_launcher()?;
        Work::Runs {
            command: command(&["run", "--control"]),
            folder: folder.path().to_owned(),
        }
    };
    let studio = Studio::listen(arguments.port, work, scenario);
    let studio = studio.map_err(|error| Failure::Failed(error.into()))?;
    console::result_line(studio.address())?;
    console::note(
        "open this address in a browser on this machine; Ctrl-C ends the studio and its run",
    );
    studio
        .serve(&end)
        .map_err(|error| Failure::Failed(error.into()))
}
