//! Whether the processes will discover each other on this machine, and a network namespace of their own if not.
//!
//! Without multicast, participants announce themselves only to the first twelve ports of a host, and `lo` carries no
//! multicast by default. Enabling it requires rights on the machine's network, or a network namespace, which every user
//! may create where the kernel allows user namespaces.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use anyhow::{Context, anyhow};

use ros_runtime::environment::{DiscoveryRange, Domain, Environment, Overrides};
use ros_runtime::exit::{Failure, one_line};
use ros_runtime::interfaces::{PARTICIPANTS_WITHOUT_MULTICAST, discovery_obstacle, interfaces};
use ros_runtime::middleware::Middleware;

use super::domain::{self, Place};
use super::processes::OTHER_PROCESSES;
use super::router;
use super::sockets::{PARTICIPANTS_MAX, discovery_port, participants_taken};
use crate::arguments::{MODULES_PER_PROCESS_MAX, RunArguments};
use crate::console;

/// The hidden option of a launcher that runs in a network namespace of its own.
const PRIVATE_NETWORK_OPTION: &str = "--private-network";

/// How many participants discover each other without multicast: one less than there could be, which is left for the
/// user's own tools. Each participant of another program is one less again.
const FOUND_WITHOUT_MULTICAST: usize = PARTICIPANTS_WITHOUT_MULTICAST as usize - 1;
/// Makes the new network usable, then becomes the command that follows. `ip` is often outside of a user's path. /sys shows
/// the network of the namespace that mounted it, so it is mounted again; where that is refused, programs that read it see
/// the old network, and everything else works.
const SETUP: &str = "PATH=\"$PATH:/usr/sbin:/sbin\"; ip link set lo up && ip link set lo multicast on || exit 1; \
                     mount -t sysfs sysfs /sys 2>/dev/null; exec \"$@\"";

/// Resolves the domain and the discovery range of the processes, with no other formation in their namespace, and makes sure
/// that they will discover each other: where the loopback interface prevents that, the launcher restarts in a network
/// namespace of its own, and this does not return.
///
/// # Errors
/// Names the formation that has the domain already, or says why the processes would not discover each other, and what to do.
pub fn prepare(
    arguments: &RunArguments,
    middleware: Middleware,
    modules: usize,
    hosts: usize,
) -> Result<Place, Failure> {
    let environment = environment_of_runs(arguments.domain)?;
    if middleware == Middleware::Zenoh {
        // Processes find each other by their router.
        return domain::choose(arguments, middleware, environment);
    }
    let range = environment.range;
    let optional = [
        arguments.motion.driver.is_some(),
        arguments.motion.world.world,
        arguments.record.is_some(),
    ];
    let optional = optional
        .into_iter()
        .filter(|&is_started| is_started)
        .count();
    let participants = hosts + OTHER_PROCESSES + optional;
    if arguments.private_network {
        check_room(participants, 0)?;
        return Ok(Place::alone(environment));
    }
    let interfaces = interfaces();
    let obstacle = |taken: usize| {
        let all = u16::try_from(participants + taken).unwrap_or(u16::MAX);
        discovery_obstacle(range, &interfaces, all)
    };
    // A network namespace of its own, if there is to be one in any case, has no other formations.
    let place = match obstacle(0) {
        None => domain::choose(arguments, middleware, environment)?,
        Some(_) => Place::alone(environment),
    };
    let domain = place.environment.domain;
    warn_of_ephemeral_ports(domain.number());
    let taken = participants_taken(domain.number());
    check_room(participants, taken)?;
    let Some(obstacle) = obstacle(taken) else {
        return Ok(place);
    };
    if range != DiscoveryRange::Localhost {
        return Err(Failure::BadInput(anyhow!(obstacle)));
    }
    let fewer = modules_per_process_that_fit(modules, taken)
        .map(|count| format!(", or use --modules-per-process {count}"))
        .unwrap_or_default();
    let there_is_none = |reason: anyhow::Error| {
        Failure::BadInput(anyhow!(
            "{participants} processes would not discover each other on this machine's loopback interface, and no network \
             namespace can be created ({reason:#}); run `sudo ip link set lo up multicast on`{fewer}"
        ))
    };
    let isolation = usable_isolation().map_err(there_is_none)?;
    console::note(&format!(
        "note: {participants} processes would not discover each other on this machine's loopback interface, so this runs \
         in a network namespace of its own; for other terminals to see the topics, first run `sudo ip link set lo up \
         multicast on`{fewer}"
    ));
    Err(there_is_none(enter_private_network(isolation)))
}

