//! Network namespaces, and a network of several sides that can be cut off one by one.
//!
//! A namespace lives as long as a process in it. Each is held by one that waits for the end of its input, so that it goes
//! with the test, however that ends; no name is left behind anywhere.

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::tools::{Tool, tool_or_skip};

/// How to make and enter namespaces, from the most to the least rights.
const WAYS: [Way; 2] = [
    Way {
        make: &["--net"],
        enter: &["--net"],
    },
    Way {
        make: &["--user", "--map-root-user", "--net"],
        enter: &["--user", "--preserve-credentials", "--net"],
    },
];

#[derive(Clone, Copy)]
struct Way {
    make: &'static [&'static str],
    enter: &'static [&'static str],
}

/// A network namespace; it ends with this value.
pub struct Namespace {
    holder: Child,
    way: Way,
}

/// What the first of the ways gives that works, else why none does.
fn by_any_way<T>(make: impl Fn(Way) -> Result<T, String>) -> Result<T, String> {
    let mut refusals = Vec::new();
    for way in WAYS {
        match make(way) {
            Ok(made) => return Ok(made),
            Err(refusal) => refusals.push(refusal),
        }
    }
    let refusals = refusals.join("; ");
    Err(format!("no network namespace can be made ({refusals})"))
}

/// Whether more than twelve processes on loopback find each other, which takes multicast on `lo` or a network namespace.
/// `None`, after a line that says so, where they do not.
///
/// # Panics
/// When they do not and `FORMATION_REQUIRE_TOOLS` names namespaces.
#[must_use]
pub fn room_for_many_processes() -> Option<()> {
    const IFF_MULTICAST: u32 = 0x1000;
    let flags = fs::read_to_string("/sys/class/net/lo/flags").unwrap_or_default();
    let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).unwrap_or(0);
    if flags & IFF_MULTICAST != 0 {
        return Some(());
    }
    Namespace::with_loopback().map(drop)
}

impl Namespace {
    /// A network namespace with nothing but a loopback interface that takes multicast; `None`, after a line that says so,
    /// where none can be made.
    ///
    /// # Panics
    /// When none can be made and `FORMATION_REQUIRE_TOOLS` names namespaces.
    #[must_use]
    pub fn with_loopback() -> Option<Self> {
        let made = by_any_way(|way| {
            let own = fs::read_link("/proc/self/ns/net").unwrap();
            let mut unshare = Command::new("unshare");
            unshare.args(way.make).arg("--");
            let namespace = Self::held_by(unshare, way, &[own])?;
            namespace.ip("link set lo up multicast on")?;
            Ok(namespace)
        });
        tool_or_skip(Tool::Namespaces, made)
    }

    fn held_by(mut command: Command, way: Way, differs_from: &[PathBuf]) -> Result<Self, String> {
        let holder = command
            .arg("cat")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start {command:?}: {error}"))?;
        let mut namespace = Self { holder, way };
        let deadline = Instant::now() + Duration::from_secs(10);
        while Instant::now() < deadline {
            if namespace.holder.try_wait().unwrap().is_some() {
                break;
            }
            if let Some(identity) = namespace.identity()
                && !differs_from.contains(&identity)
            {
                return Ok(namespace);
            }
            thread::sleep(Duration::from_millis(10));
        }
        let _ = namespace.holder.kill();
        let stderr = namespace.holder.stderr.take();
        let said = stderr.and_then(|said| std::io::read_to_string(said).ok());
        Err(said.unwrap_or_default().trim().to_owned())
    }

    /// Which namespace the holder is in.
    fn identity(&self) -> Option<PathBuf> {
        fs::read_link(format!("/proc/{}/ns/net", self.holder.id())).ok()
    }

    /// What a program is to be started with, so that it runs in here; its process is the one that is started.
    #[must_use]
    pub fn command(&self) -> Command {
        let mut command = Command::new("nsenter");
        command
            .arg("--target")
            .arg(self.holder.id().to_string())
            .args(self.way.enter)
            .arg("--");
        command
    }

