//! Hosts, which fail with all modules on them.

use formation_model::ModuleId;

use super::{Drawing, Fault, HEARD};

/// The most modules that one host has.
const MODULES_MAX: u64 = 4;

impl Drawing<'_> {
    /// All modules are on hosts. One to three times a host crashes and starts again, stops, is cut off, or is suspended.
    pub(super) fn hosts(&mut self) {
        let hosts = self.spread();
        // Each fails once at most, and after its clock was compared with those of others.
        let failing = 1 + self.random.index(hosts.len().min(3));
        for host in hosts.into_iter().take(failing) {
            let at = self.time(HEARD, self.end);
            match self.random.below(4) {
                0 => {
                    let again = self.time(at, self.end);
                    for &module in &host {
                        self.add(at, Fault::Crash(module));
                        self.add(again, Fault::Restart(module));
                    }
                }
                1 => {
                    let span = self.millis(200, 12_000);
                    for &module in &host {
                        self.add(at, Fault::Pause(module, span));
                    }
                }
                2 if host.len() < self.modules.len() => {
                    let healed = self.time(at, self.end);
                    self.add(at, Fault::Cut(host.into_iter().collect()));
                    self.add(healed, Fault::Heal);
                }
                _ => {
                    let span = self.millis(300, 40_000);
                    for &module in &host {
                        self.add(at, Fault::Suspend(module, span));
                    }
                }
            }
        }
    }

    /// The modules of each host, in random order.
    fn spread(&mut self) -> Vec<Vec<ModuleId>> {
        let mut left = self.shuffled();
        let mut hosts = Vec::new();
        while !left.is_empty() {
            let count = usize::try_from(1 + self.random.below(MODULES_MAX)).unwrap_or(1);
            hosts.push(left.split_off(left.len().saturating_sub(count)));
        }
        hosts
    }
}
