//! The cost of a distance in the choice of spots: `loc * (d + spread * d^2)`.
//!
//! The paper's cost is `loc * d`. Where modules move along a line, its sum is the same whoever goes where, so that noise
//! decides, and sends modules past each other. The square prefers equal ways. The cost grows with the distance, so a
//! search may bound it by the distance to a box.

use formation_model::{MICRO_PER_UNIT, MicroUnits, PlannerParameters, PlanningProblem};

/// The greatest plain cost of any problem, in micro-units: the diagonal of the plane at the greatest weight.
const COST_MAX: u128 = 282_842_712_474_600;

/// A distance in micro-units is squared, and its weight is given in micro-units per unit.
const MICRO_SQUARED: u128 = 1_000_000_000_000;

/// Turns distances into costs; every replica gets the same bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistanceCost {
    loc: MicroUnits,
    /// The spread per micro-unit, times 2^64. Rounded up, so that round numbers stay round.
    factor: u64,
}

impl DistanceCost {
    /// The cost of the problem's parameters. Where the longest possible distance would cost more than the greatest plain
    /// cost of any problem, the spread counts less, so that no sum leaves its range (see [`formation_model::WEIGHT_LIMIT`]); with `loc` up
    /// to 1 and the default spread this begins at distances of half a million units.
    ///
    /// `detour` is the longest detour in units.
    pub(crate) fn of_problem(problem: &PlanningProblem, detour: u64) -> Self {
        let spots = problem.target().spots().iter().map(|spot| spot.pose);
        let modules = problem.modules().iter().map(|module| module.pose);
        let poses = spots.chain(modules);
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for pose in poses {
            for (axis, coordinate) in [pose.x.0, pose.y.0].into_iter().enumerate() {
                low[axis] = low[axis].min(coordinate);
                high[axis] = high[axis].max(coordinate);
            }
        }
        let sides = [high[0] - low[0], high[1] - low[1]].map(i64::unsigned_abs);
        let detour = detour.saturating_mul(MICRO_PER_UNIT.unsigned_abs());
        let longest = sides[0].saturating_add(sides[1]).saturating_add(detour);
        Self::new(problem.parameters(), longest)
    }

    fn new(parameters: &PlannerParameters, longest: u64) -> Self {
        let loc = parameters.weights.loc();
        let per_unit = u128::from(parameters.spread_in_use().per_unit().0.unsigned_abs());
        let wanted = (per_unit << 64).div_ceil(MICRO_SQUARED);
        let scale = u128::from(loc.max(MicroUnits::ONE).0.unsigned_abs());
        let cost_max = COST_MAX * u128::from(MICRO_PER_UNIT.unsigned_abs()) / scale;
        let room = cost_max.saturating_sub(u128::from(longest));
        let longest = u128::from(longest.max(1));
        let possible = (room << 64) / (longest * longest);
        Self {
            loc,
            factor: u64::try_from(wanted.min(possible)).unwrap_or(u64::MAX),
        }
    }

    /// The same without the square: the paper's cost.
    pub(crate) fn plain(self) -> Self {
        Self { factor: 0, ..self }
    }

    /// The cost of a distance.
    #[inline]
    pub(crate) fn of(self, distance: MicroUnits) -> MicroUnits {
        let length = u128::from(distance.0.unsigned_abs());
        let square = (length * length * u128::from(self.factor)) >> 64;
        let square = i64::try_from(square).unwrap_or(i64::MAX);
        MicroUnits(distance.0.saturating_add(square)).scaled_by(self.loc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{Policy, Spread, Weights};

    fn cost(spread: f64, loc: f64, longest: u64) -> DistanceCost {
        let parameters = PlannerParameters {
            spread: Spread::from_units(spread).unwrap(),
            weights: Weights::from_units(loc, 0.1, 0.05).unwrap(),
            ..PlannerParameters::default()
        };
        DistanceCost::new(&parameters, longest)
    }

    #[test]
    fn the_square_is_added_to_the_last_bit() {
        let cost = cost(0.001, 1.0, 100_000_000);
        for (distance, expected) in [
            (0, 0),
            (31_622, 31_622),
            (31_623, 31_624),
            (1_000_000, 1_001_000),
            (2_000_000, 2_004_000),
            (1_414_213, 1_416_212),
            (60_000_000, 63_600_000),
        ] {
            assert_eq!(cost.of(MicroUnits(distance)), MicroUnits(expected));
        }
        assert_eq!(
            cost.plain().of(MicroUnits(2_000_000)),
            MicroUnits(2_000_000)
        );
    }

    #[test]
    fn the_weight_of_distance_scales_both_terms() {
        let cost = cost(0.5, 3.0, 100_000_000);
        assert_eq!(cost.of(MicroUnits(2_000_000)), MicroUnits(12_000_000));
    }

    #[test]
    fn the_cost_grows_with_the_distance_and_stays_in_range() {
        let farthest: u64 = 4_000_000_000_000;
        for (spread, loc) in [
            (0.001, 1.0),
            (1.0, 1.0),
            (1.0, 0.2),
            (1.0, 100.0),
            (0.0, 100.0),
        ] {
            for longest in [0, 1, 3_000_000, 900_000_000_000, farthest] {
                let cost = cost(spread, loc, longest);
                let mut before = MicroUnits(-1);
                for part in 0..=1_000 {
                    let distance = i64::try_from(longest / 1_000 * part).unwrap();
                    let now = cost.of(MicroUnits(distance));
                    assert!(now >= before, "{spread} {loc} {longest}");
                    before = now;
                }
                let plain = cost.plain().of(MicroUnits(i64::try_from(longest).unwrap()));
                let limit = MicroUnits(i64::try_from(COST_MAX).unwrap()).max(plain);
                assert!(before <= limit, "{spread} {loc} {longest}");
            }
        }
    }

    #[test]
    fn the_paper_has_the_plain_distance() {
        let parameters = PlannerParameters {
            policy: Policy::Paper,
            ..PlannerParameters::default()
        };
        let cost = DistanceCost::new(&parameters, 9_000_000);
        assert_eq!(cost.of(MicroUnits(9_000_000)), MicroUnits(9_000_000));
    }
}
