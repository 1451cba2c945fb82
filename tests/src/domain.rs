//! DDS domains that tests share with no other test, and which tests may run at the same time.

use std::fs::File;
use std::net::{Ipv4Addr, UdpSocket};
use std::ops::Deref;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::programs::target_directory;

/// The domains whose ports lie below the ephemeral ports of Linux, without domain 0, the default of every program.
const DOMAINS: u32 = 100;

/// The RTPS ports of a domain begin at 7400 + 250 times its number (RTPS 2.5, 9.6.2.3). The last of the 250 belongs to
/// participant 119, which no test has, so a test claims a domain by binding that port. The kernel returns it when the
/// process ends, and counts ports for each network namespace separately, as DDS traffic is.
fn claim(domain: u32) -> Option<UdpSocket> {
    let port = u16::try_from(7_400 + 250 * domain + 249).unwrap();
    UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok()
}

/// A DDS domain that no other test on this machine uses, together with this test's turn. It reads as the domain's number.
pub struct Domain {
    number: String,
    _claim: UdpSocket,
    _turn: File,
}

impl Domain {
    /// For a test with a few processes that mostly wait: others of its kind may run at the same time.
    ///
    /// # Panics
    /// When all domains are taken, or the lock in the build's target directory cannot be had.
    #[must_use]
    pub fn shared() -> Self {
        Self::taken(File::lock_shared)
    }

    /// For a test with many processes, or with faults that a busy machine would add to: no other process test runs at the
    /// same time.
    ///
    /// # Panics
    /// As [`Self::shared`].
    #[must_use]
    pub fn alone() -> Self {
        Self::taken(File::lock)
    }

    fn taken(lock: impl FnOnce(&File) -> std::io::Result<()>) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        // Locked for each test by itself, so that it holds between threads and between test processes alike.
        let turn = File::create(target_directory().join("process_tests.lock")).unwrap();
        lock(&turn).unwrap();
        // Each test begins its search elsewhere: what is left of an earlier test may still say its last words.
        let first = std::process::id() * 7 + NEXT.fetch_add(1, Ordering::Relaxed);
        let mut domains = (0..DOMAINS).map(|step| 1 + (first.wrapping_add(step)) % DOMAINS);
        let (number, claim) = domains
            .find_map(|domain| Some((domain, claim(domain)?)))
            .unwrap();
        Self {
            number: number.to_string(),
            _claim: claim,
            _turn: turn,
        }
    }

    /// The number.
    #[must_use]
    pub fn number(&self) -> u16 {
        self.number.parse().unwrap()
    }
}

impl Deref for Domain {
    type Target = str;

    fn deref(&self) -> &str {
        &self.number
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn tests_at_the_same_time_have_different_domains() {
        let domains: Vec<Domain> = (0..20).map(|_| Domain::shared()).collect();
        let numbers: BTreeSet<u16> = domains.iter().map(Domain::number).collect();
        assert_eq!(numbers.len(), 20);
        for domain in domains {
            let number = u32::from(domain.number());
            assert!(claim(number).is_none());
            drop(domain);
        }
    }
}
