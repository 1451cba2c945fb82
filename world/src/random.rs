//! Random numbers from a seed.

use formation_generate as generate;
use formation_model::ModuleId;
use rapier2d::math::Real;

use crate::plane::real;

/// How many shares there are: as many as a floating-point number distinguishes.
const SHARES: u64 = 1 << 53;

/// The stream of random numbers of one module.
#[derive(Debug)]
pub(crate) struct Random(generate::Random);

impl Random {
    /// Each module has a stream of its own, so that the events of one do not change the numbers of another.
    pub fn of_module(seed: u32, module: ModuleId) -> Self {
        let seed = u64::from(seed) << 32 | u64::from(module.0);
        Self(generate::Random::from_seed(seed))
    }

    /// Uniform, from 0 to below 1.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub fn share(&mut self) -> f64 {
        self.0.below(SHARES) as f64 / SHARES as f64
    }

    /// Whether something happens that has this probability.
    pub fn happens(&mut self, probability: f64) -> bool {
        self.share() < probability
    }

    /// Two independent numbers of the normal distribution with this standard deviation (Box and Muller).
    pub fn normal_pair(&mut self, deviation: f64) -> (Real, Real) {
        let radius = deviation * (-2.0 * (1.0 - self.share()).ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * self.share()).sin_cos();
        (real(radius * cosine), real(radius * sine))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_deviation_that_is_asked_for() {
        let mut random = Random::of_module(1, ModuleId(4));
        let numbers: Vec<f64> = (0..10_000)
            .flat_map(|_| <[Real; 2]>::from(random.normal_pair(0.5)))
            .map(f64::from)
            .collect();
        let count = f64::from(20_000);
        let mean = numbers.iter().sum::<f64>() / count;
        let variance = numbers.iter().map(|number| number * number).sum::<f64>() / count;
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((variance.sqrt() - 0.5).abs() < 0.01, "{variance}");
    }

    #[test]
    fn modules_have_different_streams() {
        let [mut one, mut other] = [1, 2].map(|module| Random::of_module(7, ModuleId(module)));
        assert!((one.share() - other.share()).abs() > 1e-9);
    }
}