/// The domain and the discovery range of runs that users start from this environment.
///
/// # Errors
/// Names the variable with a wrong value.
pub fn environment_of_runs(domain: Option<Domain>) -> Result<Environment, Failure> {
    environment(domain, router::variable)
}

/// As ROS 2 resolves them, but on loopback alone where no variable is set.
fn environment(
    domain: Option<Domain>,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Environment, Failure> {
    let is_set = |name| variable(name).is_some_and(|value| !value.trim().is_empty());
    let silent = !is_set("ROS_AUTOMATIC_DISCOVERY_RANGE") && !is_set("ROS_LOCALHOST_ONLY");
    let overrides = Overrides {
        domain,
        range: silent.then_some(DiscoveryRange::Localhost),
    };
    let environment = Environment::resolve(overrides, variable).map_err(Failure::bad_input)?;
    if environment.range == DiscoveryRange::Off {
        return Err(Failure::BadInput(anyhow!(
            "environment variable ROS_AUTOMATIC_DISCOVERY_RANGE: OFF, so the processes would not discover each other; use \
             LOCALHOST"
        )));
    }
    Ok(environment)
}

/// Warns if the machine assigns the ports of a domain to programs that request any port: a participant whose port is in
/// use takes a later one, which others may not try.
fn warn_of_ephemeral_ports(domain: u16) {
    // Without this file, the range is unknown.
    let ephemeral =
        fs::read_to_string("/proc/sys/net/ipv4/ip_local_port_range").unwrap_or_default();
    if let Some((first, last)) =
        port_range(&ephemeral).filter(|&range| overlaps_ports_of(range, domain))
    {
        console::note(&format!(
            "warning: the ports of domain {domain} are among those that this machine assigns to any program ({first} to \
             {last}, /proc/sys/net/ipv4/ip_local_port_range), so that the other processes may fail to discover one; on \
             most machines domains up to 101 are safe"
        ));
    }
}

/// The two numbers of the kernel's range.
fn port_range(text: &str) -> Option<(usize, usize)> {
    let mut numbers = text.split_whitespace().map(str::parse);
    Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
}

fn overlaps_ports_of((first_assigned, last_assigned): (usize, usize), domain: u16) -> bool {
    let first = discovery_port(domain, 0);
    let last = discovery_port(domain, PARTICIPANTS_MAX - 1);
    first <= last_assigned && last >= first_assigned
}

/// Refuses more participants than one host and domain have ports for.
fn check_room(participants: usize, taken: usize) -> Result<(), Failure> {
    if participants + taken <= PARTICIPANTS_MAX {
        return Ok(());
    }
    let others = match taken {
        0 => String::new(),
        taken => format!(" and {taken} are taken"),
    };
    Err(Failure::BadInput(anyhow!(
        "this needs {participants} processes; one machine and domain has room for {PARTICIPANTS_MAX}{others}; host \
         several modules in one process with --modules-per-process"
    )))
}

/// The fewest modules a process with which everything fits among the first participants, one left for the user's own
/// tools; `None` if no number does.
fn modules_per_process_that_fit(modules: usize, taken: usize) -> Option<usize> {
    let hosts = FOUND_WITHOUT_MULTICAST.checked_sub(OTHER_PROCESSES + taken)?;
    if hosts == 0 {
        return None;
    }
    Some(modules.div_ceil(hosts)).filter(|&count| count <= MODULES_PER_PROCESS_MAX)
}

/// Restarts the launcher in a network namespace of its own, in place of this process: number, terminal and signals stay.
/// Returns only if that fails, with the reason.
fn enter_private_network(isolation: Isolation) -> anyhow::Error {
    let executable = match env::current_exe() {
        Ok(executable) => executable.into_os_string(),
        Err(error) => return anyhow!(error).context("cannot find the launcher's own program"),
    };
    let mut command: Vec<OsString> = vec![executable];
    command.extend(env::args_os().skip(1));
    command.push(PRIVATE_NETWORK_OPTION.into());
    anyhow!(isolated(isolation, command).exec()).context("cannot start `unshare`")
}

type Isolation = &'static [&'static str];

/// Root keeps the rights of root on files if no user namespace is needed; other users get one in which they may set up
/// their network.
const AS_ROOT: Isolation = &["--net", "--mount"];
const AS_USER: Isolation = &["--user", "--map-root-user", "--net", "--mount"];

