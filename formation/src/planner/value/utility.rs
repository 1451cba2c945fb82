//! What a spot is worth to a module: its value less the cost of getting there.
//!
//! The paper, section "Configuration Formation as Utility Maximization Problem". One thing differs: a link that is
//! kept costs nothing at either of its ends, while the paper charges it as if it were undone and docked again.

use crate::model::{MICRO_PER_UNIT, MicroUnits, PlanningProblem, Pose, Target, Weights};
use crate::planner::value::betweenness;

/// The utilities of all modules of a problem for all spots of a target; both are named by their position in
/// ascending order of identifiers.
#[derive(Clone, Debug)]
pub struct Utilities {
    weights: Weights,
    module_poses: Vec<Pose>,
    /// The cost of undoing all links of a module.
    undocking: Vec<MicroUnits>,
    spot_poses: Vec<Pose>,
    values: Vec<MicroUnits>,
    /// The value of a spot less the cost of docking all of its links.
    net_values: Vec<MicroUnits>,
}

impl Utilities {
    /// Prepares the utilities of the problem's modules for the spots of `target`, the problem's own or what was left
    /// of it when it was trimmed.
    #[must_use]
    pub fn new(problem: &PlanningProblem, target: &Target) -> Self {
        let weights = problem.parameters().weights;
        let values = betweenness(target.topology());
        let net_values = values
            .iter()
            .enumerate()
            .map(|(spot, &value)| value - weights.dock().times(target.topology().degree(spot)))
            .collect();
        Self {
            weights,
            module_poses: problem.modules().iter().map(|module| module.pose).collect(),
            undocking: problem
                .modules()
                .iter()
                .map(|module| weights.undock().times(module.links.len()))
                .collect(),
            spot_poses: target.spots().iter().map(|spot| spot.pose).collect(),
            values,
            net_values,
        }
    }

    /// How many modules there are.
    #[must_use]
    pub fn module_count(&self) -> usize {
        self.module_poses.len()
    }

    /// How many spots there are.
    #[must_use]
    pub fn spot_count(&self) -> usize {
        self.spot_poses.len()
    }

    /// The value of a spot: its betweenness centrality.
    #[must_use]
    pub fn value(&self, spot: usize) -> MicroUnits {
        self.values[spot]
    }

    /// The utility of a module for a spot, `U_a(s) = Val(s) - cost(a, s)`, every link end charged.
    #[must_use]
    pub fn of(&self, module: usize, spot: usize) -> MicroUnits {
        let way_cost = MicroUnits(self.way_cost(module, &self.spot_poses[spot]));
        self.net_values[spot] - way_cost - self.undocking[module]
    }

    /// The cost of a module's way to a pose.
    #[inline]
    pub(crate) fn way_cost(&self, module: usize, to: &Pose) -> i64 {
        let way = self.module_poses[module].distance_to(to);
        way.scaled_by(self.weights.loc()).0
    }

    /// The value of a spot less the cost of docking all of its links.
    pub(crate) fn net_value(&self, spot: usize) -> i64 {
        self.net_values[spot].0
    }

    /// The cost of undoing all links of a module.
    pub(crate) fn undocking(&self, module: usize) -> i64 {
        self.undocking[module].0
    }

    /// Where a module stands.
    pub(crate) fn module_pose(&self, module: usize) -> &Pose {
        &self.module_poses[module]
    }

    /// The utility of a module for every spot.
    #[must_use]
    pub fn row(&self, module: usize) -> Vec<i64> {
        (0..self.spot_count())
            .map(|spot| self.of(module, spot).0)
            .collect()
    }

    /// What a kept link saves over undoing it and docking anew, at its two ends together.
    #[must_use]
    pub fn kept_link(&self) -> MicroUnits {
        (self.weights.dock() + self.weights.undock()).times(2)
    }

    /// The reward of a block of `size` modules, `f_rwd(k) = (k - 2) / |A|`; nothing below two modules.
    #[must_use]
    pub fn retention_reward(&self, size: usize) -> MicroUnits {
        let count = i64::try_from(self.module_count().max(1)).unwrap_or(i64::MAX);
        let retained = i64::try_from(size.saturating_sub(2)).unwrap_or(i64::MAX);
        MicroUnits(retained.saturating_mul(MICRO_PER_UNIT) / count)
    }
}
