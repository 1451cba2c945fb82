//! The utility of a spot for a module: the value of the spot less the cost of taking it.
//!
//! The paper, section "Configuration Formation as Utility Maximization Problem", with two differences: a kept link costs
//! nothing at either end, while the paper charges its undocking and docking; and the choice of spots adds detours round
//! walls ([`Detours`]) and the square of the distance ([`DistanceCost`]).

use crate::value::detours::Detours;
use crate::value::distance_cost::DistanceCost;
use crate::value::{betweenness, share_of_shortest_paths};
use formation_model::{
    MICRO_PER_UNIT, MicroUnits, PlanningProblem, Policy, Pose, SpotValue, Target, Weights,
};

/// The utilities of all modules of a problem for all spots of a target, both named by their position in ascending order of
/// identifier.
#[derive(Clone, Debug)]
pub struct Utilities {
    weights: Weights,
    distance_cost: DistanceCost,
    /// `None` if all ways are straight.
    detours: Option<Detours>,
    module_poses: Vec<Pose>,
    /// For each module, the cost of undocking all of its links.
    undocking: Vec<MicroUnits>,
    spot_poses: Vec<Pose>,
    values: Vec<MicroUnits>,
    /// The value of each spot less the cost of docking all of its links.
    net_values: Vec<MicroUnits>,
}

impl Utilities {
    /// The utilities of a problem's modules for its own target.
    #[must_use]
    pub fn of_problem(problem: &PlanningProblem) -> Self {
        Self::new(problem, problem.target())
    }

    /// Prepares the utilities of the problem's modules for the spots of `target`: the problem's own, or a part of it.
    pub(crate) fn new(problem: &PlanningProblem, target: &Target) -> Self {
        let weights = problem.parameters().weights;
        let topology = target.topology();
        let modules = problem.modules().iter();
        let parameters = problem.parameters();
        let detours = Detours::of(problem, target);
        let is_as_printed =
            parameters.policy == Policy::Paper && parameters.paper.val == SpotValue::RatioOfSums;
        let values = if is_as_printed {
            share_of_shortest_paths(topology)
        } else {
            betweenness(topology)
        };
        let net_values = values
            .iter()
            .enumerate()
            .map(|(spot, &value)| value - weights.dock().times(topology.degree(spot)))
            .collect();
        Self {
            weights,
            distance_cost: DistanceCost::of_problem(
                problem,
                detours.as_ref().map_or(0, Detours::longest),
            ),
            detours,
            module_poses: modules.clone().map(|module| module.pose).collect(),
            undocking: modules
                .map(|module| weights.undock().times(module.links.len()))
                .collect(),
            spot_poses: target.spots().iter().map(|spot| spot.pose).collect(),
            values,
            net_values,
        }
    }

    /// The value of a spot: its betweenness centrality, or what the policy `paper` reads as it.
    pub fn value(&self, spot: usize) -> MicroUnits {
        self.values[spot]
    }

    /// The utility of a module for a spot, `U_a(s) = Val(s) - cost(a, s)`, with every link end charged. It decides the
    /// choice of spots, so its cost has detours and the parameter `spread`.
    pub fn of(&self, module: usize, spot: usize) -> MicroUnits {
        let travel = MicroUnits(self.travel_cost(module, spot));
        self.net_values[spot] - travel - self.undocking[module]
    }

    /// The same with the plain distance: the paper's utility, of which totals are the sum.
    pub fn plain(&self, module: usize, spot: usize) -> MicroUnits {
        let distance = self.distance(module, spot);
        let travel = self.distance_cost.plain().of(distance);
        self.net_values[spot] - travel - self.undocking[module]
    }

    /// The straight distance of a module to a spot.
    pub(crate) fn distance(&self, module: usize, spot: usize) -> MicroUnits {
        self.module_poses[module].distance_to(&self.spot_poses[spot])
    }

    /// The utility of a module for every spot.
    pub fn row(&self, module: usize) -> Vec<i64> {
        (0..self.values.len())
            .map(|spot| self.of(module, spot).0)
            .collect()
    }

    /// By how much the way of a module to a spot is longer than the straight one, because of walls.
    #[inline]
    pub fn detour(&self, module: usize, spot: usize) -> MicroUnits {
        let detours = self.detours.as_ref();
        let units = detours.map_or(0, |detours| detours.units(module, spot));
        MicroUnits(units * MICRO_PER_UNIT)
    }

    /// The cost of a module's way to a spot.
    #[inline]
    pub(crate) fn travel_cost(&self, module: usize, spot: usize) -> i64 {
        let way = self.distance(module, spot) + self.detour(module, spot);
        self.distance_cost.of(way).0
    }

    /// The least cost of a module's way to a pose: that of the straight one.
    #[inline]
    pub(crate) fn least_travel_cost(&self, module: usize, to: &Pose) -> i64 {
        let distance = self.module_poses[module].distance_to(to);
        self.distance_cost.of(distance).0
    }

    /// The value of a spot less the cost of docking all of its links.
    pub(crate) fn net_value(&self, spot: usize) -> i64 {
        self.net_values[spot].0
    }

    /// The cost of undocking all links of a module.
    pub(crate) fn undocking(&self, module: usize) -> i64 {
        self.undocking[module].0
    }

    /// The pose of a module.
    pub(crate) fn module_pose(&self, module: usize) -> &Pose {
        &self.module_poses[module]
    }

    /// The saving of a kept link over undocking and docking it, at its two ends together.
    pub(crate) fn kept_link(&self) -> MicroUnits {
        (self.weights.dock() + self.weights.undock()).times(2)
    }

    /// The reward of a block of `size` modules, `f_rwd(k) = (k - 2) / |A|`; zero below two modules.
    pub(crate) fn retention_reward(&self, size: usize) -> MicroUnits {
        let count = i64::try_from(self.module_poses.len().max(1)).unwrap_or(i64::MAX);
        let retained = i64::try_from(size.saturating_sub(2)).unwrap_or(i64::MAX);
        MicroUnits(retained.saturating_mul(MICRO_PER_UNIT) / count)
    }
}
