//! What carries the messages of a run: DDS, or Zenoh with a router that ends with the run.

use std::env;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::unix::process::CommandExt;
use std::path::{self, Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use ros_runtime::exit::Failure;
use ros_runtime::middleware::{Middleware, NOT_BUILT, RMW_ZENOH};
use ros_runtime::security::{self, DDS_SHORTFALL, Security};
use ros_runtime::service_mapping::RMW_IMPLEMENTATION;
use rustix::process::{Pid, Signal, kill_process};

use super::sockets;
use crate::arguments::RunArguments;
use crate::console;
use crate::role::{self, ROUTER, Role};

/// The most processes of modules that discover each other over DDS on one machine in a few seconds.
const DDS_PROCESSES_MAX: usize = 50;

/// The variable that names the file of the configuration of Zenoh sessions.
const SESSION_FILE: &str = "ZENOH_SESSION_CONFIG_URI";
/// The variable that names the configuration file of a router.
const ROUTER_FILE: &str = "ZENOH_ROUTER_CONFIG_URI";
/// The variable with single values of that configuration.
const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";
/// The value that names the routers of a session.
const ENDPOINTS: &str = "connect/endpoints";

/// How long a router may take to start.
const START_LIMIT: Duration = Duration::from_secs(10);
/// How long a router may take to end after SIGTERM.
const STOP_GRACE: Duration = Duration::from_secs(2);
/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(20);

/// The middleware of a run with this many processes of modules: what an argument or the environment names, or else Zenoh
/// where there are more than DDS carries.
///
/// # Errors
/// Names the command that builds this program with Zenoh, if that is needed.
pub fn middleware(arguments: &RunArguments, processes: usize) -> Result<Middleware, Failure> {
    if arguments.security.is_some() && arguments.middleware.is_none() {
        return Middleware::Zenoh.check().map_err(Failure::bad_input);
    }
    let implementation = variable(RMW_IMPLEMENTATION);
    let is_named = arguments.middleware.is_some() || implementation.is_some();
    let named = Middleware::choose(arguments.middleware, implementation.as_deref());
    if is_named || processes <= DDS_PROCESSES_MAX {
        return named.check().map_err(Failure::bad_input);
    }
    if Middleware::HAS_ZENOH {
        console::note(&format!(
            "note: {processes} processes of modules are more than DDS carries on one machine, so this runs over Zenoh; \
             --middleware dds uses DDS all the same"
        ));
        return Ok(Middleware::Zenoh);
    }
    console::note(&format!(
        "note: {processes} processes of modules are more than DDS carries on one machine, and Zenoh carries them, but \
         {NOT_BUILT}"
    ));
    Ok(Middleware::Dds)
}

/// Refuses a run whose messages must be protected and would not be.
///
/// # Errors
/// Says what is missing, or which variable cannot be used.
pub fn check_security(arguments: &RunArguments, middleware: Middleware) -> Result<(), Failure> {
    if let Some(directory) = &arguments.security {
        return check_files(directory, middleware).map_err(Failure::bad_input);
    }
    let shortfall = match middleware {
        Middleware::Dds => DDS_SHORTFALL,
        // Every process checks the file itself.
        Middleware::Zenoh if variable(SESSION_FILE).is_some() => return Ok(()),
        Middleware::Zenoh => NO_SESSION_FILE,
    };
    let security = Security::resolve(variable).map_err(Failure::bad_input)?;
    security.without(shortfall).map_err(Failure::bad_input)
}

/// Why the messages of a run over Zenoh are not protected.
const NO_SESSION_FILE: &str = "the router that `formation run` starts demands no certificates without --security DIR (docs/zenoh.md)";

/// Checks that a run can be protected with the files in this directory.
fn check_files(directory: &Path, middleware: Middleware) -> Result<(), String> {
    if middleware == Middleware::Dds {
        return Err(format!("--security: {DDS_SHORTFALL}"));
    }
    if names_routers() {
        return Err(format!(
            "--security starts a router of its own, but {SESSION_FILE} or {OVERRIDE} names another; unset them"
        ));
    }
    let roles = Role::ALL.map(Role::name);
    for name in roles.into_iter().chain([ROUTER]) {
        let file = role::file_of(directory, name);
        if !file.is_file() {
            return Err(format!(
                "--security: {} is missing; `formation security create DIR` makes a directory with all files",
                file.display()
            ));
        }
    }
    Ok(())
}

/// What carries the messages of a run.
pub struct Carrier {
    middleware: Middleware,
    /// The router that was started for the run.
    router: Option<Router>,
    /// The directory with the files of the roles, if they protect the run.
    security: Option<PathBuf>,
}

struct Router {
    process: Child,
    endpoint: String,
}

impl Carrier {
    /// Starts the router of a run over Zenoh, unless the environment names routers.
    ///
    /// # Errors
    /// Says why no router could be started.
    pub fn start(middleware: Middleware, security: Option<&Path>) -> Result<Self, Failure> {
        let needs_router = middleware == Middleware::Zenoh && !names_routers();
        let router = needs_router.then(|| Router::start(security)).transpose();
        let carrier = Self {
            middleware,
            router: router.map_err(Failure::Failed)?,
            security: security.map(Path::to_path_buf),
        };
        if let Some(routers) = carrier.routers() {
            let operator = security.map(|directory| {
                // The other terminal may be in another directory.
                let file = role::file_of(directory, Role::Operator.name());
                path::absolute(&file).unwrap_or(file)
            });
            let operator = operator.map(|file| format!(" {SESSION_FILE}='{}'", file.display()));
            console::note(&format!(
                "note: this runs over Zenoh; to take part from another terminal: export \
                 {RMW_IMPLEMENTATION}={RMW_ZENOH} {OVERRIDE}='{routers}'{}",
                operator.unwrap_or_default()
            ));
        }
        Ok(carrier)
    }

    /// Whether the messages go over Zenoh.
    pub fn is_zenoh(&self) -> bool {
        self.middleware == Middleware::Zenoh
    }

    /// The value of the variable by which processes find the router of the run.
    fn routers(&self) -> Option<String> {
        let router = self.router.as_ref()?;
        let named = format!("{ENDPOINTS}=[\"{}\"]", router.endpoint);
        Some(match variable(OVERRIDE) {
            Some(overrides) => format!("{overrides};{named}"),
            None => named,
        })
    }

    /// Has one of our programs use it.
    pub fn place(&self, command: &mut Command) {
        command.args(["--middleware", &self.middleware.to_string()]);
        self.place_session(command);
    }

    /// Has a ROS 2 node of another package use it.
    pub fn place_any(&self, command: &mut Command) {
        if self.is_zenoh() {
            command.env(RMW_IMPLEMENTATION, RMW_ZENOH);
        }
        self.place_session(command);
    }

    /// Has a program find the router, and show the certificate of its role.
    fn place_session(&self, command: &mut Command) {
        if let Some(routers) = self.routers() {
            command.env(OVERRIDE, routers);
        }
        if let Some(directory) = &self.security {
            let role = Role::of(Path::new(command.get_program()));
            let file = role::file_of(directory, role.name());
            command.env(SESSION_FILE, file).envs(security::ENFORCED);
        }
    }
}

/// Whether the environment names routers, which several runs may share.
pub fn names_routers() -> bool {
    let overrides = variable(OVERRIDE).unwrap_or_default();
    variable(SESSION_FILE).is_some() || overrides.contains(ENDPOINTS)
}

/// What the environment says of routers: runs of which this differs may use different ones.
pub fn named_routers() -> [Option<String>; 2] {
    [variable(SESSION_FILE), variable(OVERRIDE)]
}

/// The value of a variable, unless it is empty.
pub fn variable(name: &str) -> Option<String> {
    let value = env::var_os(name)?.to_string_lossy().into_owned();
    (!value.trim().is_empty()).then_some(value)
}

impl Router {
    /// Starts a router on loopback; with a directory of certificates, one that demands them.
    fn start(security: Option<&Path>) -> anyhow::Result<Self> {
        let address = free_address().context("no port of loopback is free for a Zenoh router")?;
        let transport = security.map_or("tcp", |_| "tls");
        let endpoint = format!("{transport}/{address}");
        let zenohd = installed("zenohd", env::var_os("PATH").unwrap_or_default());
        // Only our own router logs what it refuses.
        let zenohd = zenohd.filter(|_| security.is_none());
        let mut command = match zenohd {
            Some(zenohd) => {
                let mut command = Command::new(zenohd);
                command.args([
                    "--no-multicast-scouting",
                    "--cfg",
                    "timestamping/enabled:true",
                ]);
                command
            }
            None => {
                let launcher =
                    env::current_exe().context("cannot find the launcher's own program")?;
                let mut command = Command::new(launcher);
                command.args(["router", "--stop-with-parent"]);
                if let Some(directory) = security {
                    let file = role::file_of(directory, ROUTER);
                    command.env(ROUTER_FILE, file).envs(security::ENFORCED);
                }
                command
            }
        };
        let process = command
            .args(["--listen", &endpoint])
            // A group of its own, so that Ctrl-C reaches the launcher alone.
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .context("cannot start a Zenoh router")?;
        let mut router = Self { process, endpoint };
        router.wait_until_ready(address)?;
        Ok(router)
    }

    fn wait_until_ready(&mut self, address: SocketAddr) -> anyhow::Result<()> {
        let deadline = Instant::now() + START_LIMIT;
        while !sockets::listens(address.port()) {
            if let Some(status) = self.process.try_wait()? {
                return Err(anyhow!("the Zenoh router ended with {status}"));
            }
            if Instant::now() >= deadline {
                let limit = START_LIMIT.as_secs();
                return Err(anyhow!("the Zenoh router does not listen after {limit} s"));
            }
            thread::sleep(INTERVAL);
        }
        Ok(())
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        // It was not waited for, so that its number is still its own.
        let _ = kill_process(Pid::from_child(&self.process), Signal::TERM);
        let deadline = Instant::now() + STOP_GRACE;
        while Instant::now() < deadline {
            if !matches!(self.process.try_wait(), Ok(None)) {
                return;
            }
            thread::sleep(INTERVAL);
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// An address of loopback that no program uses.
fn free_address() -> std::io::Result<SocketAddr> {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()
}

/// A program in one of the folders of `path`.
fn installed(program: &str, path: impl AsRef<std::ffi::OsStr>) -> Option<PathBuf> {
    let folders = env::split_paths(path.as_ref()).collect::<Vec<_>>();
    let mut programs = folders.iter().map(|folder| folder.join(program));
    programs.find(|program| Path::is_file(program))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn an_installed_program_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = env::join_paths([Path::new("/nowhere"), folder.path()]).unwrap();
        assert_eq!(installed("zenohd", &path), None);
        let program = folder.path().join("zenohd");
        fs::write(&program, "").unwrap();
        assert_eq!(installed("zenohd", &path), Some(program));
    }

    #[test]
    fn a_run_is_protected_over_zenoh_with_all_files_only() {
        let folder = tempfile::tempdir().unwrap();
        let error = check_files(folder.path(), Middleware::Dds).unwrap_err();
        assert!(error.contains("DDS"), "{error}");
        let roles = Role::ALL.map(Role::name);
        for name in roles.into_iter().chain([ROUTER]) {
            let error = check_files(folder.path(), Middleware::Zenoh).unwrap_err();
            assert!(
                error.contains(&format!("{name}.json5 is missing")),
                "{error}"
            );
            fs::write(role::file_of(folder.path(), name), "{}").unwrap();
        }
        check_files(folder.path(), Middleware::Zenoh).unwrap();
    }

    #[test]
    fn a_router_that_does_not_start_is_reported() {
        let process = Command::new("false").spawn().unwrap();
        // A child that another test forks at this moment would still hold a port that was bound here.
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 1));
        let endpoint = format!("tcp/{address}");
        let mut router = Router { process, endpoint };
        let error = router.wait_until_ready(address).unwrap_err().to_string();
        assert!(error.contains("exit status: 1"), "{error}");
    }
}
