//! Which processes a run can do without, and what is told of those that died.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::process::ExitStatus;
use std::time::Duration;

use formation::model::ModuleId;
use serde_json::{Value, json};

use super::processes::module_list;
use super::supervisor::ProcessId;

/// How a program says that it was started with what it cannot use.
const STATUS_BAD_INPUT: i32 = 2;

/// Which process has which part in a run.
#[derive(Clone, Debug)]
pub struct Cast {
    /// Judges; without it there is no verdict.
    pub verifier: ProcessId,
    /// Announces the target, which the modules then know.
    pub target_publisher: ProcessId,
    /// The processes of modules, each with those that it hosts.
    pub agents: BTreeMap<ProcessId, Vec<ModuleId>>,
}

impl Cast {
    /// Whether a run can go on without a process that ended. What fails at its start would fail again, and is to be
    /// mended; what dies later is what a formation is to bear.
    pub fn can_spare(
        &self,
        process: ProcessId,
        status: ExitStatus,
        all_joined: bool,
        target_is_known: bool,
    ) -> bool {
        if process == self.target_publisher {
            return target_is_known;
        }
        let failed_at_start = match status.code() {
            Some(STATUS_BAD_INPUT) => true,
            // Zero is the status of one that was asked to end.
            Some(code) => code != 0 && !all_joined,
            None => false,
        };
        self.agents.contains_key(&process) && !failed_at_start
    }
}

/// A process that died while the run went on.
#[derive(Clone, Debug)]
pub struct Death {
    /// What it is called before people.
    pub name: String,
    /// The modules that it hosted.
    pub modules: Vec<ModuleId>,
    /// How it ended.
    pub status: ExitStatus,
    /// When, since the start of the run.
    pub after: Duration,
}

impl fmt::Display for Death {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            status,
            after,
            ..
        } = self;
        write!(
            formatter,
            "{name} ended with {status} after {:.1} s",
            after.as_secs_f64()
        )
    }
}

/// Those that died, in the order in which they did.
#[derive(Clone, Debug, Default)]
pub struct Deaths {
    deaths: Vec<Death>,
}

impl Deaths {
    /// Adds one.
    pub fn push(&mut self, death: Death) {
        self.deaths.push(death);
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Death> {
        self.deaths.iter()
    }

    /// How many processes of modules died.
    pub fn of_agents(&self) -> usize {
        self.iter()
            .filter(|death| !death.modules.is_empty())
            .count()
    }

    /// The modules that are dead.
    pub fn modules(&self) -> BTreeSet<ModuleId> {
        self.iter()
            .flat_map(|death| death.modules.iter().copied())
            .collect()
    }

    /// Those modules in words, such as `modules 3, 7-9`.
    pub fn modules_text(&self) -> String {
        module_list(&self.modules().into_iter().collect::<Vec<_>>())
    }

    /// What `--json` prints of them.
    pub fn json(&self) -> Value {
        self.iter()
            .map(|death| {
                json!({
                    "process": death.name,
                    "modules": death.modules,
                    "ended_with": death.status.to_string(),
                    "after_ms": u64::try_from(death.after.as_millis()).unwrap_or(u64::MAX),
                })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    #[test]
    fn a_death_can_be_spared_and_a_failure_at_the_start_cannot() {
        let [verifier, agent, target_publisher, driver] = ProcessId::some();
        let cast = Cast {
            verifier,
            target_publisher,
            agents: BTreeMap::from([(agent, vec![ModuleId(4)])]),
        };
        let killed = ExitStatus::from_raw(9);
        let exited = |code: i32| ExitStatus::from_raw(code << 8);
        for (process, status, all_joined, target_is_known, spared) in [
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
        ] {
            assert_eq!(
                cast.can_spare(process, status, all_joined, target_is_known),
                spared,
                "{process:?} {status} {all_joined} {target_is_known}"
            );
        }
    }
}
