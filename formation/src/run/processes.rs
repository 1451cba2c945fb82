//! Which processes a scenario needs.

use std::collections::BTreeSet;

use formation_model::text::listed_in_full;
use formation_model::{ModuleId, PlanningProblem};

/// The processes of every run that host no modules: the target publisher and the verifier.
pub const OTHER_PROCESSES: usize = 2;

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

    /// Its name in messages to people.
    pub fn name(&self) -> String {
        let modules = listed_in_full(self.modules.iter().copied());
        format!("{} of {modules}", self.program())
    }
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
    use formation_model::Scenario;

    use super::*;

    #[test]
    fn every_module_has_a_process_and_leaders_are_leader_agents() {
        let scenario = Scenario::from_yaml(
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
        .unwrap();
        let names = |modules_per_process| -> Vec<String> {
            let hosts = hosts(scenario.problem(), modules_per_process);
            hosts.iter().map(Host::name).collect()
        };
        assert_eq!(
            names(1),
            [
                "module_agent of module 2",
                "leader_agent of module 5",
                "module_agent of module 6",
                "module_agent of module 7",
                "module_agent of module 9",
            ]
        );
        assert_eq!(
            names(4),
            ["module_agent of modules 2, 5-7", "module_agent of module 9"]
        );
    }
}
