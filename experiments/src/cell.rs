//! Cells: the smallest pieces of work, each kept once it is finished.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::contender::Contender;
use crate::error::CellError;
use crate::instance::{Docked, Instance};
use crate::measure::matching::{self, MatchingCounts, MatchingTimes};
use crate::measure::plan::{self, PlanCounts, PlanTimes};
use crate::measure::processes::{self, ProcessMeasurement};
use crate::measure::talk::Talk;
use crate::measure::world::{self, World, WorldMeasurement};
use crate::measure::{auction, protocol};
use crate::settings::ExperimentSettings;

/// One measurement of one instance, planned by one contender.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cell {
    pub kind: Kind,
    pub contender: Contender,
    pub instance: Instance,
    /// The number of modules in each process, for [`Kind::Processes`] and [`Kind::World`].
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub modules_per_process: usize,
    /// For [`Kind::World`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<World>,
}

fn one() -> usize {
    1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature is serde's"
)]
fn is_one(number: &usize) -> bool {
    *number == 1
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    /// The search for the place of an instance's only configuration, ours and the paper's.
    Matching,
    /// The plan, and the time that the core needs for it.
    Plan,
    /// The messages of the agents in the simulator, or of the bidders for [`Contender::Auction`].
    Talk,
    /// The time that real processes need.
    Processes,
    /// A formation of real processes in the physical world.
    World,
}

/// The result of a cell that is the same on every machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Counts {
    Matching(MatchingCounts),
    Plan(PlanCounts),
    Talk(Talk),
}

/// The result of a cell that the clock decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Times {
    Matching(MatchingTimes),
    Plan(PlanTimes),
    Processes(ProcessMeasurement),
    World(WorldMeasurement),
}

/// The result of a cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Measurement {
    pub counts: Option<Counts>,
    pub times: Option<Times>,
}

impl From<Counts> for Measurement {
    fn from(counts: Counts) -> Self {
        Self {
            counts: Some(counts),
            times: None,
        }
    }
}

impl From<Times> for Measurement {
    fn from(times: Times) -> Self {
        Self {
            counts: None,
            times: Some(times),
        }
    }
}

impl From<(Counts, Times)> for Measurement {
    fn from((counts, times): (Counts, Times)) -> Self {
        Self {
            counts: Some(counts),
            times: Some(times),
        }
    }
}

impl Kind {
    /// Whether its result has numbers that are the same on every machine.
    pub(crate) fn is_counted(self) -> bool {
        matches!(self, Self::Matching | Self::Plan | Self::Talk)
    }

    /// Whether its result has numbers that the clock decides; no other cell runs at the same time.
    pub(crate) fn is_timed(self) -> bool {
        self != Self::Talk
    }
}

impl Cell {
    /// Does the work.
    pub(crate) fn measure(
        self,
        settings: &ExperimentSettings,
        launcher: &Path,
    ) -> Result<Measurement, CellError> {
        let scenario = || self.instance.scenario(self.contender);
        let problem = || self.instance.problem(self.contender);
        let timings = settings.timings;
        Ok(match (self.kind, self.contender) {
            (Kind::Matching, _) => {
                let (counts, times) = matching::measure(&problem()?, timings);
                (Counts::Matching(counts), Times::Matching(times)).into()
            }
            (Kind::Plan, _) => {
                let (counts, times) = plan::measure(&problem()?, timings);
                (Counts::Plan(counts), Times::Plan(times)).into()
            }
            (Kind::Talk, Contender::Auction) => Counts::Talk(auction::measure(&problem()?)).into(),
            (Kind::Talk, _) => {
                Counts::Talk(protocol::measure(&problem()?, self.instance.seed())?).into()
            }
            (Kind::Processes, _) => {
                let each = self.modules_per_process;
                Times::Processes(processes::measure(launcher, &scenario()?, each)?).into()
            }
            (Kind::World, _) => {
                let each = self.modules_per_process;
                let world = self.world.unwrap_or_default();
                Times::World(world::measure(launcher, &scenario()?, each, world)?).into()
            }
        })
    }

    /// An estimate of the working time in tenths of a millisecond, for the progress bar.
    pub(crate) fn cost(self) -> u64 {
        let modules = self.instance.modules() as u64;
        1 + match (self.kind, self.contender) {
            (Kind::Matching, _) => 3 * modules,
            (Kind::Plan, Contender::PaperPolicy) => modules * modules / 30,
            (Kind::Plan, _) | (Kind::Talk, Contender::Auction) => modules * modules / 200,
            (Kind::Talk, _) => modules * modules / 2,
            (Kind::Processes, _) => 20_000 + 2_000 * modules / self.modules_per_process as u64,
            (Kind::World, _) => 250_000,
        }
    }

    /// The name of the cell in the progress display and in errors.
    pub(crate) fn label(self) -> String {
        let contender = self.contender.label();
        let what = match (self.kind, self.contender) {
            (Kind::Matching, _) => "matching".to_owned(),
            (Kind::Plan, _) => format!("plan, {contender}"),
            (Kind::Talk, Contender::Auction) => contender.to_owned(),
            (Kind::Talk, _) => format!("protocol, {contender}"),
            (Kind::Processes, _) => format!("processes, {contender}"),
            (Kind::World, _) => "physical world".to_owned(),
        };
        match self.instance {
            Instance::CaseStudy(number) => format!("{what}, case {number}"),
            Instance::Ladder => format!("{what}, Figure 1"),
            Instance::Generated(draw) => {
                let docked = match draw.docked {
                    Docked::Singletons => "singletons".to_owned(),
                    Docked::Apart => "singletons apart".to_owned(),
                    Docked::Mixed => "mixed".to_owned(),
                    Docked::Lattice(size) => format!("of {size}"),
                    Docked::Labelled(size) => format!("labelled of {size}"),
                };
                let (modules, spots) = (draw.modules, draw.spots);
                format!(
                    "{what}, {modules} modules, {spots} spots, {docked}, seed {}",
                    draw.seed
                )
            }
        }
    }
}
