//! The faults of a hostile run: many at once and in a row, and all over at its end.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::ModuleId;

use super::{Drawing, Fault};

impl Drawing<'_> {
    /// Draws a hostile run. Fewer than half of the modules crash at all, and the network is whole in the end.
    pub(super) fn hostile(&mut self) {
        self.repeated_crashes();
        self.changing_cuts();
        let pauses = self.random.below(5);
        self.pauses(pauses, 15_000);
        self.rarer();
        for _ in 0..self.random.below(4) {
            self.announcement();
        }
        self.add(self.end, Fault::Heal);
    }

    /// Draws a storm: every module crashes up to three times, and restarts each time.
    pub(super) fn storm(&mut self) {
        for &module in self.modules {
            let times = self.random.index(4);
            for turn in 0..times {
                let share = self.end / u32::try_from(times).unwrap_or(1);
                let begin = share * u32::try_from(turn).unwrap_or_default();
                let at = self.time(begin, begin + share);
                let again = self.time(at, begin + share);
                self.add(at, Fault::Crash(module));
                self.add(again, Fault::Restart(module));
            }
        }
        if self.one_in(3) {
            let at = self.time(Duration::ZERO, self.end);
            for &module in self.modules {
                self.add(at, Fault::Crash(module));
            }
        }
        if self.modules.len() > 1 {
            self.changing_cuts();
        }
        for &module in self.modules {
            self.add(self.end, Fault::Restart(module));
        }
        self.add(self.end, Fault::Heal);
    }

    /// Some modules crash up to three times in a row; the last time half of them for good.
    fn repeated_crashes(&mut self) {
        let limit = self.modules.len().saturating_sub(1) / 2;
        let mut modules = self.shuffled();
        modules.truncate(self.random.index(limit.min(5) + 1));
        for module in modules {
            let times = [1, 2, 3][self.random.index(3)];
            let share = self.end / times;
            for turn in 0..times {
                let at = self.time(share * turn, share * (turn + 1));
                let again = self.time(at, share * (turn + 1));
                self.add(at, Fault::Crash(module));
                if turn + 1 < times || self.one_in(2) {
                    self.add(again, Fault::Restart(module));
                }
            }
        }
    }

    /// The network changes every few seconds, mostly without being whole in between.
    fn changing_cuts(&mut self) {
        let mut at = self.time(Duration::ZERO, self.end / 4);
        while at < self.end {
            let fault = match self.random.below(6) {
                0 => Fault::Heal,
                1 | 2 => Fault::Cut(self.some_modules()),
                3 => Fault::Sever(self.one_way()),
                4 => Fault::Sever(self.some_links()),
                _ => {
                    at = self.flap(at);
                    Fault::Heal
                }
            };
            self.add(at, fault);
            at += self.millis(500, 10_000);
        }
    }

    /// A cut that comes and goes; returns when it has ended.
    fn flap(&mut self, from: Duration) -> Duration {
        let aside = self.some_modules();
        let period = self.millis(100, 3_000);
        let mut at = from;
        for _ in 0..2 + self.random.below(8) {
            for fault in [Fault::Cut(aside.clone()), Fault::Heal] {
                if at < self.end {
                    self.add(at, fault);
                }
                at += period;
            }
        }
        at.min(self.end)
    }

    /// The links to or from a few modules: these either receive nothing from the others, or reach none of them.
    fn one_way(&mut self) -> BTreeSet<(ModuleId, ModuleId)> {
        let mut few = self.shuffled();
        few.truncate(1 + self.random.index((self.modules.len() / 3).max(1)));
        let few: BTreeSet<ModuleId> = few.into_iter().collect();
        let receive_nothing = self.one_in(2);
        let others = self.modules.iter().filter(|module| !few.contains(module));
        others
            .flat_map(|&other| few.iter().map(move |&one| (one, other)))
            .map(|(one, other)| {
                if receive_nothing {
                    (other, one)
                } else {
                    (one, other)
                }
            })
            .collect()
    }

    /// A few links anywhere, in one direction or both, so that reachability is not transitive.
    fn some_links(&mut self) -> BTreeSet<(ModuleId, ModuleId)> {
        let mut links = BTreeSet::new();
        for _ in 0..1 + self.random.index(self.modules.len()) {
            let (from, to) = (self.module(), self.module());
            links.insert((from, to));
            if self.one_in(2) {
                links.insert((to, from));
            }
        }
        links
    }
}
