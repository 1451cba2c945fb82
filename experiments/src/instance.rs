//! The instances: generated as the paper describes, and the case studies.

use std::sync::Arc;

use formation_generate::{
    Apart, GenerateError, GeneratorParameters, Grouping, TreeKind, generate, set_apart,
};
use formation_model::{PlanningProblem, RawScenario, Scenario, ScenarioError};
use serde::{Deserialize, Serialize};

use crate::case_studies::CASES;
use crate::contender::Contender;
use crate::error::CellError;

/// "The initial positions [...] are drawn uniformly from U[(0, 15), (0, 15)]"; modules are one unit wide.
const START_SIDE_UNITS: u32 = 15;

/// The side of the field of robots: 2.5 times the square root of the number of modules, as `formation generate --apart` has it.
const FIELD_PERCENT: u32 = 250;

/// If the generator finds no tree of the wanted degree for a seed, the seed this much higher replaces it.
const STAND_IN_OFFSET: u64 = 1_000_000;

/// The paper's Figure 1.
const LADDER: &str = include_str!("../../launch_scripts/scenarios/figure1_ladder17.yaml");

/// An instance of the planning problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Instance {
    /// Random trees and poses.
    Generated(Draw),
    /// One of the case studies, from 1.
    CaseStudy(usize),
    /// The paper's Figure 1.
    Ladder,
}

/// The parameters of a random instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Draw {
    pub modules: usize,
    pub spots: usize,
    pub docked: Docked,
    pub seed: u64,
}

/// How modules are docked at the start, and on which trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Docked {
    /// No module is docked.
    Singletons,
    /// As above, but far enough apart that every robot can turn in place.
    Apart,
    /// "Random number of singletons and the initial configurations with sizes between 2 and 10".
    Mixed,
    /// All modules are in configurations of one size, on lattice trees of maximum degree 3.
    Lattice(usize),
    /// All modules are in configurations of one size, on uniform labelled trees of maximum degree 4.
    Labelled(usize),
}

impl Instance {
    /// The number of modules; of a case study, the greatest number.
    pub(crate) fn modules(self) -> usize {
        match self {
            Self::Generated(draw) => draw.modules,
            Self::CaseStudy(_) | Self::Ladder => 17,
        }
    }

    /// The seed of the simulated network.
    pub(crate) fn seed(self) -> u64 {
        match self {
            Self::Generated(draw) => draw.seed,
            Self::CaseStudy(number) => number as u64,
            Self::Ladder => 1,
        }
    }

    /// The scenario with a contender's planner parameters.
    pub(crate) fn scenario(self, contender: Contender) -> Result<RawScenario, CellError> {
        let mut scenario = match self {
            Self::Generated(draw) => draw.generate()?,
            Self::CaseStudy(number) => {
                let case = CASES.get(number.wrapping_sub(1));
                let text = case.map_or("", |case| case.scenario);
                serde_yaml::from_str(text).map_err(ScenarioError::from)?
            }
            Self::Ladder => serde_yaml::from_str(LADDER).map_err(ScenarioError::from)?,
        };
        scenario.planner = contender.parameters();
        Ok(scenario)
    }

    /// The planning problem with a contender's planner parameters.
    pub(crate) fn problem(self, contender: Contender) -> Result<Arc<PlanningProblem>, CellError> {
        let scenario = Scenario::try_from(self.scenario(contender)?)?;
        Ok(Arc::new(scenario.problem().clone()))
    }
}

impl Draw {
    fn generate(self) -> Result<RawScenario, GenerateError> {
        let (tree, degree_max, grouping) = match self.docked {
            Docked::Singletons | Docked::Apart => (TreeKind::Lattice, 3, Grouping::Singletons),
            Docked::Mixed => (TreeKind::Lattice, 3, Grouping::Mixed),
            Docked::Lattice(size) => (TreeKind::Lattice, 3, Grouping::Configurations(size)),
            Docked::Labelled(size) => {
                (TreeKind::UniformLabelled, 4, Grouping::Configurations(size))
            }
        };
        let parameters = GeneratorParameters {
            tree,
            degree_max,
            start_side_units: START_SIDE_UNITS,
            ..GeneratorParameters::new(self.modules, self.spots, self.seed).grouped(grouping)
        };
        let mut scenario = match generate(&parameters) {
            Err(GenerateError::NoTreeFound { .. }) => generate(&GeneratorParameters {
                seed: self.seed + STAND_IN_OFFSET,
                ..parameters
            }),
            other => other,
        }?;
        if self.docked == Docked::Apart {
            set_apart(&mut scenario, Apart::Circles, FIELD_PERCENT, self.seed);
        }
        Ok(scenario)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_the_papers() {
        let instance = Instance::Generated(Draw {
            modules: 4_000,
            spots: 10,
            docked: Docked::Singletons,
            seed: 1,
        });
        let scenario = instance.scenario(Contender::PaperPolicy).unwrap();
        let greatest = scenario
            .singletons
            .iter()
            .map(|module| module.x.max(module.y))
            .fold(0.0, f64::max);
        assert!(greatest <= 15.0 && greatest > 14.9, "{greatest}");
        assert_eq!(scenario.planner.d_max, Some(3));
    }

    #[test]
    fn all_contenders_get_the_same_instance() {
        let instance = Instance::Generated(Draw {
            modules: 30,
            spots: 20,
            docked: Docked::Mixed,
            seed: 9,
        });
        let ours = instance.problem(Contender::Ours).unwrap();
        let paper = instance.problem(Contender::PaperPolicy).unwrap();
        assert_eq!(ours.modules(), paper.modules());
        assert_eq!(ours.target(), paper.target());
        assert_ne!(ours.parameters(), paper.parameters());
    }
}
