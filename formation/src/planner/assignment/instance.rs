//! One problem laid out for planning: positions instead of identifiers, and everything that turns never change.

use std::sync::Arc;

use crate::model::{MicroUnits, ModuleId, PlanningProblem, Target, Topology};
use crate::planner::assignment::spot_tree::SpotTree;
use crate::planner::value::Utilities;

/// A problem, the target that is really formed (the problem's own, or what trimming left of it), and what follows
/// from the two. Modules and spots are named by their positions in ascending order of identifiers.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The problem.
    pub problem: Arc<PlanningProblem>,
    /// The target that is formed.
    pub target: Arc<Target>,
    /// What each spot is worth to each module.
    pub utilities: Utilities,
    /// The links between modules.
    pub links: Topology,
    /// By what modules are ranked: distance from the target's centre, then identifier.
    pub ranks: Vec<(MicroUnits, ModuleId)>,
    /// Whether the target has no cycle.
    pub target_is_tree: bool,
    /// The spots by position.
    pub(crate) spot_tree: SpotTree,
}

impl Instance {
    /// Lays out a problem for a target that consists of spots of the problem's own target.
    #[must_use]
    pub fn new(problem: Arc<PlanningProblem>, target: Arc<Target>) -> Self {
        let utilities = Utilities::new(&problem, &target);
        let modules = problem.modules();
        let edges: Vec<(usize, usize)> = modules
            .iter()
            .enumerate()
            .flat_map(|(position, module)| {
                let id = module.id;
                let problem = &problem;
                module
                    .links
                    .iter()
                    .filter(move |&&other| other > id)
                    .filter_map(move |&other| Some((position, problem.position_of(other)?)))
            })
            .collect();
        // The problem has checked that links are symmetric and lead to modules of its own.
        let links = Topology::new(modules.len(), &edges)
            .unwrap_or_else(|_| Topology::without_edges(modules.len()));
        let centre = target.centre();
        let ranks = modules
            .iter()
            .map(|module| (module.pose.distance_to(&centre), module.id))
            .collect();
        let target_is_tree = target.topology().is_tree();
        Self {
            spot_tree: SpotTree::new(&target),
            problem,
            target,
            utilities,
            links,
            ranks,
            target_is_tree,
        }
    }

    /// The member of best rank, which leads a group of modules; the first position if there is none.
    #[must_use]
    pub fn leader_among(&self, members: &[usize]) -> usize {
        members
            .iter()
            .copied()
            .min_by_key(|&member| self.ranks[member])
            .unwrap_or_default()
    }
}
