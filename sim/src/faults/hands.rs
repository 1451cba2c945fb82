//! Pushes, and localisation that jumps.

use std::time::Duration;

use formation_model::MicroUnits;

use super::{CarryMoment, Drawing, Fault};
use crate::process::Way;

/// The shortest and the longest way that a module is carried, in hundredths of a unit.
const WAYS: [u64; 2] = [30, 500];

impl Drawing<'_> {
    /// One to three modules are carried away, each third time with all that are docked to them.
    pub(super) fn carried(&mut self) {
        for _ in 0..=self.random.below(3) {
            let module = self.module();
            let at = self.time(Duration::from_secs(1), self.end);
            let with_docked = self.one_in(3);
            let way = self.way();
            let moment = CarryMoment::ALL[self.random.index(CarryMoment::ALL.len())];
            let carry = Fault::Carry {
                module,
                moment,
                with_docked,
                way,
            };
            self.add(at, carry);
        }
    }

    /// The localisation of one to three modules jumps, each for up to a second and a half.
    pub(super) fn lost(&mut self) {
        for _ in 0..=self.random.below(3) {
            let module = self.module();
            let at = self.time(Duration::from_secs(1), self.end);
            let back = at + self.millis(100, 1_400);
            let way = self.way();
            self.add(at, Fault::Mislead(module, way));
            self.add(back, Fault::Mislead(module, Way::default()));
        }
    }

    fn way(&mut self) -> Way {
        let [shortest, longest] = WAYS;
        let hundredths = shortest + self.random.below(longest - shortest + 1);
        let direction = self.random.below(360);
        let along = |whole: f64| {
            // Both are below 1,000, which is exact.
            let length = f64::from(u32::try_from(hundredths).unwrap_or_default()) / 100.0;
            MicroUnits::from_units(length * whole).unwrap_or_default()
        };
        let turn = f64::from(u32::try_from(direction).unwrap_or_default()).to_radians();
        (along(turn.cos()), along(turn.sin()))
    }
}
