//! Whether the machine's network interfaces let the processes on it find each other.

use crate::environment::DiscoveryRange;

/// Without multicast, a participant is sought at this many fixed ports only: RustDDS announces itself to the
/// participants 0 to 11 of the same host.
const SOUGHT_WITHOUT_MULTICAST: u16 = 12;

/// The most participants of one host and domain that discover each other without multicast: twelve that every
/// participant seeks, and one more that seeks them.
pub const PARTICIPANTS_WITHOUT_MULTICAST: u16 = SOUGHT_WITHOUT_MULTICAST + 1;

/// One network interface of this machine, as far as discovery is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkInterface {
    /// Whether it can be used at all.
    pub is_up: bool,
    /// Whether its traffic stays on this machine.
    pub is_loopback: bool,
    /// Whether it takes multicast.
    pub takes_multicast: bool,
}

/// The interfaces of this process's network namespace, as the DDS library sees them too.
///
/// `/sys/class/net` does not serve: it shows the network namespace of the process that mounted it.
#[must_use]
pub fn interfaces() -> Vec<NetworkInterface> {
    netdev::get_interfaces()
        .iter()
        .map(|interface| NetworkInterface {
            is_up: interface.is_up(),
            is_loopback: interface.is_loopback(),
            takes_multicast: interface.is_multicast(),
        })
        .collect()
}

/// Why processes on this machine would not find each other, and what to do about it; `None` when they will.
///
/// `participants` counts the processes of this host and domain. Machines that do not show their interfaces are
/// taken to be in order.
#[must_use]
pub fn discovery_obstacle(
    range: DiscoveryRange,
    interfaces: &[NetworkInterface],
    participants: u16,
) -> Option<String> {
    if interfaces.is_empty() || range == DiscoveryRange::Off {
        return None;
    }
    let localhost = range == DiscoveryRange::Localhost;
    let loopback_up = interfaces
        .iter()
        .any(|interface| interface.is_loopback && interface.is_up);
    if localhost && !loopback_up {
        return Some(
            "the loopback interface is down, so no process can reach another; \
             run `sudo ip link set lo up multicast on`"
                .to_owned(),
        );
    }
    let multicast = interfaces.iter().any(|interface| {
        interface.is_up && interface.takes_multicast && (interface.is_loopback || !localhost)
    });
    if multicast || participants <= PARTICIPANTS_WITHOUT_MULTICAST {
        return None;
    }
    let which = if localhost {
        "the loopback interface takes no multicast"
    } else {
        "no network interface takes multicast"
    };
    Some(format!(
        "{which}, so at most {PARTICIPANTS_WITHOUT_MULTICAST} processes of one domain find each other on this \
         machine, and this would be number {participants}; run `sudo ip link set lo multicast on` with discovery \
         range LOCALHOST, or start everything inside `unshare -rn sh -c 'ip link set lo up multicast on; ...'`, or \
         host several modules in one process with `--modules`"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOPBACK: NetworkInterface = NetworkInterface {
        is_up: true,
        is_loopback: true,
        takes_multicast: false,
    };
    const ETHERNET: NetworkInterface = NetworkInterface {
        is_up: true,
        is_loopback: false,
        takes_multicast: true,
    };

    #[test]
    fn thirteen_processes_need_no_multicast_and_fourteen_do() {
        assert_eq!(
            discovery_obstacle(DiscoveryRange::Localhost, &[LOOPBACK], 13),
            None
        );
        let obstacle = discovery_obstacle(DiscoveryRange::Localhost, &[LOOPBACK], 14).unwrap();
        assert!(
            obstacle.contains("ip link set lo multicast on"),
            "{obstacle}"
        );
        assert!(obstacle.contains("--modules"), "{obstacle}");
        let multicast = NetworkInterface {
            takes_multicast: true,
            ..LOOPBACK
        };
        assert_eq!(
            discovery_obstacle(DiscoveryRange::Localhost, &[multicast], 100),
            None
        );
    }

    #[test]
    fn another_interface_helps_only_beyond_the_loopback_range() {
        let both = [ETHERNET, LOOPBACK];
        assert_eq!(discovery_obstacle(DiscoveryRange::Subnet, &both, 100), None);
        assert!(discovery_obstacle(DiscoveryRange::Localhost, &both, 14).is_some());
        let unplugged = NetworkInterface {
            is_up: false,
            ..ETHERNET
        };
        assert!(discovery_obstacle(DiscoveryRange::Subnet, &[unplugged, LOOPBACK], 14).is_some());
    }

    #[test]
    fn a_loopback_that_is_down_is_reported_at_once() {
        let down = NetworkInterface {
            is_up: false,
            ..LOOPBACK
        };
        let obstacle = discovery_obstacle(DiscoveryRange::Localhost, &[down], 1).unwrap();
        assert!(obstacle.contains("ip link set lo up"), "{obstacle}");
        assert_eq!(discovery_obstacle(DiscoveryRange::Off, &[down], 50), None);
        assert_eq!(
            discovery_obstacle(DiscoveryRange::Localhost, &[], 50),
            None,
            "a machine that does not show its interfaces is taken to be in order"
        );
    }

    #[test]
    fn this_machine_has_a_loopback_interface() {
        assert!(interfaces().iter().any(|interface| interface.is_loopback));
    }
}
