//! Which domain and namespace a run on this machine has, so that two launchers that choose at the same moment choose
//! differently.
//!
//! A claim is an abstract Unix socket with a name of the domain and namespace: the kernel gives a name to one process only,
//! takes it back when the process ends, however it ends, and counts names for each network namespace separately, as DDS
//! traffic is. A second socket, whose name has the session, is for messages to people.

use std::fmt;
use std::fs;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::process;

/// The right of this run to a domain and namespace, while it is kept.
pub struct DomainClaim {
    name: String,
    _socket: UnixDatagram,
    announced: Option<UnixDatagram>,
}

/// The run that has a claim.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Holder {
    /// Its session, and the number of its process, once it has announced them.
    announced: Option<(u32, u32)>,
}

/// Why there is no claim.
#[derive(Debug)]
pub enum ClaimError {
    /// Another run has it.
    Held(Holder),
    /// The system does not offer such names.
    Unavailable(io::Error),
}

impl fmt::Display for Holder {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.announced {
            Some((session, process)) => {
                write!(
                    formatter,
                    "`formation run` of session {session}, process {process}"
                )
            }
            None => write!(formatter, "`formation run` that is starting"),
        }
    }
}

impl DomainClaim {
    /// Claims a domain and namespace on a carrier of messages.
    ///
    /// # Errors
    /// Another run has it, or the system does not offer such names.
    pub fn take(carrier: &str, domain: u16, namespace: &str) -> Result<Self, ClaimError> {
        let name = format!("formation-run:{carrier}:{domain}:{namespace}");
        match bind(&name) {
            Ok(socket) => Ok(Self {
                name,
                _socket: socket,
                announced: None,
            }),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                // Without this file, the run is named without its session.
                let sockets = fs::read_to_string("/proc/net/unix").unwrap_or_default();
                Err(ClaimError::Held(holder_in(&sockets, &name)))
            }
            Err(error) => Err(ClaimError::Unavailable(error)),
        }
    }

    /// Names the session of this run to other launchers.
    pub fn announce(&mut self, session: u32) {
        // Without it, the messages of other launchers have no session.
        self.announced = bind(&announcement(&self.name, session, process::id())).ok();
    }
}

fn bind(name: &str) -> io::Result<UnixDatagram> {
    UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(name)?)
}

fn announcement(name: &str, session: u32, process: u32) -> String {
    format!("{name}#{session}#{process}")
}

/// What the holder of a claim has announced, in the kernel's table of Unix sockets.
fn holder_in(sockets: &str, name: &str) -> Holder {
    let announced = sockets.lines().find_map(|line| {
        let (_, path) = line.rsplit_once('@')?;
        let (session, process) = path
            .strip_prefix(name)?
            .strip_prefix('#')?
            .split_once('#')?;
        Some((session.parse().ok()?, process.parse().ok()?))
    });
    Holder { announced }
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn a_claim_is_held_once_by_name_and_is_free_again_after_its_holder() {
        // No other test uses this name, at the same time or of another build.
        let carrier = format!("test{}", process::id());
        let mut first = DomainClaim::take(&carrier, 7, "/formation").ok().unwrap();
        let held = |domain, namespace| match DomainClaim::take(&carrier, domain, namespace) {
            Err(ClaimError::Held(holder)) => Some(holder),
            _ => None,
        };
        let starting = held(7, "/formation").unwrap();
        assert_eq!(starting.to_string(), "`formation run` that is starting");
        first.announce(42);
        let named = format!("`formation run` of session 42, process {}", process::id());
        assert_eq!(held(7, "/formation").unwrap().to_string(), named);
        assert_eq!(held(7, "/fleet"), None);
        assert_eq!(held(8, "/formation"), None);
        drop(first);
        // A process that another test is starting has the socket as well until it runs its program.
        let free_by = Instant::now() + Duration::from_secs(10);
        while let Some(holder) = held(7, "/formation") {
            assert!(Instant::now() < free_by, "still held by {holder}");
            thread::sleep(Duration::from_millis(10));
        }
    }

    #[test]
    fn the_session_is_that_of_this_name() {
        let table = "\
Num       RefCount Protocol Flags    Type St Inode Path
0000000000000000: 00000002 00000000 00000000 0002 01 11 @formation-run:dds:0:/formation
0000000000000000: 00000002 00000000 00000000 0002 01 12 @formation-run:dds:0:/formation_2#5#6
0000000000000000: 00000002 00000000 00000000 0002 01 13 /run/user/1#2#3
0000000000000000: 00000002 00000000 00000000 0002 01 14 @formation-run:dds:0:/formation#42#4711
";
        let announced = |name| holder_in(table, name).announced;
        assert_eq!(
            announced("formation-run:dds:0:/formation"),
            Some((42, 4711))
        );
        assert_eq!(announced("formation-run:dds:1:/formation"), None);
    }
}
