//! The faults of a run in which the membership changes step by step.

use std::collections::BTreeSet;
use std::time::Duration;

use super::{Drawing, Fault};

impl Drawing<'_> {
    /// Draws churn: any module may crash, and restart, and any may be cut off. In half of the runs the last cut stays, and in
    /// a quarter a stranger takes part. It lasts four times as long as other faults, as the modules agree after each change.
    pub(super) fn churn(&mut self) {
        let end = 4 * self.end;
        let has_stranger = self.one_in(4);
        let mut crashed = BTreeSet::new();
        let mut at = self.millis(4_000, 6_000);
        while at < end {
            let module = self.module();
            let fault = match self.random.below(8) {
                0 | 1 => Fault::Cut(self.some_modules()),
                2 => Fault::Heal,
                3 if has_stranger => Fault::ForgeRoster,
                _ if crashed.remove(&module) => Fault::Restart(module),
                _ => {
                    crashed.insert(module);
                    Fault::Crash(module)
                }
            };
            self.add(at, fault);
            at += self.millis(2_000, 10_000);
        }
        if self.one_in(2) {
            self.add(end, Fault::Heal);
        }
    }

    /// The clock of a module is set before it restarts, to a time that differs from run to run.
    pub(super) fn clocks(&mut self) {
        let restarts = self.faults.iter().filter_map(|fault| match fault.fault {
            Fault::Restart(module) => Some((fault.at, module)),
            _ => None,
        });
        for (at, module) in restarts.collect::<Vec<_>>() {
            let ahead = Duration::from_secs(self.random.below(100));
            let before = at.saturating_sub(Duration::from_micros(1));
            self.add(before, Fault::SetClock(module, ahead));
        }
    }
}
