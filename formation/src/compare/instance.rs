//! On what policies are compared.

use std::path::PathBuf;

use formation_generate::{Apart, GeneratorParameters, Grouping, generate, set_apart};
use formation_model::{Digest, Scenario};

use crate::arguments::CompareArguments;
use crate::scenario_file;

/// The width of the field in which modules start, in hundredths: the default of `formation generate`.
const FIELD_PERCENT: u32 = 300;

/// A scenario file, or what a scenario is generated from.
#[derive(Clone, Debug)]
pub enum ComparedInstance {
    File(PathBuf),
    Generated {
        modules: usize,
        grouping: Grouping,
        seed: u64,
    },
}

impl ComparedInstance {
    /// The files in their order, then the generated ones by kind, size and seed.
    pub fn all(arguments: &CompareArguments) -> Vec<Self> {
        let (first, last) = arguments.seeds;
        let files = arguments.scenarios.iter().cloned().map(Self::File);
        let mut all: Vec<Self> = files.collect();
        for &grouping in &arguments.kinds {
            for &modules in &arguments.sizes {
                all.extend((first..=last).map(|seed| Self::Generated {
                    modules,
                    grouping,
                    seed,
                }));
            }
        }
        all
    }

    /// The name in rows.
    pub fn label(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Generated { modules, seed, .. } => {
                format!("{}-{modules}-seed-{seed}", self.kind())
            }
        }
    }

    /// The kind in rows: `file`, or how the modules are docked.
    pub fn kind(&self) -> String {
        match self {
            Self::File(_) => "file".to_owned(),
            Self::Generated { grouping, .. } => match grouping {
                Grouping::Singletons => "singletons".to_owned(),
                Grouping::Mixed => "mixed".to_owned(),
                Grouping::Configurations(size) => format!("configurations-of-{size}"),
                Grouping::Equal { count, size } => format!("{count}x{size}"),
            },
        }
    }

    /// The seed of a generated one.
    pub fn seed(&self) -> Option<u64> {
        match self {
            Self::File(_) => None,
            Self::Generated { seed, .. } => Some(*seed),
        }
    }

    /// The scenario, or why there is none.
    pub fn load(&self) -> Result<Scenario, String> {
        match self {
            Self::File(path) => scenario_file::load(path).map_err(|failure| failure.to_string()),
            Self::Generated {
                modules,
                grouping,
                seed,
            } => {
                let parameters =
                    GeneratorParameters::new(*modules, *modules, *seed).grouped(*grouping);
                let mut raw = generate(&parameters).map_err(|error| error.to_string())?;
                set_apart(&mut raw, Apart::Circles, FIELD_PERCENT, *seed);
                Scenario::try_from(raw).map_err(|error| error.to_string())
            }
        }
    }

    /// What tells whether a file is still the same; `None` for a generated one, and where there is no scenario.
    pub fn digest(&self) -> Option<Digest> {
        match self {
            Self::File(_) => Some(self.load().ok()?.problem().digest()),
            Self::Generated { .. } => None,
        }
    }
}
