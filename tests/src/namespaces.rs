//! Network namespaces, and a network of two sides that can be cut in between.
//!
//! A namespace lives as long as a process in it. Each is held by one that waits for the end of its input, so that it goes
//! with the test, however that ends; no name is left behind anywhere.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// With this in the environment, a machine on which no namespace can be made fails the test.
const REQUIRED: &str = "FORMATION_REQUIRE_NAMESPACES";

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

impl Namespace {
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
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new("nsenter");
        command
            .arg("--target")
            .arg(self.holder.id().to_string())
            .args(self.way.enter)
            .arg("--");
        command
    }

    /// Runs `ip` in here.
    fn ip(&self, arguments: &str) {
        let output = self
            .command()
            .args(["sh", "-c", "PATH=\"$PATH:/usr/sbin:/sbin\"; exec ip $0"])
            .arg(arguments)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "ip {arguments}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}

/// Two network namespaces with a switch between them.
pub struct Network {
    sides: Vec<Namespace>,
    hub: Namespace,
}

impl Network {
    /// Two sides that hear each other; `None`, said aloud with `skipped`, where no namespace can be made.
    #[must_use]
    pub fn with_two_sides(skipped: &str) -> Option<Self> {
        let mut refusals = Vec::new();
        for way in WAYS {
            match Self::made(way) {
                Ok(network) => return Some(network),
                Err(refusal) => refusals.push(refusal),
            }
        }
        let refusal = refusals.join("; ");
        assert!(
            std::env::var_os(REQUIRED).is_none(),
            "{REQUIRED} is set, but no network namespace can be made: {refusal}"
        );
        // Not by a macro: the test harness would keep it to itself.
        let mut stderr = std::io::stderr();
        writeln!(
            stderr,
            "SKIPPED: no network namespace can be made ({refusal}), so {skipped}; run as root, or allow user namespaces"
        )
        .unwrap();
        None
    }

    fn made(way: Way) -> Result<Self, String> {
        let own = fs::read_link("/proc/self/ns/net").unwrap();
        let mut unshare = Command::new("unshare");
        unshare.args(way.make).arg("--");
        let hub = Namespace::held_by(unshare, way, std::slice::from_ref(&own))?;
        let taken = [own, hub.identity().unwrap_or_default()];
        let mut sides = Vec::new();
        for _ in 0..2 {
            let mut within = hub.command();
            within.args(["unshare", "--net", "--"]);
            sides.push(Namespace::held_by(within, way, &taken)?);
        }
        hub.ip("link add hub type bridge mcast_snooping 0");
        hub.ip("link set hub up");
        for (number, side) in sides.iter().enumerate() {
            let holder = side.holder.id();
            hub.ip(&format!(
                "link add port{number} type veth peer name eth0 netns {holder}"
            ));
            hub.ip(&format!("link set port{number} master hub up"));
            side.ip("link set lo up");
            side.ip(&format!("address add 10.77.0.{}/24 dev eth0", number + 1));
            side.ip("link set eth0 up");
        }
        Ok(Self { sides, hub })
    }

    /// One side, 0 or 1.
    #[must_use]
    pub fn side(&self, number: usize) -> &Namespace {
        &self.sides[number]
    }

    /// Nothing passes between the sides any more; within each, all goes on.
    pub fn cut(&self) {
        self.hub.ip("link set port1 nomaster");
    }

    /// All passes again.
    pub fn heal(&self) {
        self.hub.ip("link set port1 master hub");
    }
}
