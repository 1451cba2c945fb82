//! The orders of a program that attends a run, and what the run needs to carry them out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

use formation_model::ModuleId;
use serde::{Deserialize, Serialize};

use super::start::Start;
use super::supervisor::ProcessId;

/// A run that is attended is not ended for lack of a verdict.
pub const WITHOUT_END: Duration = Duration::from_secs(100 * 365 * 86_400);

/// A line of the standard input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderLine {
    /// What the answer names.
    pub number: u64,
    /// What to do.
    pub order: RunOrder,
}

/// What can be ordered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunOrder {
    /// Ends the process of a module as a crash would.
    Kill(ModuleId),
    /// Starts the process of a module again, and ends it before if it runs.
    Restart(ModuleId),
    /// Takes a module out of service, so that it gets no spot.
    Retire(ModuleId),
    /// Lets it take part again.
    Rejoin(ModuleId),
    /// Pushes its body so many units along the axes, as a hand would.
    Push(ModuleId, f64, f64),
    /// Halts all modules.
    Stop,
    /// Lets them go on.
    Resume,
    /// Announces the target of another scenario file, to be formed from where the modules stand.
    Target(PathBuf),
}

/// What a run needs to carry out orders.
pub struct Attendance<'a> {
    pub start: &'a Start<'a>,
    /// The processes whose end was ordered, and has no consequence.
    pub dismissed: BTreeSet<ProcessId>,
    /// The processes that start again when they have ended.
    pub restarting: BTreeMap<ProcessId, Vec<ModuleId>>,
}

impl<'a> Attendance<'a> {
    pub fn new(start: &'a Start<'a>) -> Self {
        Self {
            start,
            dismissed: BTreeSet::new(),
            restarting: BTreeMap::new(),
        }
    }
}
