//! How long a plan takes, estimated from sizes alone, so that a target can be refused before any process plans for it.
//!
//! The estimate is an upper bound for the instances that were measured, and up to ten times what the average one takes. The
//! constants are processor times of one core of the machine of `docs/benchmarks.md`.

use std::time::Duration;

use thiserror::Error;

use formation_model::{PlannerParameters, PlanningProblem, Policy, Target};

/// The longest plan that real processes are asked for: half of the default of `plan_limit_s`, as other machines are slower.
pub const PLAN_TIME_MAX: Duration = Duration::from_secs(30);

/// A chain of evictions reaches each spot of a single module, and compares it with each other: nanoseconds for one module and
/// a pair of such spots. 1,000 modules at one place take 0.74 s, 3,000 at random places 7 s.
const CHAIN_NS: f64 = 0.75;
/// The same for each unit of a bounded `d_max`: 300 modules with `d_max` 30 take 5.5 s, 1,000 with 10 take 52 s.
const BOUNDED_CHAIN_NS: f64 = 7.0;
/// Beyond this, a larger `d_max` takes no longer.
const D_MAX_SEARCHED: u32 = 64;
/// The central policies, for a module and a pair of spots: `hungarian` takes 0.77 s for 1,000 modules and spots.
const CENTRAL_NS: f64 = 0.8;
/// A policy of one's own, for a module and a spot: what it does is not known, and `nearest` sorts all pairs, which takes 0.25 s
/// for 1,000 modules and spots.
const OWN_NS: f64 = 250.0;
/// Shortest paths from one spot, for one edge of a target with cycles: a 100 x 100 grid takes 1.6 s.
const BETWEENNESS_NS: f64 = 10.0;
/// The place of a configuration in a graph with cycles, before it is searched, for one of its modules and one spot: 40 blocks of 25 modules on 1,000
/// spots take 0.8 s.
const PLACEMENT_NS: f64 = 1_000.0;
/// All searches of a plan for the best places of configurations in graphs with cycles: the whole search budget, which a dry run
/// shares.
const SEARCH_NS: f64 = 5.0e9;
/// The same for the policy `paper`, whose candidates take a dynamic programme each on a tree: 10 modules on 100 spots take 5 ms,
/// 50 take 150 ms with MAX = 20.
const PAPER_TREE_NS: f64 = 30_000.0;
/// The same on a target with cycles, where each configuration may search for half a second.
const PAPER_CYCLES_NS: f64 = 500_000.0;
/// The whole search budget where the policy `paper` spends it.
const PAPER_SEARCH_NS: f64 = 2.0e10;
/// A search for ways past walls, for one cell: 1,000 searches through 250,000 cells take 1.5 s.
const WAY_NS: f64 = 6.0;
/// The most of a configuration's modules that leave it and take single turns, as a part of all.
const DETACHED_PART: f64 = 0.25;

/// The sizes on which the time of a plan depends.
#[derive(Clone, Copy, Debug)]
pub struct PlanSize<'a> {
    /// The target.
    pub target: &'a Target,
    /// The parameters.
    pub parameters: &'a PlannerParameters,
    /// The number of modules.
    pub modules: usize,
    /// The number of those that start in a configuration.
    pub configured: usize,
    /// The number of cells through which ways past walls are searched; 0 without walls.
    pub cells: usize,
}

/// A plan takes longer than [`PLAN_TIME_MAX`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "{field}: a plan for {modules} modules and {spots} spots{with} may take {} s, and real processes are given at most {} s: {advice}",
    time.as_secs(),
    PLAN_TIME_MAX.as_secs()
)]
pub struct PlanTooLong {
    /// The field of a scenario to which the most time is due.
    pub field: &'static str,
    /// The number of modules.
    pub modules: usize,
    /// The number of spots.
    pub spots: usize,
    with: String,
    advice: &'static str,
    /// The estimate.
    pub time: Duration,
}

/// A part of the work.
struct Part {
    nanoseconds: f64,
    field: &'static str,
    advice: &'static str,
}

impl<'a> PlanSize<'a> {
    /// The sizes of a problem.
    #[must_use]
    pub fn of(problem: &'a PlanningProblem) -> Self {
        let configurations = problem.configurations();
        Self {
            target: problem.target(),
            parameters: problem.parameters(),
            modules: problem.modules().len(),
            configured: (configurations.iter())
                .map(|configuration| configuration.modules.len())
                .sum(),
            cells: problem.free_cells().map_or(0, |cells| cells.count()),
        }
    }

    /// Checks that a plan does not take too long.
    ///
    /// # Errors
    /// Names the field to which the most time is due, and the estimate.
    pub fn check(&self) -> Result<(), PlanTooLong> {
        let parts = self.parts();
        let total: f64 = parts.iter().map(|part| part.nanoseconds).sum();
        let time = Duration::from_secs_f64((total / 1.0e9).min(1.0e9));
        let longest = parts
            .into_iter()
            .max_by(|one, other| one.nanoseconds.total_cmp(&other.nanoseconds));
        let Some(part) = longest.filter(|_| time > PLAN_TIME_MAX) else {
            return Ok(());
        };
        Err(PlanTooLong {
            field: part.field,
            modules: self.modules,
            spots: self.target.spots().len(),
            with: match self.parameters.d_max {
                Some(d_max) if part.field == "planner.d_max" => format!(" with d_max {d_max}"),
                _ => String::new(),
            },
            advice: part.advice,
            time,
        })
    }

