//! `formation run`: every module its own process, a verdict from an independent one.

mod conduct;
mod deaths;
mod network;
mod processes;
mod programs;
mod progress;
mod recording;
mod report;
mod supervisor;
mod tail;
mod view;

use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitStatus};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use formation::model::Scenario;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::arguments::{MotionMode, RunArguments, Switch};
use crate::failure::Failure;
use crate::plan::CheckedPlan;
use crate::report::ReportDirectory;
use crate::{check, console, scenario_file};
use conduct::{Course, End, conduct};
use deaths::Cast;
use network::Surroundings;
pub use processes::MODULES_PER_PROCESS_MAX;
use processes::{Host, hosts, id_list};
use programs::Programs;
use progress::Display;
use report::RunReport;
use supervisor::{Output, ProcessId, Supervisor};

/// After SIGTERM, so long a process may take to leave the ROS 2 graph.
const STOP_GRACE: Duration = Duration::from_secs(5);
/// The verifier gives its verdict when the time is up; so much later the launcher stops waiting for it.
const VERDICT_MARGIN: Duration = Duration::from_secs(5);
/// With more processes of modules than these, the endpoints of the parameter services make discovery too slow:
/// 0.7 s for 17 and 1.6 s for 25 with them, 0.6 s and 1.1 s without, but 7.1 s for 40 against 3.4 s.
const PARAMETER_SERVICES_PROCESSES_MAX: usize = 25;
/// Besides those of the modules: the target publisher and the verifier.
const OTHER_PROCESSES: usize = 2;

/// Runs a scenario with real processes and prints what came of it.
///
/// # Errors
/// Says what forbids to begin, which process failed, or what is wrong with the formation.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    let path = arguments.scenario.as_path();
    // Every process reads it again, and so does the launcher when it starts anew.
    if path
        .metadata()
        .is_ok_and(|file| !file.is_file() && !file.is_dir())
    {
        return Err(Failure::BadInput(anyhow!(
            "{}: is no regular file, but every process has to read it",
            path.display()
        )));
    }
    let scenario = scenario_file::load(path)?;
    let programs = Programs::beside_launcher()?;
    let hosts = hosts(scenario.problem(), arguments.modules_per_process);
    let surroundings = network::settle(arguments, scenario.problem().modules().len(), hosts.len())?;
    check::warn(path, &scenario);
    let plan = CheckedPlan::of(&scenario)?;
    plan.warn(path);
    let directory = arguments
        .report
        .as_deref()
        .map(ReportDirectory::create)
        .transpose()?;
    let formation = Formation {
        arguments,
        scenario: &scenario,
        plan: &plan,
        programs: &programs,
        hosts: &hosts,
        surroundings,
    };
    let (verdict, course) = formation.form()?;
    let recording = &course.recording;
    let verdict = match verdict {
        Ok(verdict) => verdict,
        Err(failure) => {
            // What was seen until then may say why.
            if let Some(directory) = directory {
                let summary = recording.summary(&plan, arguments, None, Some(&failure.to_string()));
                let subject = recording.subject(&plan, scenario.name(), None);
                directory.write_pictures(&subject, recording.entries(), &summary)?;
            }
            return Err(failure);
        }
    };
    let report = RunReport::new(&plan, &verdict, &course)?;
    if let Some(directory) = directory {
        directory.write_json(report.json())?;
        let summary = recording.summary(&plan, arguments, Some(&report), None);
        let subject = recording.subject(&plan, scenario.name(), Some(&report));
        directory.write_pictures(&subject, recording.entries(), &summary)?;
    }
    if arguments.json {
        console::result_json(report.json())?;
    } else {
        console::result_line(&report.text(&plan, scenario.name()))?;
    }
    report.conclusion()
}

struct Formation<'a> {
    arguments: &'a RunArguments,
    scenario: &'a Scenario,
    plan: &'a CheckedPlan,
    programs: &'a Programs,
    hosts: &'a [Host],
    surroundings: Surroundings,
}

