//! Whether the machine got addresses since a process joined the graph, at which nobody can reach that process.
//!
//! The DDS library reads the interfaces once, when a participant is created: it joins the multicast groups of those that
//! exist then, and announces their addresses. A network that comes later, or comes back with another address, is never
//! heard. Only a new participant hears it.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::fmt;
use std::net::Ipv4Addr;
use std::time::{Duration, Instant};

use crate::environment::DiscoveryRange;

/// Between two looks at the addresses. A change counts once two looks in a row agree, as a renewal first takes the old
/// address away.
const INTERVAL: Duration = Duration::from_secs(1);

/// One address of an interface that leads out of this machine.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Address {
    /// The number of the interface, which a new interface of the same name does not have.
    interface: u32,
    ip: Ipv4Addr,
    name: String,
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} on {}", self.ip, self.name)
    }
}

/// The addresses of this machine at one moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Addresses {
    /// All that the interfaces have, also while their link is down.
    assigned: BTreeSet<Address>,
    /// Those that carry traffic.
    usable: BTreeSet<Address>,
}

impl Addresses {
    fn now() -> Self {
        let mut addresses = Self::default();
        for interface in netdev::get_interfaces() {
            if interface.is_loopback() || !interface.is_multicast() {
                continue;
            }
            let carries = interface.is_up() && interface.is_running();
            for net in &interface.ipv4 {
                let address = Address {
                    interface: interface.index,
                    ip: net.addr(),
                    name: interface.name.clone(),
                };
                if carries {
                    addresses.usable.insert(address.clone());
                }
                addresses.assigned.insert(address);
            }
        }
        addresses
    }
}

/// What a participant knows of the machine's addresses.
#[derive(Debug)]
struct Joined {
    /// Those that it was created with and that were assigned ever since; the kernel forgets the multicast groups of
    /// an interface whose address is taken away.
    known: BTreeSet<Address>,
    previous: Addresses,
}

impl Joined {
    fn with(addresses: Addresses) -> Self {
        Self {
            known: addresses.assigned.clone(),
            previous: addresses,
        }
    }

    /// Takes in what the addresses are now. Returns those at which the participant cannot be reached, once they stay.
    fn unreached(&mut self, now: Addresses) -> Vec<Address> {
        self.known.retain(|address| {
            let stays = now.assigned.contains(address);
            if !stays {
                tracing::warn!("the address {address} of this machine is gone");
            }
            stays
        });
        let unreached = now.usable.difference(&self.known);
        let unreached = unreached.filter(|address| self.previous.usable.contains(address));
        let unreached = unreached.cloned().collect();
        self.previous = now;
        unreached
    }
}

/// Watches the addresses of this machine for one participant.
pub(crate) struct AddressWatchdog {
    /// `None` where the participant does not look beyond this machine.
    joined: Option<RefCell<Joined>>,
    looked_at: Cell<Instant>,
}

impl AddressWatchdog {
    /// To be called before the participant is created, so that no address comes in between unnoticed.
    pub(crate) fn before_participant(range: DiscoveryRange) -> Self {
        let looks_beyond = match range {
            DiscoveryRange::Off | DiscoveryRange::Localhost => false,
            DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => true,
        };
        Self {
            joined: looks_beyond.then(|| RefCell::new(Joined::with(Addresses::now()))),
            looked_at: Cell::new(Instant::now()),
        }
    }

    /// The addresses at which the participant cannot be reached, in words; looks every [`INTERVAL`] only.
    pub(crate) fn unreached(&self) -> Option<String> {
        let joined = self.joined.as_ref()?;
        if self.looked_at.get().elapsed() < INTERVAL {
            return None;
        }
        self.looked_at.set(Instant::now());
        let unreached = joined.borrow_mut().unreached(Addresses::now());
        if unreached.is_empty() {
            return None;
        }
        let unreached = unreached.iter().map(Address::to_string);
        Some(unreached.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(interface: u32, last: u8) -> Address {
        Address {
            interface,
            ip: Ipv4Addr::new(10, 5, 0, last),
            name: format!("wlan{interface}"),
        }
    }

    fn addresses(assigned: &[Address], usable: &[Address]) -> Addresses {
        Addresses {
            assigned: assigned.iter().cloned().collect(),
            usable: usable.iter().cloned().collect(),
        }
    }

    #[test]
    fn an_address_that_comes_late_counts_once_it_stays() {
        let late = [address(2, 1)];
        let mut joined = Joined::with(Addresses::default());
        assert_eq!(joined.unreached(addresses(&late, &[])), [], "no link yet");
        assert_eq!(joined.unreached(addresses(&late, &late)), []);
        assert_eq!(joined.unreached(addresses(&late, &late)), late);
    }

    #[test]
    fn a_link_that_comes_back_with_its_address_changes_nothing() {
        let own = [address(2, 1)];
        let mut joined = Joined::with(addresses(&own, &own));
        for usable in [&own[..], &[], &[], &own, &own, &own] {
            assert_eq!(joined.unreached(addresses(&own, usable)), []);
        }
    }

    #[test]
    fn an_address_that_was_taken_away_is_new_when_it_returns() {
        let own = [address(2, 1)];
        let mut joined = Joined::with(addresses(&own, &own));
        assert_eq!(joined.unreached(Addresses::default()), []);
        assert_eq!(joined.unreached(addresses(&own, &own)), []);
        assert_eq!(joined.unreached(addresses(&own, &own)), own);
    }

    #[test]
    fn a_renewed_address_and_one_of_a_second_interface_count_and_the_old_one_does_not() {
        let (old, renewed, second) = (address(2, 1), address(2, 7), address(3, 1));
        let mut joined = Joined::with(addresses(
            std::slice::from_ref(&old),
            std::slice::from_ref(&old),
        ));
        let present = [renewed.clone(), second.clone()];
        assert_eq!(joined.unreached(addresses(&present, &present)), []);
        assert_eq!(joined.unreached(addresses(&present, &present)), present);
    }
}
