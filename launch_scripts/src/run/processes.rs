//! Which processes a scenario needs.

use std::collections::BTreeSet;

use formation::model::{ModuleId, PlanningProblem};

/// So many modules fit into one process: their states are to fit into one sample.
pub const MODULES_PER_PROCESS_MAX: usize = 25;

/// A process that hosts modules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Host {
    /// Its modules in ascending order.
    pub modules: Vec<ModuleId>,
    /// Whether its only module leads a configuration.
    pub leads: bool,
}

impl Host {
    /// The program that it runs.
    pub fn program(&self) -> &'static str {
        if self.leads {
            "leader_agent"
        } else {
            "module_agent"
        }
    }

    /// How it is called before people.
    pub fn name(&self) -> String {
        format!("{} of {}", self.program(), module_list(&self.modules))
    }
}

/// The modules before people, such as `modules 1-4,7`.
pub fn module_list(modules: &[ModuleId]) -> String {
    match modules {
        [only] => only.to_string(),
        modules => format!("modules {}", id_list(modules)),
    }
}

/// The identifiers as options take them: single ones and ranges, such as `1-4,7`.
pub fn id_list(modules: &[ModuleId]) -> String {
    let mut ranges: Vec<(u32, u32)> = Vec::new();
    for &ModuleId(id) in modules {
        match ranges.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(id) => *last = id,
            _ => ranges.push((id, id)),
        }
    }
    let written: Vec<String> = ranges
        .into_iter()
        .map(|(first, last)| {
            if first == last {
                first.to_string()
            } else {
                format!("{first}-{last}")
            }
        })
        .collect();
    written.join(",")
}

/// Shares the modules out among processes. Alone in its process, the leader of a configuration is a `leader_agent`;
/// a process of several modules may host leaders and others.
pub fn hosts(problem: &PlanningProblem, modules_per_process: usize) -> Vec<Host> {
    let leaders: BTreeSet<ModuleId> = problem
        .configurations()
        .into_iter()
        .map(|configuration| configuration.leader)
        .collect();
    let modules: Vec<ModuleId> = problem.modules().iter().map(|module| module.id).collect();
    modules
        .chunks(modules_per_process.max(1))
        .map(|modules| Host {
            modules: modules.to_vec(),
            leads: matches!(modules, [only] if leaders.contains(only)),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use formation::model::Scenario;

    use super::*;

    fn problem() -> Scenario {
        Scenario::from_yaml(
            "
target: {spots: [{id: 1, x: 0.0, y: 0.0}]}
configurations:
  - id: 1
    leader: 5
    modules: [{id: 2, x: 0.0, y: 3.0}, {id: 5, x: 1.0, y: 3.0}, {id: 6, x: 2.0, y: 3.0}]
    edges: [[2, 5], [5, 6]]
singletons: [{id: 7, x: 4.0, y: 4.0}, {id: 9, x: 6.0, y: 4.0}]
",
        )
        .unwrap()
    }

    #[test]
    fn every_module_has_a_process_and_leaders_are_leader_agents() {
        let scenario = problem();
        let hosts = hosts(scenario.problem(), 1);
        let names: Vec<String> = hosts.iter().map(Host::name).collect();
        assert_eq!(
            names,
            [
                "module_agent of module 2",
                "leader_agent of module 5",
                "module_agent of module 6",
                "module_agent of module 7",
                "module_agent of module 9",
            ]
        );
    }

    #[test]
    fn several_modules_share_a_process() {
        let scenario = problem();
        let hosts = hosts(scenario.problem(), 4);
        let names: Vec<String> = hosts.iter().map(Host::name).collect();
        assert_eq!(
            names,
            ["module_agent of modules 2,5-7", "module_agent of module 9"]
        );
    }

    #[test]
    fn lists_of_identifiers_are_short() {
        let list = |ids: &[u32]| id_list(&ids.iter().copied().map(ModuleId).collect::<Vec<_>>());
        assert_eq!(list(&[1, 2, 3, 5, 7, 8]), "1-3,5,7-8");
        assert_eq!(list(&[u32::MAX - 1, u32::MAX]), "4294967294-4294967295");
        assert_eq!(list(&[]), "");
    }
}