fn usable_isolation() -> anyhow::Result<Isolation> {
    let candidates: &[Isolation] = if rustix::process::geteuid().is_root() {
        &[AS_ROOT, AS_USER]
    } else {
        &[AS_USER]
    };
    let mut refusal = anyhow!("no method was tried");
    for isolation in candidates {
        match probe(isolation) {
            Ok(()) => return Ok(isolation),
            Err(error) => refusal = error,
        }
    }
    Err(refusal)
}

fn probe(isolation: Isolation) -> anyhow::Result<()> {
    let output = isolated(isolation, ["true".into()])
        .stdin(Stdio::null())
        .output()
        .context("cannot start `unshare`")?;
    if output.status.success() {
        return Ok(());
    }
    let said = one_line(&String::from_utf8_lossy(&output.stderr));
    Err(match said.as_str() {
        "" => anyhow!("`unshare` ended with {}", output.status),
        said => anyhow!("{said}"),
    })
}

fn isolated(isolation: Isolation, command: impl IntoIterator<Item = OsString>) -> Command {
    let mut unshare = Command::new("unshare");
    unshare
        .args(isolation)
        .args(["--", "sh", "-c", SETUP, "formation"])
        .args(command);
    unshare
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ports_of_high_domains_are_assigned_to_other_programs() {
        let usual = port_range("32768\t60999\n").unwrap();
        for (domain, overlaps) in [
            (0, false),
            (100, false),
            (102, true),
            (200, true),
            (232, false),
        ] {
            assert_eq!(
                overlaps_ports_of(usual, domain),
                overlaps,
                "domain {domain}"
            );
        }
        assert_eq!(port_range("unlimited"), None);
    }

    #[test]
    fn the_suggested_number_leaves_one_participant_free() {
        assert_eq!(modules_per_process_that_fit(20, 0), Some(2));
        assert_eq!(modules_per_process_that_fit(21, 0), Some(3));
        assert_eq!(modules_per_process_that_fit(10, 9), Some(10));
        assert_eq!(modules_per_process_that_fit(10, 10), None);
        assert_eq!(modules_per_process_that_fit(10, 30), None);
        assert_eq!(modules_per_process_that_fit(1_000, 0), Some(100));
        assert_eq!(modules_per_process_that_fit(1_001, 0), None);
    }

    #[test]
    fn the_processes_stay_on_loopback_unless_a_variable_says_otherwise() {
        let resolved = |domain: Option<&str>, variables: &[(&str, &str)]| {
            environment(domain.map(|domain| domain.parse().unwrap()), |name| {
                variables
                    .iter()
                    .find(|(variable, _)| *variable == name)
                    .map(|(_, value)| (*value).to_owned())
            })
            .map(|found| (found.domain.number(), found.range))
            .map_err(|failure| failure.to_string())
        };
        const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
        assert_eq!(resolved(None, &[]), Ok((0, DiscoveryRange::Localhost)));
        assert_eq!(
            resolved(None, &[("ROS_DOMAIN_ID", "7"), (RANGE, "SUBNET")]),
            Ok((7, DiscoveryRange::Subnet))
        );
        assert_eq!(
            resolved(Some("9"), &[("ROS_DOMAIN_ID", "7"), (RANGE, "")]),
            Ok((9, DiscoveryRange::Localhost))
        );
        assert!(
            resolved(None, &[(RANGE, "OFF")])
                .unwrap_err()
                .contains("OFF")
        );
        assert!(
            resolved(None, &[(RANGE, "far")])
                .unwrap_err()
                .contains("far")
        );
    }

    #[test]
    fn too_many_processes_are_refused_with_what_to_do() {
        assert!(check_room(120, 0).is_ok());
        let refusal = check_room(119, 2).unwrap_err().to_string();
        assert!(refusal.contains("119 processes"), "{refusal}");
        assert!(refusal.contains("2 are taken"), "{refusal}");
        assert!(refusal.contains("--modules-per-process"), "{refusal}");
    }

    /// Machines may refuse namespaces; then the reason is one that can be shown.
    #[test]
    fn a_private_network_carries_multicast_or_says_why_there_is_none() {
        match usable_isolation() {
            Ok(isolation) => {
                let output = isolated(isolation, ["ip".into(), "-o".into(), "link".into()])
                    .output()
                    .unwrap();
                let links = String::from_utf8(output.stdout).unwrap();
                assert_eq!(links.lines().count(), 1, "{links}");
                assert!(links.contains("LOOPBACK,MULTICAST,UP"), "{links}");
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}
