//! Machines that are suspended with their clocks.

use super::{Drawing, Fault, HEARD};

impl Drawing<'_> {
    /// One to three machines are suspended for up to 40 s, in one run of four all of them at about the same time, once each has heard
    /// others: before that it cannot tell.
    pub(super) fn suspended(&mut self) {
        let at_once = self.one_in(4).then(|| self.time(HEARD, self.end));
        for _ in 0..=self.random.below(3) {
            let module = self.module();
            let at = match at_once {
                Some(at) => at + self.millis(0, 2_000),
                None => self.time(HEARD, self.end),
            };
            let span = self.millis(300, 40_000);
            self.add(at, Fault::Suspend(module, span));
        }
    }
}
