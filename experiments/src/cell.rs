//! Cells: the smallest pieces of work, each kept once it is finished.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::contender::Contender;
use crate::error::CellError;
use crate::instance::{Docked, Instance};
use crate::measure::matching::{self, MatchingMeasurement};
use crate::measure::plan::{self, PlanMeasurement};
use crate::measure::processes::{self, ProcessMeasurement};
use crate::measure::talk::Talk;
use crate::measure::{auction, protocol};
use crate::settings::Settings;

/// One measurement of one instance, planned by one contender.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cell {
    pub kind: Kind,
    pub instance: Instance,
    pub contender: Contender,
    /// The number of modules in each process, for [`Kind::Processes`].
    pub modules_per_process: usize,
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
}

/// The result of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Measurement {
    Matching(MatchingMeasurement),
    Plan(PlanMeasurement),
    Talk(Talk),
    Processes(ProcessMeasurement),
}

impl Cell {
    /// Does the work.
    pub(crate) fn measure(
        self,
        settings: &Settings,
        launcher: &Path,
    ) -> Result<Measurement, CellError> {
        let scenario = self.instance.scenario(self.contender)?;
        if self.kind == Kind::Processes {
            let measured = processes::measure(launcher, &scenario, self.modules_per_process)?;
            return Ok(Measurement::Processes(measured));
        }
        let problem = self.instance.problem(self.contender)?;
        Ok(match (self.kind, self.contender) {
            (Kind::Matching, _) => {
                Measurement::Matching(matching::measure(&problem, settings.timings))
            }
            (Kind::Plan | Kind::Processes, _) => {
                Measurement::Plan(plan::measure(&problem, settings.timings))
            }
            (Kind::Talk, Contender::Auction) => Measurement::Talk(auction::measure(&problem)),
            (Kind::Talk, _) => {
                Measurement::Talk(protocol::measure(&problem, self.instance.seed())?)
            }
        })
    }

    /// Whether the result contains measured times; no other cell runs at the same time as a timed one.
    pub(crate) fn is_timed(self) -> bool {
        self.kind != Kind::Talk
    }

    /// An estimate of the working time in tenths of a millisecond, for the progress bar.
    pub(crate) fn cost(self) -> u64 {
        let modules = self.instance.modules() as u64;
        1 + match (self.kind, self.contender) {
            (Kind::Matching, _) => 3 * modules,
            (Kind::Plan, Contender::PaperPolicy) => modules * modules / 30,
            (Kind::Plan, _) | (Kind::Talk, Contender::Auction) => modules * modules / 200,
            (Kind::Talk, _) => modules * modules / 4,
            (Kind::Processes, _) => 20_000 + 2_000 * modules / self.modules_per_process as u64,
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
        };
        match self.instance {
            Instance::CaseStudy(number) => format!("{what}, case {number}"),
            Instance::Generated(draw) => {
                let docked = match draw.docked {
                    Docked::Singletons => "singletons".to_owned(),
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
