//! The settings of the experiments.

use serde::{Deserialize, Serialize};

/// The maximum number of runs of real processes for each cell: each run takes seconds, mostly for discovery.
const PROCESS_RUNS_MAX: usize = 3;

/// The settings determine every number except times; a directory of results belongs to one set of settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentSettings {
    /// The version of the program.
    pub version: String,
    /// Which of the paper's sizes are run.
    pub scale: Scale,
    /// The number of instances that each number is averaged over; 50 in the paper.
    pub runs: u64,
    /// The seed of the first instance; the following instances have the following seeds.
    pub seed: u64,
    /// How often each plan is timed; the least time counts.
    pub timings: u32,
}

/// Which of the paper's sizes are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// All of them.
    Paper,
    /// Fewer sizes between the least and the greatest, and one run of processes.
    Quick,
    /// A handful of modules, for tests.
    Tiny,
}

impl ExperimentSettings {
    /// Settings of this version of the program.
    #[must_use]
    pub fn new(scale: Scale, runs: u64, seed: u64) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scale,
            runs,
            seed,
            timings: 5,
        }
    }

    /// The seeds of the instances of each cell.
    pub(crate) fn seeds(&self) -> Vec<u64> {
        (self.seed..self.seed.saturating_add(self.runs)).collect()
    }

    /// The seeds of the instances that real processes plan.
    pub(crate) fn process_seeds(&self) -> Vec<u64> {
        let most = match self.scale {
            Scale::Paper => PROCESS_RUNS_MAX,
            Scale::Quick | Scale::Tiny => 1,
        };
        self.seeds().into_iter().take(most).collect()
    }

    /// The numbers of modules where there is a spot for each: "target configurations with between 10 and 100 spots".
    pub(crate) fn sizes(&self) -> &'static [usize] {
        match self.scale {
            Scale::Paper => &[10, 20, 30, 40, 50, 60, 70, 80, 90, 100],
            Scale::Quick => &[10, 20, 50, 100],
            Scale::Tiny => &[4, 6],
        }
    }

    /// The largest of [`Self::sizes`], which figures about 100 modules take.
    pub(crate) fn full_size(&self) -> usize {
        self.sizes().last().copied().unwrap_or(1)
    }

    /// The number of spots where modules outnumber them.
    pub(crate) fn few_spots(&self) -> usize {
        self.full_size() / 2
    }

    /// The numbers of modules for [`Self::few_spots`].
    pub(crate) fn surplus_sizes(&self) -> &'static [usize] {
        match self.scale {
            Scale::Paper => &[50, 60, 70, 80, 90, 100],
            Scale::Quick => &[50, 80, 100],
            Scale::Tiny => &[3, 6],
        }
    }

    /// The sizes of a single configuration that is laid into a target of [`Self::full_size`] spots.
    pub(crate) fn configuration_sizes(&self) -> &'static [usize] {
        match self.scale {
            Scale::Paper => &[2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30, 40, 50],
            Scale::Quick => &[2, 4, 6, 8, 10, 20, 50],
            Scale::Tiny => &[2, 3],
        }
    }

    /// The sizes of all configurations of the paper's table.
    pub(crate) fn equal_sizes(&self) -> &'static [usize] {
        match self.scale {
            Scale::Paper | Scale::Quick => &[10, 20, 25, 50],
            Scale::Tiny => &[2, 3],
        }
    }

    /// The numbers of modules that plan as real processes, each with the number of modules in each process.
    pub(crate) fn process_sizes(&self) -> &'static [(usize, usize)] {
        match self.scale {
            Scale::Paper | Scale::Quick => &[(10, 1), (25, 1), (50, 1), (100, 10)],
            Scale::Tiny => &[(3, 1), (6, 3)],
        }
    }

    /// The physical worlds: slip in per cent, noise in thousandths, and the number of runs. A run takes as long as robots
    /// need to move, so there are few.
    pub(crate) fn worlds(&self) -> &'static [(u32, u32, u64)] {
        match self.scale {
            Scale::Paper => &[
                (0, 10, 1),
                (20, 10, 3),
                (50, 10, 1),
                (80, 10, 1),
                (20, 20, 1),
                (20, 30, 1),
                (20, 50, 1),
            ],
            Scale::Quick => &[(20, 10, 1)],
            Scale::Tiny => &[(0, 10, 1), (20, 10, 2)],
        }
    }

    /// The number of singletons in the physical world, and of spots.
    pub(crate) fn world_singletons(&self) -> usize {
        match self.scale {
            Scale::Paper | Scale::Quick => 30,
            Scale::Tiny => 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_settings_are_the_papers() {
        let settings = ExperimentSettings::new(Scale::Paper, 50, 1);
        assert_eq!(settings.seeds().len(), 50);
        assert_eq!(settings.sizes(), [10, 20, 30, 40, 50, 60, 70, 80, 90, 100]);
        assert_eq!(settings.full_size(), 100);
        assert_eq!(settings.few_spots(), 50);
        assert_eq!(settings.surplus_sizes(), [50, 60, 70, 80, 90, 100]);
        assert_eq!(settings.equal_sizes(), [10, 20, 25, 50]);
        assert!((2..=10).all(|size| settings.configuration_sizes().contains(&size)));
        assert_eq!(settings.process_seeds().len(), 3);
        assert_eq!(
            ExperimentSettings::new(Scale::Paper, 2, 1).process_seeds(),
            [1, 2]
        );
    }
}
