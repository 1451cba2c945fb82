//! DDS domains that tests share with no other test, and how many processes of tests run at the same time.

use std::fs::File;
use std::net::{Ipv4Addr, UdpSocket};
use std::ops::Deref;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Condvar, Mutex, OnceLock, PoisonError};

use crate::programs::target_directory;

/// How many processes the tests may have at the same time. They mostly wait for time-outs.
const PLACES: u32 = 36;

/// The domains whose ports lie below the ephemeral ports of Linux, without domain 0, the default of every program.
const DOMAINS: u32 = 100;

/// The RTPS ports of a domain begin at 7400 + 250 times its number (RTPS 2.5, 9.6.2.3). The last of the 250 belongs to
/// participant 119, which no test has, so a test claims a domain by binding that port. The kernel returns it when the
/// process ends, and counts ports for each network namespace separately, as DDS traffic is.
fn claim(domain: u32) -> Option<UdpSocket> {
    let port = u16::try_from(7_400 + 250 * domain + 249).unwrap();
    UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok()
}

/// A DDS domain that no other test on this machine uses, together with the right to run some processes. It reads as the
/// domain's number.
pub struct Domain {
    number: String,
    _claim: UdpSocket,
    _places: Places,
}

impl Domain {
    /// For a test with this many processes. Others may run at the same time.
    ///
    /// # Panics
    /// When all domains are taken, or the lock in the build's target directory cannot be had.
    #[must_use]
    pub fn for_processes(count: u32) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let places = Places::take(count);
        // Each test begins its search elsewhere: what is left of an earlier test may still say its last words.
        let first = std::process::id() * 7 + NEXT.fetch_add(1, Ordering::Relaxed);
        let mut domains = (0..DOMAINS).map(|step| 1 + (first.wrapping_add(step)) % DOMAINS);
        let (number, claim) = domains
            .find_map(|domain| Some((domain, claim(domain)?)))
            .unwrap();
        Self {
            number: number.to_string(),
            _claim: claim,
            _places: places,
        }
    }

    /// For a test that the processes of other tests would disturb.
    ///
    /// # Panics
    /// As [`Self::for_processes`].
    #[must_use]
    pub fn alone() -> Self {
        Self::for_processes(PLACES)
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

/// Some of the [`PLACES`], returned when it is dropped.
struct Places(u32);

static TAKEN: Mutex<u32> = Mutex::new(0);
static RETURNED: Condvar = Condvar::new();

impl Places {
    /// Waits until this number of places is free. A test that needs many does not hold up those that need few: it has room at
    /// the latest when no other test is left.
    fn take(count: u32) -> Self {
        // A test of another test program has no places here; one such program runs at a time.
        static PROGRAM: OnceLock<File> = OnceLock::new();
        PROGRAM.get_or_init(|| {
            let lock = File::create(target_directory().join("process_tests.lock")).unwrap();
            lock.lock().unwrap();
            lock
        });
        let count = count.min(PLACES);
        let taken = TAKEN.lock().unwrap_or_else(PoisonError::into_inner);
        let has_no_room = |taken: &mut u32| *taken + count > PLACES;
        let free = RETURNED.wait_while(taken, has_no_room);
        *free.unwrap_or_else(PoisonError::into_inner) += count;
        Self(count)
    }
}

impl Drop for Places {
    fn drop(&mut self) {
        *TAKEN.lock().unwrap_or_else(PoisonError::into_inner) -= self.0;
        RETURNED.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn tests_at_the_same_time_have_different_domains() {
        let domains: Vec<Domain> = (0..20).map(|_| Domain::for_processes(1)).collect();
        let numbers: BTreeSet<u16> = domains.iter().map(Domain::number).collect();
        assert_eq!(numbers.len(), 20);
        for domain in domains {
            let number = u32::from(domain.number());
            assert!(claim(number).is_none());
            drop(domain);
        }
    }
}