    /// The parts of the work, each with its time.
    #[expect(
        clippy::cast_precision_loss,
        reason = "an estimate, of counts far below 2^53"
    )]
    fn parts(&self) -> Vec<Part> {
        let topology = self.target.topology();
        let spots = topology.node_count() as f64;
        let modules = self.modules as f64;
        let configured = self.configured as f64;
        let is_tree = topology.is_tree();
        let is_trimmed = modules < spots && self.parameters.trims_target();
        // Trimming needs a dry run of all turns.
        let runs = if is_trimmed { 2.0 } else { 1.0 };
        let single = modules - configured * (1.0 - DETACHED_PART);
        // Chains lead through the spots of single modules.
        let pairs = single.min(spots).powi(2);
        let chains = runs * single * pairs;
        let turns = match (self.parameters.policy, self.parameters.d_max) {
            (Policy::Exact, Some(d_max)) => Part {
                nanoseconds: chains * BOUNDED_CHAIN_NS * f64::from(d_max.clamp(1, D_MAX_SEARCHED)),
                field: "planner.d_max",
                advice: "use a smaller d_max, none, or fewer modules",
            },
            (Policy::Auction | Policy::Hungarian, _) => Part {
                nanoseconds: runs * modules * spots * modules.max(spots) * CENTRAL_NS,
                field: "planner.policy",
                advice: "use the policy exact, or fewer modules",
            },
            (Policy::Given, _) => Part {
                nanoseconds: 0.0,
                field: "planner.policy",
                advice: "use fewer modules",
            },
            (Policy::Own(_), _) => Part {
                nanoseconds: runs * modules * spots * OWN_NS,
                field: "planner.policy",
                advice: "use the policy exact, or fewer modules",
            },
            (Policy::Exact | Policy::Paper, _) => Part {
                nanoseconds: chains * CHAIN_NS,
                field: "modules",
                advice: "use fewer modules",
            },
        };
        let cycles = if is_tree { 0.0 } else { 1.0 };
        let values = Part {
            nanoseconds: cycles * runs * spots * topology.edges().len() as f64 * BETWEENNESS_NS,
            field: "target.edges",
            advice: "use a target with fewer spots or edges",
        };
        let placements = Part {
            nanoseconds: self.placements_ns(runs),
            field: "configurations",
            advice: "use fewer modules in configurations, or a target without cycles",
        };
        let ways = Part {
            nanoseconds: runs * modules.min(spots) * self.cells as f64 * WAY_NS,
            field: "obstacles",
            advice: "use a smaller arena, or obstacles that are nearer",
        };
        vec![turns, values, placements, ways]
    }
}

impl PlanSize<'_> {
    /// The time to place all configurations, with as many runs over all turns.
    #[expect(
        clippy::cast_precision_loss,
        reason = "MAX and all counts are far below 2^53"
    )]
    fn placements_ns(&self, runs: f64) -> f64 {
        let topology = self.target.topology();
        let pairs = self.configured as f64 * topology.node_count() as f64;
        let candidates = self.parameters.paper.max() as f64 / 20.0;
        match (self.parameters.policy, topology.is_tree()) {
            _ if self.configured == 0 => 0.0,
            (Policy::Paper, true) => pairs * PAPER_TREE_NS * candidates.max(1.0),
            (Policy::Paper, false) => {
                pairs * PLACEMENT_NS + (pairs * PAPER_CYCLES_NS).min(PAPER_SEARCH_NS)
            }
            (Policy::Own(_) | Policy::Given, _) | (_, true) => 0.0,
            (_, false) => runs * pairs * PLACEMENT_NS + SEARCH_NS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_generate::{GeneratorParameters, Grouping, generate};
    use formation_model::Scenario;

    fn drawn(modules: usize, grouping: Grouping, d_max: Option<u32>) -> Result<(), PlanTooLong> {
        let parameters = GeneratorParameters::new(modules, modules, 1).grouped(grouping);
        let scenario = Scenario::try_from(generate(&parameters).unwrap()).unwrap();
        let parameters = PlannerParameters {
            d_max,
            ..*scenario.problem().parameters()
        };
        let size = PlanSize::of(scenario.problem());
        PlanSize {
            parameters: &parameters,
            ..size
        }
        .check()
    }

    #[test]
    fn what_takes_seconds_is_allowed_and_what_takes_minutes_is_not() {
        for modules in [300, 1_000, 3_000] {
            assert_eq!(drawn(modules, Grouping::Singletons, None), Ok(()));
            assert_eq!(drawn(modules, Grouping::Configurations(10), None), Ok(()));
        }
        assert_eq!(drawn(10_000, Grouping::Configurations(10), None), Ok(()));
        let refused = drawn(10_000, Grouping::Singletons, None).unwrap_err();
        assert_eq!(refused.field, "modules");
        assert_eq!(drawn(300, Grouping::Singletons, Some(30)), Ok(()));
        let refused = drawn(1_000, Grouping::Singletons, Some(10)).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "planner.d_max: a plan for 1000 modules and 1000 spots with d_max 10 may take 70 s, and real processes are \
             given at most 30 s: use a smaller d_max, none, or fewer modules"
        );
    }

    #[test]
    fn large_grids_are_allowed_for_few_modules() {
        let parameters = PlannerParameters::default();
        let size = |target, modules, configured| {
            PlanSize {
                target,
                parameters: &parameters,
                modules,
                configured,
                cells: 0,
            }
            .check()
        };
        let (small, large) = (crate::grid::grid(20), crate::grid::grid(100));
        assert_eq!(size(&small, 100, 100), Ok(()));
        assert_eq!(size(&large, 3, 0), Ok(()));
        assert_eq!(size(&large, 1_000, 1_000), Ok(()));
        assert_eq!(size(&large, 10_000, 0).unwrap_err().field, "modules");
        let refused = size(&large, 10_000, 10_000).unwrap_err();
        assert_eq!(refused.field, "configurations");
    }
}
