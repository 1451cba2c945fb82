//! Starts the processes of a run, each with its arguments.

use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::Context;
use formation_model::text::ranges;
use formation_model::{ModuleId, ModuleSize, PlanningProblem};
use ros_runtime::environment::Environment;
use ros_runtime::exit::Failure;

use super::operator_commands::Orders;
use super::processes::Host;
use super::programs::{Programs, RECORDER};
use super::roles::ProcessRoles;
use super::router::Carrier;
use super::stores::RunStores;
use super::supervisor::{ProcessId, ProcessOutput, Supervisor};
use crate::arguments::{ON, RunArguments};

/// With more processes of modules than these, the endpoints of the parameter services make discovery too slow:
/// 0.7 s for 17 and 1.6 s for 25 with them, 0.6 s and 1.1 s without, but 7.1 s for 40 against 3.4 s.
const PARAMETER_SERVICES_PROCESSES_MAX: usize = 25;

/// Over DDS, the pause before the start of a process of modules, for each ordered pair of those that run. While a process is
/// discovered, each of the others sends heartbeats of its reliable writers to all others, so that their number grows with the
/// pairs. When they are more than the processors handle, they are lost and have to be sent again. 50 processes that start at once
/// on two cores join after 13.4 s, and at this pace after 9.0 s, in the median of ten runs each.
const START_PAUSE_PER_PAIR: Duration = Duration::from_micros(100);

/// A recorder records the own topics of at most this many modules.
const RECORDED_MODULES_MAX: usize = 100;

/// The program that plays the robots of a scenario.
pub const WORLD: &str = "world";

/// What to start, and where.
pub struct Start<'a> {
    /// The user's choices.
    pub arguments: &'a RunArguments,
    /// What carries the messages.
    pub carrier: &'a Carrier,
    /// The session of the run, and the directory of its stores.
    pub stores: &'a RunStores,
    /// The modules and their target.
    pub problem: &'a PlanningProblem,
    /// The size of the modules.
    pub module_size: ModuleSize,
    /// Where the programs are.
    pub programs: &'a Programs,
    /// The processes of modules.
    pub hosts: &'a [Host],
    /// The domain and the discovery range of all processes.
    pub environment: Environment,
}

