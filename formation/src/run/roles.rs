//! The roles of the processes of a run, and the processes that a run lost.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::process::ExitStatus;
use std::time::Duration;

use formation_model::ModuleId;
use ros_runtime::exit::STATUS_BAD_INPUT;
use serde::{Serialize, Serializer};

use super::supervisor::ProcessId;

/// Whether a program ended because it cannot use its arguments, its files or its environment.
pub fn is_bad_input(status: ExitStatus) -> bool {
    status.code() == Some(STATUS_BAD_INPUT.into())
}

/// Which process has which role in a run.
#[derive(Clone, Debug)]
pub struct ProcessRoles {
    /// Judges; without it there is no verdict.
    pub verifier: ProcessId,
    /// Announces the target, which the modules then know.
    pub target_publisher: ProcessId,
    /// Plays the robots, if a physical world does; without it no robot moves.
    pub world: Option<ProcessId>,
    /// Records the run, if that was asked for.
    pub recorder: Option<ProcessId>,
    /// The processes of modules, each with those that it hosts.
    pub agents: BTreeMap<ProcessId, Vec<ModuleId>>,
}

impl ProcessRoles {
    /// The modules of all processes.
    pub fn modules(&self) -> impl Iterator<Item = ModuleId> {
        self.agents.values().flatten().copied()
    }

    /// Whether a run can continue without a process that ended. A process that fails at its start would fail again, so
    /// a person has to act; a formation has to tolerate a process that ends later.
    pub fn can_continue_without(
        &self,
        process: ProcessId,
        status: ExitStatus,
        all_joined: bool,
        target_is_known: bool,
    ) -> bool {
        if process == self.target_publisher {
            return target_is_known;
        }
        // Zero is the status of a process that was asked to end.
        let failed = status.code().is_some_and(|code| code != 0);
        let failed_at_start = is_bad_input(status) || (failed && !all_joined);
        let is_optional = self.agents.contains_key(&process) || self.recorder == Some(process);
        is_optional && !failed_at_start
    }
}

/// A process that ended while the run continued, as `--json` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct Death {
    /// Its name in messages to people.
    #[serde(rename = "process")]
    pub name: String,
    /// The modules that it hosted.
    pub modules: Vec<ModuleId>,
    /// How it ended.
    #[serde(rename = "ended_with", serialize_with = "in_words")]
    pub status: ExitStatus,
    /// When it ended, since the start of the run.
    #[serde(rename = "after_ms", serialize_with = "in_milliseconds")]
    pub after: Duration,
}

fn in_words<S: Serializer>(status: &ExitStatus, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(status)
}

fn in_milliseconds<S: Serializer>(duration: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    duration.as_millis().serialize(serializer)
}

impl fmt::Display for Death {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let after = self.after.as_secs_f64();
        write!(
            formatter,
            "{} ended with {} after {after:.1} s",
            self.name, self.status
        )
    }
}

/// The processes that ended while the run continued, in that order.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(transparent)]
pub struct Deaths(Vec<Death>);

impl Deaths {
    /// Adds one.
    pub fn push(&mut self, death: Death) {
        self.0.push(death);
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Death> {
        self.0.iter()
    }

    /// How many processes of modules ended.
    pub fn of_agents(&self) -> usize {
        let agents = self.iter().filter(|death| !death.modules.is_empty());
        agents.count()
    }

    /// Forgets the end of the process that hosted these modules, as another has taken its place.
    pub fn forget(&mut self, modules: &[ModuleId]) {
        self.0.retain(|death| death.modules != modules);
    }

    /// The modules that they hosted.
    pub fn modules(&self) -> BTreeSet<ModuleId> {
        let modules = self.iter().flat_map(|death| &death.modules);
        modules.copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    #[test]
    fn a_run_continues_after_a_death_and_not_after_a_failure_at_the_start() {
        let [verifier, agent, target_publisher, driver, world, recorder] = ProcessId::some();
        let roles = ProcessRoles {
            verifier,
            target_publisher,
            world: Some(world),
            recorder: Some(recorder),
            agents: BTreeMap::from([(agent, vec![ModuleId(4)])]),
        };
        let killed = ExitStatus::from_raw(9);
        let exited = |code: i32| ExitStatus::from_raw(code << 8);
        for (process, status, all_joined, target_is_known, continues) in [
            (agent, killed, false, false, true),
            (agent, killed, true, true, true),
            (agent, exited(0), false, false, true),
            (agent, exited(1), false, true, false),
            (agent, exited(1), true, true, true),
            (agent, exited(2), true, true, false),
            (target_publisher, killed, false, false, false),
            (target_publisher, killed, false, true, true),
            (verifier, killed, true, true, false),
            (driver, exited(0), true, true, false),
            (world, killed, true, true, false),
            (recorder, exited(2), true, true, false),
            (recorder, exited(1), false, true, false),
            (recorder, killed, false, true, true),
            (recorder, exited(1), true, true, true),
        ] {
            assert_eq!(
                roles.can_continue_without(process, status, all_joined, target_is_known),
                continues,
                "{process:?} {status} {all_joined} {target_is_known}"
            );
        }
    }
}
