//! What a page orders. Nothing of it is executed but scenarios, which are validated as files are.

use std::fs;
use std::path::Path;

use formation_model::{ModuleId, Scenario};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use tempfile::TempDir;

use super::child::RunProcess;
use super::{Studio, lock};
use crate::arguments::MODULES_PER_PROCESS_MAX;
use crate::run::RunOrder;
use crate::{check, scenario_file};

/// A run shares its modules out among at most this many processes, unless the page says otherwise.
const PROCESSES_MAX: usize = 50;
/// How many targets one run forms, as each is kept in a file.
const TARGETS_MAX: usize = 1_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NewRun {
    yaml: String,
    #[serde(default)]
    options: RunOptions,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunOptions {
    modules_per_process: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NextTarget {
    yaml: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneModule {
    module: ModuleId,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Push {
    module: ModuleId,
    /// How far along each axis, in units.
    x: f64,
    y: f64,
}

/// Carries out an order; `None` if there is none of this name.
pub fn carry_out(studio: &Studio, name: &str, body: &str) -> Option<Result<(), String>> {
    let order: fn(&Studio, &str) -> Result<(), String> = match name {
        "run" => run,
        "run/target" => next_target,
        "run/kill" => |studio, body| give(studio, RunOrder::Kill(read::<OneModule>(body)?.module)),
        "run/restart" => {
            |studio, body| give(studio, RunOrder::Restart(read::<OneModule>(body)?.module))
        }
        "run/retire" => {
            |studio, body| give(studio, RunOrder::Retire(read::<OneModule>(body)?.module))
        }
        "run/rejoin" => {
            |studio, body| give(studio, RunOrder::Rejoin(read::<OneModule>(body)?.module))
        }
        "run/push" => |studio, body| {
            let Push { module, x, y } = read(body)?;
            give(studio, RunOrder::Push(module, x, y))
        },
        "run/stop" => |studio, _| give(studio, RunOrder::Stop),
        "run/resume" => |studio, _| give(studio, RunOrder::Resume),
        "run/end" => |studio, _| {
            studio.end_run();
            Ok(())
        },
        _ => return None,
    };
    if studio.course().is_read_only() {
        let refused = "this page only watches: it was started with --attach";
        return Some(Err(refused.to_owned()));
    }
    Some(order(studio, body))
}

fn read<T: DeserializeOwned>(body: &str) -> Result<T, String> {
    serde_json::from_str(body).map_err(|error| format!("the request cannot be read: {error}"))
}

fn give(studio: &Studio, order: RunOrder) -> Result<(), String> {
    let given = {
        let mut run = lock(&studio.run);
        let over = studio.course().is_over();
        let run = run.as_mut().filter(|_| !over).ok_or("nothing runs")?;
        run.give(order)?
    };
    // Others may give orders meanwhile.
    given.answer()
}

/// Validates a scenario as a file of the user is, and writes it to one.
fn keep(yaml: &str, path: &Path) -> Result<Scenario, String> {
    let scenario = scenario_file::read(yaml).map_err(|failure| failure.to_string())?;
    scenario
        .check_formable()
        .map_err(|error| error.to_string())?;
    let named = Path::new("the scenario");
    check::refuse_long_plans(named, &scenario).map_err(|failure| failure.to_string())?;
    fs::write(path, yaml).map_err(|error| format!("the scenario cannot be written: {error}"))?;
    Ok(scenario)
}

fn run(studio: &Studio, body: &str) -> Result<(), String> {
    let NewRun { yaml, options } = read(body)?;
    let mut present = lock(&studio.run);
    if !studio.course().is_over() {
        return Err("a run is under way; end it first, or draw its next target".to_owned());
    }
    let files = tempfile::Builder::new()
        .prefix("formation-studio-")
        .tempdir();
    let files: TempDir =
        files.map_err(|error| format!("there is no place for the scenario: {error}"))?;
    let path = files.path().join("scenario.yaml");
    let scenario = keep(&yaml, &path)?;
    let modules = scenario.problem().modules().len();
    let fitting = modules.div_ceil(PROCESSES_MAX).max(1);
    let per_process = options.modules_per_process.unwrap_or(fitting);
    if !(1..=MODULES_PER_PROCESS_MAX).contains(&per_process) {
        return Err(format!(
            "modules_per_process must be from 1 to {MODULES_PER_PROCESS_MAX}"
        ));
    }
    let mut command = studio.command("run");
    command.arg("--attended");
    command.args(["--modules-per-process", &per_process.to_string()]);
    if let Some(speed) = &studio.speed {
        command.args(["--speed", speed]);
    }
    command.arg(&path);
    // Before its first line.
    studio
        .course()
        .begin(Some(yaml), "the processes are starting");
    let itself = studio.itself.upgrade().ok_or("the server ends")?;
    match RunProcess::start(&itself, command, files) {
        Ok(run) => {
            // What is left of the run before has ended.
            *present = Some(run);
            Ok(())
        }
        Err(error) => {
            let text = format!("the run cannot be started: {error}");
            studio.course().end(&text);
            Err(text)
        }
    }
}

fn next_target(studio: &Studio, body: &str) -> Result<(), String> {
    let NextTarget { yaml } = read(body)?;
    let given = {
        let mut run = lock(&studio.run);
        let over = studio.course().is_over();
        let run = run.as_mut().filter(|_| !over).ok_or("nothing runs")?;
        if run.files_count >= TARGETS_MAX {
            return Err(format!("one run forms at most {TARGETS_MAX} targets"));
        }
        let path = run
            .files
            .path()
            .join(format!("target_{}.yaml", run.files_count));
        keep(&yaml, &path)?;
        run.files_count += 1;
        run.give(RunOrder::Target(path))?
    };
    given.answer()?;
    studio.course().begin_target(yaml);
    Ok(())
}