impl Formation<'_> {
    /// Starts all processes, waits for the verdict and stops them again. Whatever came of it, what was seen on the way
    /// comes with it.
    ///
    /// # Errors
    /// Says what could not be started.
    fn form(&self) -> Result<(Result<serde_json::Value, Failure>, Course), Failure> {
        let mut supervisor = Supervisor::new(&[SIGINT, SIGTERM, SIGHUP])
            .context("cannot handle signals")
            .map_err(Failure::Failed)?;
        let mut display = Display::start(self.scenario.name(), self.plan);
        let start = Instant::now();
        let ended = self.start_all(&mut supervisor).map(|cast| {
            // The verifier's time begins with the target, which is announced last.
            let deadline = Instant::now() + self.arguments.timeout + VERDICT_MARGIN;
            conduct(
                &mut supervisor,
                &cast,
                self.module_count(),
                start,
                deadline,
                &mut display,
            )
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
        let (end, course) = ended?;
        let verdict = match end {
            End::Judged(verdict) => Ok(verdict),
            End::ProcessEnded(process, status) => Err(died(&supervisor, process, status)),
            End::NobodyLeft(process, status) => Err(Failure::Failed(anyhow!(
                "no process of modules is left before there was a verdict; {} ended last, with {status}",
                supervisor.name(process)
            ))),
            End::Interrupted(signal) => Err(Failure::Failed(anyhow!(
                "interrupted by {}; every process was stopped",
                signal_name(signal)
            ))),
            End::TimedOut(progress) => Err(Failure::Failed(anyhow!(
                "no verdict within {} s; {}",
                self.arguments.timeout.as_secs_f64(),
                progress.standstill()
            ))),
        };
        Ok((verdict, course))
    }

    fn serves_parameters(&self) -> bool {
        match self.arguments.parameter_services {
            Some(switch) => switch == Switch::On,
            None => self.hosts.len() <= PARAMETER_SERVICES_PROCESSES_MAX,
        }
    }

    fn module_count(&self) -> usize {
        self.scenario.problem().modules().len()
    }

    /// Starts the verifier first, so that it hears everything, and the target last.
    fn start_all(&self, supervisor: &mut Supervisor) -> Result<Cast, Failure> {
        let modules = self.module_count().to_string();
        // When a module dies, the verdict may have to be another.
        let (plan_only, manner): (&[&str], &str) = if self.arguments.plan_only {
            (&["--plan-only"], "--plan-only")
        } else {
            (&[], "--keep-watching")
        };
        let timeout = self.arguments.timeout.as_secs_f64().to_string();
        let verifier = self.start(
            supervisor,
            "verifier",
            "verifier".to_owned(),
            &[
                "--progress",
                "--chronicle",
                "--json",
                "--time-limit-s",
                &timeout,
                manner,
            ],
            Output::Results,
        )?;
        if let Some(driver) = &self.arguments.driver {
            self.start_driver(supervisor, driver)?;
        }
        let speed = self.arguments.speed.to_string();
        let motion: &[&str] = match self.arguments.motion_mode() {
            MotionMode::Simulated => &["--motion", "simulated"],
            MotionMode::External => &["--motion", "external"],
        };
        let options: Vec<&str> = self
            .arguments
            .module_option
            .iter()
            .map(String::as_str)
            .collect();
        let mut agents = BTreeMap::new();
        for host in self.hosts {
            let list = id_list(&host.modules);
            let modules: &[&str] = match host.modules.as_slice() {
                [_] => &["--module", &list],
                _ => &["--modules", &list],
            };
            let process = self.start(
                supervisor,
                host.program(),
                host.name(),
                &[modules, &["--speed", &speed], motion, &options, plan_only].concat(),
                Output::Discarded,
            )?;
            agents.insert(process, host.modules.clone());
        }
        let target_publisher = self.start(
            supervisor,
            "target_publisher",
            "target_publisher".to_owned(),
            &["--expected-modules", &modules],
            Output::Discarded,
        )?;
        Ok(Cast {
            verifier,
            target_publisher,
            agents,
        })
    }

    /// Starts what drives the modules, told like any ROS 2 node where to speak.
    fn start_driver(&self, supervisor: &mut Supervisor, driver: &str) -> Result<(), Failure> {
        let mut command = Command::new("sh");
        command
            // Replaced by what it runs, so that the driver itself is asked to end.
            .args(["-c", &format!("exec {driver}")])
            .env("ROS_DOMAIN_ID", self.surroundings.domain.to_string())
            .env(
                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                self.surroundings.range.to_string(),
            )
            .process_group(0);
        supervisor
            .start("driver".to_owned(), &mut command, Output::Discarded)
            .with_context(|| format!("cannot start the driver `{driver}`"))
            .map_err(Failure::Failed)
            .map(drop)
    }

    fn start(
        &self,
        supervisor: &mut Supervisor,
        program: &str,
        name: String,
        options: &[&str],
        output: Output,
    ) -> Result<ProcessId, Failure> {
        let mut command = self.programs.command(program);
        command
            .arg("--scenario")
            .arg(&self.arguments.scenario)
            .args(["--domain", &self.surroundings.domain.to_string()])
            .args(["--discovery-range", &self.surroundings.range.to_string()])
            .args(options);
        if !self.serves_parameters() {
            command.args(["--ros-args", "-p", "start_parameter_services:=false"]);
        }
        let context = format!("cannot start {name}");
        supervisor
            .start(name, &mut command, output)
            .context(context)
            .map_err(Failure::Failed)
    }
}

/// Says which process ended and how, and shows its last words.
fn died(supervisor: &Supervisor, process: ProcessId, status: ExitStatus) -> Failure {
    let name = supervisor.name(process);
    let mut said = false;
    for line in supervisor.last_lines(process) {
        console::note(&format!("{name}: {line}"));
        said = true;
    }
    let words = if said {
        "its last lines are above"
    } else {
        "it said nothing"
    };
    Failure::Failed(anyhow!(
        "{name} ended with {status} before there was a verdict; {words}"
    ))
}

fn signal_name(signal: i32) -> &'static str {
    match signal {
        SIGINT => "SIGINT (Ctrl-C)",
        SIGTERM => "SIGTERM",
        SIGHUP => "SIGHUP",
        _ => "a signal",
    }
}
