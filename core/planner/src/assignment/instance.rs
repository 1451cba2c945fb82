//! A problem laid out for planning: positions instead of identifiers, and all data that no turn changes.

use std::sync::Arc;

use crate::assignment::spot_tree::SpotTree;
use crate::value::Utilities;
use formation_model::{MicroUnits, ModuleId, PlanningProblem, Target, Topology};

/// A problem, the target that is formed (the problem's own, or the part of it that trimming kept), and data that follows
/// from the two. Modules and spots are named by their positions in ascending order of identifier.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The problem.
    pub problem: Arc<PlanningProblem>,
    /// The target that is formed.
    pub target: Arc<Target>,
    /// The worth of each spot to each module.
    pub utilities: Utilities,
    /// The links between modules.
    pub links: Topology,
    /// The keys by which modules are ranked: distance from the target's centre, then identifier.
    pub(crate) ranks: Vec<(MicroUnits, ModuleId)>,
    /// Whether the target has no cycle.
    pub(crate) target_is_tree: bool,
    /// The spots, grouped by position in the plane.
    pub(crate) spot_tree: SpotTree,
}

impl Instance {
    /// Lays out a problem for a target that consists of spots of the problem's own target.
    pub fn new(problem: Arc<PlanningProblem>, target: Arc<Target>) -> Self {
        let centre = target.centre();
        let modules = problem.modules().iter();
        Self {
            utilities: Utilities::new(&problem, &target),
            links: problem.links(),
            ranks: modules
                .map(|module| (module.pose.distance_to(&centre), module.id))
                .collect(),
            target_is_tree: target.topology().is_tree(),
            spot_tree: SpotTree::new(&target),
            problem,
            target,
        }
    }

    /// The number of modules.
    pub(crate) fn module_count(&self) -> usize {
        self.ranks.len()
    }

    /// The lowest-ranked of some modules, which leads them; `None` if there are none.
    pub(crate) fn leader_among(&self, members: &[usize]) -> Option<usize> {
        let members = members.iter().copied();
        members.min_by_key(|&member| self.ranks[member])
    }

    /// Those of some modules that were docked at the start. If they enter as single modules, they leave a configuration.
    pub(crate) fn linked(&self, modules: Vec<usize>) -> impl Iterator<Item = usize> + '_ {
        let modules = modules.into_iter();
        modules.filter(|&module| self.links.degree(module) > 0)
    }
}