impl Start<'_> {
    /// Starts the recorder and the verifier first, so that they receive all messages, and the target publisher last.
    ///
    /// # Errors
    /// Names the process that could not be started.
    pub fn all(&self, supervisor: &mut Supervisor) -> Result<ProcessRoles, Failure> {
        let record = self.arguments.record.as_deref();
        let recorder = record.map(|file| self.recorder(supervisor, file));
        let recorder = recorder.transpose()?;
        let verifier = self.verifier(supervisor)?;
        if let Some(driver) = &self.arguments.motion.driver {
            self.driver(supervisor, driver)?;
        }
        let world = self.world(supervisor)?;
        let agents = self.agents(supervisor)?;
        let modules = self.problem.modules().len();
        let target_publisher =
            self.target_publisher(supervisor, &self.arguments.scenario, modules)?;
        Ok(ProcessRoles {
            verifier,
            target_publisher,
            world,
            recorder,
            agents,
        })
    }

    /// Starts what announces the target of a scenario file to this many modules, all of which vote.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn target_publisher(
        &self,
        supervisor: &mut Supervisor,
        scenario: &Path,
        modules: usize,
    ) -> Result<ProcessId, Failure> {
        let voters = ranges(self.problem.modules().iter().map(|module| module.id));
        let mut command = self.programs.command("target_publisher");
        command.arg("--scenario").arg(scenario);
        self.node(
            supervisor,
            command,
            "target_publisher".to_owned(),
            &[
                "--expected-modules",
                &modules.to_string(),
                "--voters",
                &voters,
            ],
            ProcessOutput::Discarded,
        )
    }

    /// Makes the commands that give orders to the modules.
    pub fn orders(&self) -> Orders<'_> {
        Orders {
            command: Box::new(|order| {
                let mut command = self.programs.command("target_publisher");
                self.place(&mut command);
                command.args(order);
                self.join_session(&mut command);
                command
            }),
            bodies_vanish: !self.arguments.motion.bodies_stay(),
        }
    }

    /// Passes on the middleware, the domain and the discovery range.
    fn place(&self, command: &mut Command) {
        self.carrier.place(command);
        command
            .args(["--domain", &self.environment.domain.to_string()])
            .args(["--discovery-range", &self.environment.range.to_string()]);
    }

    /// Passes on the session of the run and the size of its modules, as the first parameters.
    fn join_session(&self, command: &mut Command) {
        let session = format!("session:={}", self.stores.session);
        let module_size = format!("module_size:={:?}", self.module_size.metres());
        command.args(["--ros-args", "-p", &session, "-p", &module_size]);
    }

    fn verifier(&self, supervisor: &mut Supervisor) -> Result<ProcessId, Failure> {
        let timeout = self.arguments.timeout.as_secs_f64().to_string();
        let until = match self.arguments.plan_only {
            true => "--plan-only",
            // When a module dies, the verdict may change.
            false => "--keep-watching",
        };
        let trace = self.arguments.trace.as_ref();
        let trace = trace.map(|file| file.to_string_lossy());
        let mut options = vec![
            "--progress",
            "--event-log",
            "--json",
            "--time-limit-s",
            &timeout,
            until,
        ];
        if let Some(file) = &trace {
            options.extend(["--trace", file]);
        }
        let tolerances = self.arguments.motion.world.verifier_options();
        options.extend(tolerances.iter().map(String::as_str));
        let name = "verifier".to_owned();
        self.program(
            supervisor,
            "verifier",
            name,
            &options,
            ProcessOutput::Results,
        )
    }

    fn recorder(&self, supervisor: &mut Supervisor, file: &Path) -> Result<ProcessId, Failure> {
        let mut command = self.programs.command(RECORDER);
        // A name that begins with a hyphen is no option.
        command.arg(Path::new(".").join(file));
        if self.arguments.motion.is_external() {
            let modules = self.problem.modules().iter().map(|module| module.id);
            // A recorder has room for the topics of this many.
            let recorded = modules.take(RECORDED_MODULES_MAX);
            command.args(["--modules", &ranges(recorded)]);
        }
        let name = RECORDER.to_owned();
        self.node(supervisor, command, name, &[], ProcessOutput::Discarded)
    }

    fn agents(
        &self,
        supervisor: &mut Supervisor,
    ) -> Result<BTreeMap<ProcessId, Vec<ModuleId>>, Failure> {
        let mut agents = BTreeMap::new();
        for host in self.hosts {
            if !self.carrier.is_zenoh() && !supervisor.pause(start_pause(agents.len())) {
                break;
            }
            let process = self.agent(supervisor, host)?;
            agents.insert(process, host.modules.clone());
        }
        Ok(agents)
    }

    /// Starts a process of modules.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn agent(&self, supervisor: &mut Supervisor, host: &Host) -> Result<ProcessId, Failure> {
        let motion = &self.arguments.motion;
        let list = ranges(host.modules.iter().copied());
        let option = match host.modules.len() {
            1 => "--module",
            _ => "--modules",
        };
        let speed = motion.speed.to_string();
        let state_dir = self.stores.directory.to_string_lossy();
        let voters = ranges(self.problem.modules().iter().map(|module| module.id));
        let mut options = vec![option, &list, "--state-dir", &state_dir];
        options.extend(["--voters", &voters]);
        if self.stores.is_new_session {
            options.push("--new-session");
        }
        options.extend(["--speed", &speed, "--motion", motion.mode()]);
        let tolerances = motion.world.module_options();
        options.extend(tolerances.iter().map(String::as_str));
        options.extend(motion.module_option.iter().map(String::as_str));
        if self.arguments.plan_only {
            options.push("--plan-only");
        }
        if self.arguments.attended {
            options.push("--pushable");
        }
        self.program(
            supervisor,
            host.program(),
            host.name(),
            &options,
            ProcessOutput::Discarded,
        )
    }

    /// Starts what drives the modules, with the environment variables that set the domain and the discovery range of any ROS 2 node.
    fn driver(&self, supervisor: &mut Supervisor, driver: &str) -> Result<(), Failure> {
        let Environment { domain, range, .. } = self.environment;
        let mut command = Command::new("sh");
        command
            // The shell is replaced by what it runs, so that the driver itself receives the signal to end.
            .args(["-c", &format!("exec {driver}")])
            .env("ROS_DOMAIN_ID", domain.to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", range.to_string())
            .process_group(0);
        self.carrier.place_any(&mut command);
        supervisor
            .start("driver".to_owned(), &mut command, ProcessOutput::Discarded)
            .with_context(|| format!("cannot start the driver `{driver}`"))
            .map_err(Failure::Failed)
            .map(drop)
    }

    /// Starts the physical world, if there is to be one.
    fn world(&self, supervisor: &mut Supervisor) -> Result<Option<ProcessId>, Failure> {
        let motion = &self.arguments.motion;
        if !motion.world.world {
            return Ok(None);
        }
        let mut options = motion.world.options();
        options.insert(0, format!("--speed={}", motion.speed));
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        let name = WORLD.to_owned();
        let process = self.program(supervisor, WORLD, name, &options, ProcessOutput::Results)?;
        Ok(Some(process))
    }

    fn program(
        &self,
        supervisor: &mut Supervisor,
        program: &str,
        name: String,
        options: &[&str],
        output: ProcessOutput,
    ) -> Result<ProcessId, Failure> {
        let mut command = self.programs.command(program);
        command.arg("--scenario").arg(&self.arguments.scenario);
        self.node(supervisor, command, name, options, output)
    }

    /// Starts a node with what all nodes of the run have in common.
    fn node(
        &self,
        supervisor: &mut Supervisor,
        mut command: Command,
        name: String,
        options: &[&str],
        output: ProcessOutput,
    ) -> Result<ProcessId, Failure> {
        self.place(&mut command);
        command.args(options);
        self.join_session(&mut command);
        if !self.serves_parameters() {
            command.args(["-p", "start_parameter_services:=false"]);
        }
        let context = format!("cannot start {name}");
        supervisor
            .start(name, &mut command, output)
            .context(context)
            .map_err(Failure::Failed)
    }

    fn serves_parameters(&self) -> bool {
        match &self.arguments.parameter_services {
            Some(switch) => switch == ON,
            // Zenoh carries them: endpoints are known to the router alone.
            None => self.carrier.is_zenoh() || self.hosts.len() <= PARAMETER_SERVICES_PROCESSES_MAX,
        }
    }
}

/// The pause before one more process starts over DDS.
fn start_pause(running: usize) -> Duration {
    let running = u32::try_from(running).unwrap_or(u32::MAX);
    START_PAUSE_PER_PAIR.saturating_mul(running.saturating_pow(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_processes_start_at_once_and_many_at_a_pace() {
        let total = |processes: usize| (0..processes).map(start_pause).sum::<Duration>();
        assert!(total(10) < Duration::from_millis(50));
        assert!(total(20) < Duration::from_millis(300));
        assert!(start_pause(49) > Duration::from_millis(200));
        assert!(
            total(119) < Duration::from_secs(60),
            "all that a domain has room for"
        );
    }
}
