//! `formation studio`: a page in the browser that draws scenarios, runs them and watches them.

mod child;
mod course;
mod orders;
mod watching;

use std::env;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use anyhow::Context;
use formation_studio_server::{Backend, EventHub, Server, ServerError};
use ros_runtime::exit::{Failure, stop_requested};
use serde_json::json;

use crate::arguments::StudioArguments;
use crate::{console, scenario_file};
use child::RunProcess;
use course::Course;

/// Serves the page until a signal asks for the end, and ends with it the processes of the run.
///
/// # Errors
/// The scenario cannot be read, the port cannot be had, or the server fails.
pub fn serve(arguments: &StudioArguments) -> Result<(), Failure> {
    let given = arguments.scenario.as_deref();
    let given = given.map(scenario_file::text).transpose()?;
    let stop = stop_requested()?;
    let server = Server::listen(arguments.port).map_err(|error| match error {
        ServerError::Port { .. } => Failure::bad_input(error),
        ServerError::Token(_) | ServerError::Failed(_) => Failure::failed(error),
    })?;
    let hub = EventHub::default();
    let launcher = env::current_exe()
        .context("cannot find the launcher's own program")
        .map_err(Failure::BadInput)?;
    let studio = Arc::new_cyclic(|itself| Studio {
        itself: Weak::clone(itself),
        launcher,
        domain: arguments.domain.map(|domain| domain.to_string()),
        speed: arguments.speed.map(|speed| speed.to_string()),
        course: Mutex::new(Course::new(hub.clone(), arguments.attach, given)),
        run: Mutex::new(None),
    });
    let watching = match arguments.attach {
        true => Some(watching::start(&studio, arguments.session)?),
        false => None,
    };
    let address = server.address();
    console::result_line(&address)?;
    console::note(
        "note: whoever knows this address can use the studio; Ctrl-C ends it, and the run with it",
    );
    if arguments.open {
        open(&address);
    }
    let backend: Arc<dyn Backend> = Arc::clone(&studio) as Arc<dyn Backend>;
    let stopped = async move {
        let _ = stop.recv().await;
    };
    let served = server.serve(backend, hub, stopped);
    if let Some(watching) = watching {
        watching.end();
    }
    studio.end_run();
    served.map_err(Failure::failed)
}

/// Shows the page in the browser of the desktop, if there is one.
fn open(address: &str) {
    let mut command = Command::new("xdg-open");
    command.arg(address).stdin(Stdio::null());
    let started = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    if let Err(error) = started {
        console::note(&format!("warning: cannot start xdg-open: {error}"));
    }
}

/// What the page talks to.
pub(super) struct Studio {
    /// For the threads that follow a run.
    itself: Weak<Self>,
    /// This program, which runs and watches.
    launcher: PathBuf,
    domain: Option<String>,
    speed: Option<String>,
    course: Mutex<Course>,
    run: Mutex<Option<RunProcess>>,
}

/// What a lock protects is whole between any two statements, also if a thread panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Studio {
    /// A command of this program, in the domain that was chosen.
    fn command(&self, name: &str) -> Command {
        let mut command = Command::new(&self.launcher);
        command.arg(name);
        if let Some(domain) = &self.domain {
            command.args(["--domain", domain]);
        }
        command
    }

    /// Ends the run and its processes, if there is one.
    fn end_run(&self) {
        let run = lock(&self.run).take();
        if let Some(run) = run {
            run.end();
        }
    }

    fn course(&self) -> MutexGuard<'_, Course> {
        lock(&self.course)
    }
}

impl Backend for Studio {
    fn engine(&self, request: &str) -> String {
        formation_studio_engine::answer(request)
    }

    fn state(&self) -> String {
        self.course().state().to_string()
    }

    fn order(&self, name: &str, body: &str) -> Option<String> {
        let outcome = orders::carry_out(self, name, body)?;
        let answer = match outcome {
            Ok(()) => json!({"ok": {}}),
            Err(text) => json!({"error": {"text": text}}),
        };
        Some(answer.to_string())
    }
}
