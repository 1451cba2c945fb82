//! Random problems that shrink: small targets and configurations with or without cycles, modules anywhere.

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    CutPrice, MicroUnits, ModuleId, PlannerParameters, PlanningModule, PlanningProblem, Pose,
    RawSpot, RawTarget, SpotId, Spread, Target, TurnOrder,
};
use proptest::prelude::*;

use super::Numbers;

/// The parameters of a random problem. Each grows with the size of the problem, so that shrinking works.
#[derive(Clone, Debug)]
pub struct World {
    pub seed: u64,
    pub spots: usize,
    /// The number of edges of the target beyond a spanning tree.
    pub target_extra: usize,
    /// For each configuration, the number of modules and of links beyond a spanning tree.
    pub configurations: Vec<(usize, usize)>,
    pub singletons: usize,
    /// The number of singletons that have settled already.
    pub pinned: usize,
    /// Coordinates are multiples of this many micro-units: 1 gives no ties, a unit gives many.
    pub grid: i64,
    pub size_first: bool,
    pub d_max: Option<u32>,
    pub exact_finish: bool,
    /// In whole units.
    pub cut_price: u8,
    /// In thousandths.
    pub spread: u16,
    pub keep_all_spots: bool,
}

/// Worlds whose graphs have at most `extra_max` edges beyond a spanning tree.
pub fn worlds(extra_max: usize) -> impl Strategy<Value = World> {
    (
        (any::<u64>(), 1..14_usize, 0..=extra_max),
        proptest::collection::vec((2..7_usize, 0..=extra_max.min(2)), 0..4),
        (0..10_usize, 0..3_usize),
        prop_oneof![Just(1), Just(1_000_000)],
        (any::<bool>(), any::<bool>()),
        (
            proptest::option::weighted(0.3, 0..4_u32),
            any::<bool>(),
            prop_oneof![Just(1), Just(0), Just(20)],
            prop_oneof![Just(1), Just(0), Just(1_000)],
        ),
    )
        .prop_map(
            |(
                (seed, spots, target_extra),
                configurations,
                (singletons, pinned),
                grid,
                (size_first, keep_all_spots),
                (d_max, exact_finish, cut_price, spread),
            )| World {
                seed,
                spots,
                target_extra,
                singletons: if configurations.is_empty() {
                    singletons + 1
                } else {
                    singletons
                },
                pinned: pinned.min(singletons).min(spots - 1),
                configurations,
                grid,
                size_first,
                d_max,
                exact_finish,
                cut_price,
                spread,
                keep_all_spots,
            },
        )
}

/// A connected graph: a random tree and some more edges.
fn connected(numbers: &mut Numbers, nodes: usize, extra: usize) -> Vec<(usize, usize)> {
    let mut edges: BTreeSet<(usize, usize)> =
        (1..nodes).map(|node| (numbers.below(node), node)).collect();
    for _ in 0..extra {
        let (one, other) = (numbers.below(nodes), numbers.below(nodes));
        if one != other {
            edges.insert((one.min(other), one.max(other)));
        }
    }
    edges.into_iter().collect()
}

impl World {
    /// All coordinates are positive, from 20 to 52 units.
    fn pose(&self, numbers: &mut Numbers) -> Pose {
        let mut coordinate = || {
            let steps = 32_000_000 / self.grid;
            MicroUnits(20_000_000 + numbers.within(0, steps) * self.grid)
        };
        Pose {
            x: coordinate(),
            y: coordinate(),
            theta: MicroUnits::ZERO,
        }
    }

    pub fn parameters(&self) -> PlannerParameters {
        PlannerParameters {
            order: if self.size_first {
                TurnOrder::SizeFirst
            } else {
                TurnOrder::Rank
            },
            d_max: self.d_max,
            exact_finish: self.exact_finish,
            cut_price: CutPrice::from_units(f64::from(self.cut_price)).unwrap(),
            spread: Spread::from_units(f64::from(self.spread) / 1_000.0).unwrap(),
            keep_all_spots: self.keep_all_spots,
            ..PlannerParameters::default()
        }
    }

    pub fn problem(&self) -> Arc<PlanningProblem> {
        self.problem_with(&|id| id, &|id| id, (0, 0))
    }

    /// The same problem with other identifiers, shifted by micro-units.
    pub fn problem_with(
        &self,
        module_id: &dyn Fn(u32) -> u32,
        spot_id: &dyn Fn(u32) -> u32,
        shift: (i64, i64),
    ) -> Arc<PlanningProblem> {
        let mut numbers = Numbers(self.seed);
        let shifted = |pose: Pose| Pose {
            x: MicroUnits(pose.x.0 + shift.0),
            y: MicroUnits(pose.y.0 + shift.1),
            ..pose
        };
        let id = |position: usize| u32::try_from(position).unwrap();
        let spots: Vec<RawSpot> = (0..self.spots)
            .map(|spot| {
                let pose = shifted(self.pose(&mut numbers));
                RawSpot {
                    id: spot_id(id(spot)),
                    x: pose.x.to_units(),
                    y: pose.y.to_units(),
                    theta: 0.0,
                }
            })
            .collect();
        let edges = connected(&mut numbers, self.spots, self.target_extra);
        let target = Target::try_from(RawTarget {
            frame_id: "map".to_owned(),
            spots,
            edges: edges
                .iter()
                .map(|&(one, other)| [spot_id(id(one)), spot_id(id(other))])
                .collect(),
        })
        .unwrap();
        let mut modules: Vec<PlanningModule> = Vec::new();
        let mut add = |numbers: &mut Numbers, links: &[(usize, usize)], size: usize| {
            let first = modules.len();
            for node in 0..size {
                let linked = links.iter().filter_map(|&(one, other)| match node {
                    _ if node == one => Some(other),
                    _ if node == other => Some(one),
                    _ => None,
                });
                modules.push(PlanningModule {
                    id: ModuleId(module_id(id(first + node))),
                    pose: shifted(self.pose(numbers)),
                    links: linked
                        .map(|other| ModuleId(module_id(id(first + other))))
                        .collect(),
                    configuration: None,
                    leader: None,
                    pin: None,
                });
            }
        };
        for &(size, extra) in &self.configurations {
            let links = connected(&mut numbers, size, extra);
            add(&mut numbers, &links, size);
        }
        for _ in 0..self.singletons {
            add(&mut numbers, &[], 1);
        }
        // Singletons settle on distinct random spots; they come last in the list.
        let mut free: Vec<usize> = (0..self.spots).collect();
        for module in modules.iter_mut().rev().take(self.pinned) {
            let spot = free.swap_remove(numbers.below(free.len()));
            module.pin = Some(SpotId(spot_id(id(spot))));
        }
        // The order in which modules are given must not matter.
        for last in (1..modules.len()).rev() {
            modules.swap(last, numbers.below(last + 1));
        }
        Arc::new(PlanningProblem::new(Arc::new(target), self.parameters(), modules).unwrap())
    }
}
