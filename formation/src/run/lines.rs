//! What a run that another program attends prints: one JSON object a line.

use std::collections::BTreeSet;

use formation_event_log::Entry;
use formation_model::{ModuleId, SpotId};
use formation_msgs::Verdict;
use formation_verifier_lines::VerdictReport;
use formation_verify::{Outcome, Progress};
use serde::{Deserialize, Serialize};

use crate::console;

/// One line: an object with one key, which says what the line is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunLine {
    /// Where the processes are.
    Place {
        /// The domain.
        domain: u16,
        /// The session.
        session: u64,
    },
    /// The progress, whenever it changes.
    Progress(Progress),
    /// Something that happened.
    Entry(Entry),
    /// A judgement, which a later one may replace.
    Verdict(RunVerdict),
    /// A process of modules was started, or has ended.
    Process {
        /// Its modules.
        modules: BTreeSet<ModuleId>,
        /// Whether it runs.
        running: bool,
    },
    /// What came of an order.
    Answer {
        /// The number that the order had.
        number: u64,
        /// Why it is refused, if it is.
        error: Option<String>,
    },
}

/// A judgement, as far as people watch it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunVerdict {
    /// How the formation ended.
    pub outcome: Outcome,
    /// How many spots are filled.
    pub filled_spots: usize,
    /// How many spots there are.
    pub spots: usize,
    /// The spots that are not filled.
    pub open_spots: Vec<SpotId>,
    /// What was done wrong or not in time, one sentence each.
    pub violations: Vec<String>,
    /// Whether no bodies overlapped.
    pub collision_free: bool,
}

impl From<&VerdictReport> for RunVerdict {
    fn from(report: &VerdictReport) -> Self {
        let sentences = report.violations.iter().chain(&report.missing);
        Self {
            outcome: report.outcome,
            filled_spots: report.filled_spots,
            spots: report.filled_spots + report.open_spots.len(),
            open_spots: report.open_spots.clone(),
            violations: sentences.cloned().collect(),
            collision_free: report.collision_free,
        }
    }
}

impl From<&Verdict> for RunVerdict {
    fn from(verdict: &Verdict) -> Self {
        let count = |number: u32| usize::try_from(number).unwrap_or(usize::MAX);
        Self {
            outcome: match verdict.outcome {
                Verdict::OUTCOME_COMPLETE => Outcome::Complete,
                Verdict::OUTCOME_PARTIAL => Outcome::Partial,
                Verdict::OUTCOME_NOT_JUDGED => Outcome::NotJudged,
                _ => Outcome::Failed,
            },
            filled_spots: count(verdict.filled_spots),
            spots: count(verdict.spots),
            open_spots: verdict.open_spots.iter().copied().map(SpotId).collect(),
            violations: verdict.violations.clone(),
            collision_free: verdict.collision_free,
        }
    }
}

/// Prints a line. Nobody reads it any more when the program that attends the run has ended, which ends the run.
pub fn print(line: &RunLine) {
    let _ = console::result_json(line);
}
