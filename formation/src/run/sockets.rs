//! The sockets of this machine, as the kernel lists them, and the ports of a domain.

use std::collections::BTreeSet;
use std::fs;

/// The RTPS ports of one host and domain suffice for this many.
pub const PARTICIPANTS_MAX: usize = 120;

/// RTPS 2.5, section 9.6.2.3: DG.
const PORTS_OF_DOMAIN: usize = 250;

/// RTPS 2.5, section 9.6.2.3: PB + DG * domain + d1 + PG * participant.
pub fn discovery_port(domain: u16, participant: usize) -> usize {
    7_400 + PORTS_OF_DOMAIN * usize::from(domain) + 10 + 2 * participant
}

/// How many participants of a domain already run on this machine.
pub fn participants_taken(domain: u16) -> usize {
    participants_in(&udp_sockets(), domain)
}

/// Whether a program of this machine uses a port of this domain.
pub fn has_sockets(domain: u16) -> bool {
    let first = discovery_port(domain, 0) - 10;
    let mut ports = ports_of(&udp_sockets(), None).into_iter();
    ports.any(|port| (first..first + PORTS_OF_DOMAIN).contains(&port))
}

/// Whether a program of this machine listens on a TCP port. To connect would do as well, but a router with certificates takes
/// that for a link without one.
pub fn listens(port: u16) -> bool {
    let sockets = fs::read_to_string("/proc/net/tcp").unwrap_or_default();
    ports_of(&sockets, Some(LISTENING)).contains(&port.into())
}

/// The kernel's table of the UDP sockets of this network namespace. Without it, other programs count as in other domains.
fn udp_sockets() -> String {
    fs::read_to_string("/proc/net/udp").unwrap_or_default()
}

/// The state of a TCP socket that listens, in the kernel's table.
const LISTENING: &str = "0A";

/// The local ports of the kernel's table of sockets: of all, or of those in one state.
fn ports_of(sockets: &str, state: Option<&str>) -> BTreeSet<usize> {
    let ports = sockets.lines().filter_map(|line| {
        let mut columns = line.split_whitespace();
        let (_, port) = columns.nth(1)?.split_once(':')?;
        let is_wanted = state.is_none() || columns.nth(1) == state;
        usize::from_str_radix(port, 16).ok().filter(|_| is_wanted)
    });
    ports.collect()
}

/// Counts the participants whose discovery port is among the local addresses of a table of UDP sockets.
fn participants_in(sockets: &str, domain: u16) -> usize {
    let ports = ports_of(sockets, None);
    (0..PARTICIPANTS_MAX)
        .filter(|&participant| ports.contains(&discovery_port(domain, participant)))
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_that_listens_is_distinguished_from_a_link() {
        let sockets = "  sl  local_address rem_address   st tx_queue rx_queue\n\
            0: 0100007F:1D17 00000000:0000 0A 00000000:00000000\n\
            1: 0100007F:1D18 0100007F:1D17 01 00000000:00000000\n";
        assert_eq!(ports_of(sockets, None), [0x1D17, 0x1D18].into());
        assert_eq!(ports_of(sockets, Some(LISTENING)), [0x1D17].into());
        let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
        assert!(listens(listener.local_addr().unwrap().port()));
    }

    #[test]
    fn participants_are_counted_by_their_discovery_ports() {
        // Ports 7410 (domain 0, participant 0), 7412 twice, 7411 (user data), 7400 (multicast), 7660 (domain 1).
        let table = "\
   sl  local_address rem_address   st tx_queue rx_queue
  100: 0100007F:1CF2 00000000:0000 07 00000000:00000000
  101: 00000000:1CF4 00000000:0000 07 00000000:00000000
  102: 0100007F:1CF4 00000000:0000 07 00000000:00000000
  103: 0100007F:1CF3 00000000:0000 07 00000000:00000000
  104: 00000000:1CE8 00000000:0000 07 00000000:00000000
  105: 00000000:1DEC 00000000:0000 07 00000000:00000000
";
        assert_eq!(participants_in(table, 0), 2);
        assert_eq!(participants_in(table, 1), 1);
        assert_eq!(participants_in(table, 2), 0);
        assert_eq!(participants_in("", 0), 0);
    }
}