    /// Runs `ip` in here.
    fn ip(&self, arguments: &str) -> Result<(), String> {
        let output = self
            .command()
            .args(["sh", "-c", "PATH=\"$PATH:/usr/sbin:/sbin\"; exec ip $0"])
            .arg(arguments)
            .output()
            .map_err(|error| format!("cannot start nsenter: {error}"))?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        Err(format!("ip {arguments}: {}", said.trim()))
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}

/// Network namespaces with a switch between them.
pub struct Network {
    sides: Vec<Namespace>,
    hub: Namespace,
}

impl Network {
    /// This many sides that reach each other, at the addresses 10.77.0.1 and on; `None`, after a line that says so, where no namespace can be made.
    ///
    /// # Panics
    /// When none can be made and `FORMATION_REQUIRE_TOOLS` names namespaces.
    #[must_use]
    pub fn with_sides(count: usize) -> Option<Self> {
        tool_or_skip(Tool::Namespaces, by_any_way(|way| Self::made(way, count)))
    }

    /// The address of a side.
    #[must_use]
    pub fn address(number: usize) -> String {
        format!("10.77.0.{}", number + 1)
    }

    fn made(way: Way, count: usize) -> Result<Self, String> {
        let own = fs::read_link("/proc/self/ns/net").unwrap();
        let mut unshare = Command::new("unshare");
        unshare.args(way.make).arg("--");
        let hub = Namespace::held_by(unshare, way, std::slice::from_ref(&own))?;
        let taken = [own, hub.identity().unwrap_or_default()];
        let mut sides = Vec::new();
        for _ in 0..count {
            let mut within = hub.command();
            within.args(["unshare", "--net", "--"]);
            sides.push(Namespace::held_by(within, way, &taken)?);
        }
        hub.ip("link add hub type bridge mcast_snooping 0")?;
        hub.ip("link set hub up")?;
        for (number, side) in sides.iter().enumerate() {
            let holder = side.holder.id();
            hub.ip(&format!(
                "link add port{number} type veth peer name eth0 netns {holder}"
            ))?;
            hub.ip(&format!("link set port{number} master hub up"))?;
            side.ip("link set lo up")?;
            let address = Self::address(number);
            side.ip(&format!("address add {address}/24 dev eth0"))?;
            side.ip("link set eth0 up")?;
        }
        Ok(Self { sides, hub })
    }

    /// One side, from 0 on.
    #[must_use]
    pub fn side(&self, number: usize) -> &Namespace {
        &self.sides[number]
    }

    /// Takes the address of a side away, as before its network is up.
    pub fn take_address(&self, number: usize) {
        self.sides[number].ip("address flush dev eth0").unwrap();
    }

    /// Gives a side an address that ends in this number.
    pub fn give_address(&self, number: usize, last: u8) {
        let give = format!("address add 10.77.0.{last}/24 dev eth0");
        self.sides[number].ip(&give).unwrap();
    }

    /// Gives a side a second interface, with an address that ends in this number and with nobody behind it.
    pub fn give_interface(&self, number: usize, last: u8) {
        let side = &self.sides[number];
        side.ip("link add eth1 type veth peer name nobody").unwrap();
        side.ip(&format!("address add 10.78.0.{last}/24 dev eth1"))
            .unwrap();
        side.ip("link set nobody up").unwrap();
        side.ip("link set eth1 up").unwrap();
    }

    /// Takes the link of a side down, or up again.
    pub fn set_link(&self, number: usize, is_up: bool) {
        let state = if is_up { "up" } else { "down" };
        self.sides[number]
            .ip(&format!("link set eth0 {state}"))
            .unwrap();
    }

    /// Nothing passes between side 1 and the others any more; within each, all goes on.
    pub fn cut(&self) {
        self.hub.ip("link set port1 nomaster").unwrap();
    }

    /// All passes again.
    pub fn heal(&self) {
        self.hub.ip("link set port1 master hub").unwrap();
    }
}
