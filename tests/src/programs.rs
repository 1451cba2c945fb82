//! Our programs as processes, each ended by its own id.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal};
use serde_json::Value;

use crate::namespaces::Namespace;
use crate::transcript::{Line, Transcript};

/// The longest time that a router takes to start.
const ROUTING_MAX: Duration = Duration::from_secs(60);

/// The root of the repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// A scenario that ships with the suite.
#[must_use]
pub fn scenario_path(name: &str) -> PathBuf {
    root()
        .join("launch_scripts/scenarios")
        .join(name)
        .with_extension("yaml")
}

/// Where cargo puts the programs of the profile that this test was built with.
fn profile_directory() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(2).unwrap().to_owned()
}

/// Where cargo puts everything that it builds.
pub(crate) fn target_directory() -> PathBuf {
    profile_directory().parent().unwrap().to_owned()
}

/// A program that cargo has built next to this test.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let built = profile_directory().join(name);
    assert!(
        built.is_file(),
        "{} is missing; `cargo test --workspace` builds it, and so does `cargo build --workspace`",
        built.display()
    );
    built
}

/// One of our programs, running; killed when this value is dropped.
pub struct Running {
    child: Child,
    name: String,
    stdout: Option<Transcript>,
    stderr: Option<Transcript>,
}

/// How a program ended.
pub struct Finished {
    /// Its exit status.
    pub status: i32,
    /// What it printed.
    pub stdout: String,
    /// What it logged.
    pub stderr: String,
}

impl Finished {
    /// The last line of its output, as JSON.
    #[must_use]
    pub fn last_json(&self) -> Value {
        let last = self.stdout.trim_end().lines().last().unwrap_or_default();
        serde_json::from_str(last)
            .unwrap_or_else(|error| panic!("{error} in {last:?}; it logged:\n{}", self.stderr))
    }

    /// The whole output as one JSON value.
    #[must_use]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| {
            panic!("{error} in {:?}; it logged:\n{}", self.stdout, self.stderr)
        })
    }
}

impl Running {
    /// Starts a program on a domain of loopback.
    #[must_use]
    pub fn start(name: &str, domain: &str, arguments: &[&str]) -> Self {
        Self::spawn(
            Command::new(program(name)),
            name,
            domain,
            arguments,
            "LOCALHOST",
        )
    }

    /// Starts a program that lies elsewhere, such as an installed one, on a domain of loopback.
    #[must_use]
    pub fn start_from(path: &Path, name: &str, domain: &str, arguments: &[&str]) -> Self {
        Self::spawn(Command::new(path), name, domain, arguments, "LOCALHOST")
    }

    /// Starts a program on a domain of a network of its own.
    #[must_use]
    pub fn start_within(network: &Namespace, name: &str, domain: &str, arguments: &[&str]) -> Self {
        let mut command = network.command();
        command.arg(program(name));
        Self::spawn(command, name, domain, arguments, "SUBNET")
    }

    /// Starts a program on a domain over Zenoh, with the first of the routers at these endpoints that can be reached.
    #[must_use]
    pub fn start_over_zenoh(
        routers: &[&str],
        name: &str,
        domain: &str,
        arguments: &[&str],
    ) -> Self {
        let command = Command::new(program(name));
        Self::spawn_over_zenoh(command, routers, name, domain, arguments)
    }

    /// The same in a network of its own.
    #[must_use]
    pub fn start_over_zenoh_within(
        network: &Namespace,
        routers: &[&str],
        name: &str,
        domain: &str,
        arguments: &[&str],
    ) -> Self {
        let mut command = network.command();
        command.arg(program(name));
        Self::spawn_over_zenoh(command, routers, name, domain, arguments)
    }

    /// Starts a router of Zenoh that listens at this endpoint and connects to these other ones, on a network of its own or on
    /// loopback, and waits until it routes.
    #[must_use]
    pub fn start_router(
        network: Option<&Namespace>,
        domain: &str,
        listen: &str,
        others: &[&str],
    ) -> Self {
        let mut arguments = vec!["router", "--listen", listen];
        for other in others {
            arguments.extend(["--connect", other]);
        }
        let router = match network {
            Some(network) => Self::start_within(network, "formation", domain, &arguments),
            None => Self::start("formation", domain, &arguments),
        };
        router.await_routing()
    }

    /// Waits until a router routes.
    #[must_use]
    pub fn await_routing(self) -> Self {
        let routing = self.wait_for_log(0, "routing on", ROUTING_MAX);
        assert!(routing.is_some(), "{:?}", self.log_since(0));
        self
    }

    fn spawn_over_zenoh(
        mut command: Command,
        routers: &[&str],
        name: &str,
        domain: &str,
        arguments: &[&str],
    ) -> Self {
        command.args(["--middleware", "zenoh"]).env(
            "ZENOH_CONFIG_OVERRIDE",
            format!("connect/endpoints={routers:?}"),
        );
        Self::spawn(command, name, domain, arguments, "LOCALHOST")
    }

    /// Starts a program on a domain of loopback, with these environment variables besides.
    #[must_use]
    pub fn start_with(
        variables: &[(&str, &str)],
        name: &str,
        domain: &str,
        arguments: &[&str],
    ) -> Self {
        let mut command = Command::new(program(name));
        command.envs(variables.iter().copied());
        Self::spawn(command, name, domain, arguments, "LOCALHOST")
    }

    /// Starts a command on a domain of loopback, such as a script by an interpreter with its environment.
    #[must_use]
    pub fn start_command(command: Command, name: &str, domain: &str, arguments: &[&str]) -> Self {
        Self::spawn(command, name, domain, arguments, "LOCALHOST")
    }

