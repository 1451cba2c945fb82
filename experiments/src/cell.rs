//! Cells: the smallest pieces of work, each kept once it is done.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::contender::Contender;
use crate::error::CellError;
use crate::instance::{Docked, Instance};
use crate::measure::auction::{self, AuctionMeasurement};
use crate::measure::matching::{self, MatchingMeasurement};
use crate::measure::plan::{self, PlanMeasurement};
use crate::measure::processes::{self, ProcessMeasurement};
use crate::measure::protocol::{self, ProtocolMeasurement};
use crate::settings::Settings;

/// One thing to measure of one instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Cell {
    /// The search for the place of an instance's only configuration.
    Matching(Instance),
    /// What a contender decides, and how long its core takes.
    Plan(Instance, Contender),
    /// What the agents say in the simulator.
    Protocol(Instance, Contender),
    /// What the bidders of an auction say.
    Auction(Instance),
    /// How long real processes take.
    Processes {
        instance: Instance,
        contender: Contender,
        modules_per_process: usize,
    },
}

/// What was measured in a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Measurement {
    Matching(MatchingMeasurement),
    Plan(PlanMeasurement),
    Protocol(ProtocolMeasurement),
    Auction(AuctionMeasurement),
    Processes(ProcessMeasurement),
}

impl Cell {
    /// Does the work.
    pub(crate) fn measure(
        self,
        settings: &Settings,
        launcher: &Path,
    ) -> Result<Measurement, CellError> {
        Ok(match self {
            Self::Matching(instance) => {
                let problem = instance.problem(Contender::Ours)?;
                Measurement::Matching(matching::measure(&problem, settings.timings))
            }
            Self::Plan(instance, contender) => {
                let problem = instance.problem(contender)?;
                Measurement::Plan(plan::measure(&problem, settings.timings))
            }
            Self::Protocol(instance, contender) => {
                let problem = instance.problem(contender)?;
                Measurement::Protocol(protocol::measure(&problem, instance.seed())?)
            }
            Self::Auction(instance) => {
                let problem = instance.problem(Contender::Auction)?;
                Measurement::Auction(auction::measure(&problem))
            }
            Self::Processes {
                instance,
                contender,
                modules_per_process,
            } => {
                let scenario = instance.scenario(contender)?;
                Measurement::Processes(processes::measure(
                    launcher,
                    &scenario,
                    modules_per_process,
                )?)
            }
        })
    }

    /// Whether the clock is looked at, so that nothing else should run beside.
    pub(crate) fn is_timed(self) -> bool {
        !matches!(self, Self::Protocol(..) | Self::Auction(_))
    }

    /// About how long the work takes, in tenths of a millisecond, so that the time left can be told.
    pub(crate) fn cost(self) -> u64 {
        let modules = self.instance().modules() as u64;
        1 + match self {
            Self::Matching(_) => 3 * modules,
            Self::Plan(_, Contender::PaperPolicy) => modules * modules / 30,
            Self::Plan(..) | Self::Auction(_) => modules * modules / 200,
            Self::Protocol(..) => modules * modules / 4,
            Self::Processes {
                modules_per_process,
                ..
            } => 20_000 + 2_000 * modules / modules_per_process as u64,
        }
    }

    fn instance(self) -> Instance {
        match self {
            Self::Matching(instance)
            | Self::Plan(instance, _)
            | Self::Protocol(instance, _)
            | Self::Auction(instance)
            | Self::Processes { instance, .. } => instance,
        }
    }

    /// What people are shown while it is being measured.
    pub(crate) fn label(self) -> String {
        let what = match self {
            Self::Matching(_) => "matching".to_owned(),
            Self::Plan(_, contender) => format!("plan, {}", contender.label()),
            Self::Protocol(_, contender) => format!("protocol, {}", contender.label()),
            Self::Auction(_) => "auction".to_owned(),
            Self::Processes { contender, .. } => format!("processes, {}", contender.label()),
        };
        match self.instance() {
            Instance::CaseStudy(number) => format!("{what}, case {number}"),
            Instance::Generated {
                modules,
                spots,
                docked,
                seed,
            } => {
                let docked = match docked {
                    Docked::Singletons => "singletons".to_owned(),
                    Docked::Mixed => "mixed".to_owned(),
                    Docked::Lattice(size) => format!("of {size}"),
                    Docked::Labelled(size) => format!("labelled of {size}"),
                };
                format!("{what}, {modules} modules, {spots} spots, {docked}, seed {seed}")
            }
        }
    }
}

impl Instance {
    fn modules(self) -> usize {
        match self {
            Self::Generated { modules, .. } => modules,
            Self::CaseStudy(_) => 17,
        }
    }

    fn seed(self) -> u64 {
        match self {
            Self::Generated { seed, .. } => seed,
            Self::CaseStudy(number) => number as u64,
        }
    }
}