    fn spawn(
        mut command: Command,
        name: &str,
        domain: &str,
        arguments: &[&str],
        range: &str,
    ) -> Self {
        let mut child = command
            .args(arguments)
            .env("ROS_DOMAIN_ID", domain)
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", range)
            .env_remove("ROS_LOCALHOST_ONLY")
            .env_remove("ROS_NAMESPACE")
            .env_remove("RMW_IMPLEMENTATION")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = child.stdout.take().map(Transcript::of);
        let stderr = child.stderr.take().map(Transcript::of);
        Self {
            child,
            name: format!("{name} {}", arguments.join(" ")),
            stdout,
            stderr,
        }
    }

    /// How many lines it logged so far.
    #[must_use]
    pub fn logged(&self) -> usize {
        self.stderr.as_ref().map_or(0, Transcript::len)
    }

    /// What it logged after the `from`th line.
    #[must_use]
    pub fn log_since(&self, from: usize) -> Vec<Line> {
        let stderr = self.stderr.as_ref();
        stderr.map(|log| log.since(from)).unwrap_or_default()
    }

    /// Waits until it logs a line with `text` after the `from`th; when that was, or `None` when the time is up or the
    /// program ended.
    #[must_use]
    pub fn wait_for_log(&self, from: usize, text: &str, limit: Duration) -> Option<Instant> {
        self.stderr.as_ref()?.wait_for(from, limit, |line| {
            line.text.contains(text).then_some(line.at)
        })
    }

    /// How many lines it printed so far.
    #[must_use]
    pub fn printed(&self) -> usize {
        self.stdout.as_ref().map_or(0, Transcript::len)
    }

    /// Waits until `find` yields something from a line that it printed after the `from`th; `None` when the time is up or
    /// the program ended.
    pub fn wait_for_line<T>(
        &self,
        from: usize,
        limit: Duration,
        find: impl FnMut(&Line) -> Option<T>,
    ) -> Option<T> {
        self.stdout.as_ref()?.wait_for(from, limit, find)
    }

    /// The most memory that it held so far, in kilobytes, as the kernel counts it (`VmHWM`).
    #[must_use]
    pub fn peak_memory_kb(&self) -> u64 {
        let status = format!("/proc/{}/status", self.child.id());
        let status = std::fs::read_to_string(status).unwrap();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let peak = peak.and_then(|peak| peak.split_whitespace().next());
        peak.unwrap().parse().unwrap()
    }

    /// The process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal to this process alone.
    pub fn signal(&self, signal: Signal) {
        rustix::process::kill_process(Pid::from_child(&self.child), signal)
            .unwrap_or_else(|error| panic!("cannot send {signal:?} to {}: {error}", self.name));
    }

    /// Sends a signal to this process and to those that it started, as a terminal does; the process must lead its group.
    pub fn signal_group(&self, signal: Signal) {
        rustix::process::kill_process_group(Pid::from_child(&self.child), signal)
            .unwrap_or_else(|error| panic!("cannot send {signal:?} to {}: {error}", self.name));
    }

    /// Stops the process and lets it continue until its DDS library no longer receives, and waits until it has rejoined the
    /// graph.
    ///
    /// Only a thread of the library that waits for its sockets while the process is stopped ends, so that several tries may
    /// be needed on a busy machine.
    pub fn rejoin(&self, limit: Duration) {
        let deadline = Instant::now() + limit;
        let mark = self.logged();
        let status = format!("/proc/{}/status", self.id());
        let is_stopped = || {
            let status = std::fs::read_to_string(&status).unwrap();
            status.contains("State:\tT")
        };
        loop {
            self.signal(Signal::STOP);
            while !is_stopped() {
                let is_late = Instant::now() > deadline;
                assert!(
                    !is_late,
                    "{} does not stop: {:?}",
                    self.name,
                    self.log_since(0)
                );
                thread::sleep(Duration::from_millis(10));
            }
            thread::sleep(Duration::from_millis(100));
            self.signal(Signal::CONT);
            let rejoins = self.wait_for_log(
                mark,
                "joining the ROS 2 graph again",
                Duration::from_secs(3),
            );
            if rejoins.is_some() {
                break;
            }
            assert!(
                Instant::now() < deadline,
                "{} still receives, or has ended; it logged: {:?}",
                self.name,
                self.log_since(0)
            );
        }
        let joined = self.wait_for_log(mark, "joined the ROS 2 graph", limit);
        assert!(joined.is_some(), "{} did not rejoin", self.name);
    }

    /// Waits for the program to end by itself, for at most `limit`.
    #[must_use]
    pub fn finish(mut self, limit: Duration) -> Finished {
        let deadline = Instant::now() + limit;
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            if Instant::now() > deadline {
                self.child.kill().unwrap();
                let text = self.texts();
                panic!(
                    "{} did not end within {limit:?}; it logged:\n{}",
                    self.name, text.1
                );
            }
            thread::sleep(Duration::from_millis(50));
        };
        let (stdout, stderr) = self.texts();
        Finished {
            status: status.code().unwrap_or(-1),
            stdout,
            stderr,
        }
    }

    /// Asks the program to end, and waits until it has.
    #[must_use]
    pub fn stop(self) -> Finished {
        self.signal(Signal::TERM);
        self.finish(Duration::from_secs(20))
    }

    fn texts(&mut self) -> (String, String) {
        let text =
            |stream: Option<Transcript>| stream.map(Transcript::into_text).unwrap_or_default();
        (text(self.stdout.take()), text(self.stderr.take()))
    }

    /// Kills the program without a word of warning, as `kill -9` does.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}
