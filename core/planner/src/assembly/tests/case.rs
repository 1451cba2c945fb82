//! Formations made for tests, and what every order of theirs has to keep.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::assembly::order;
use formation_generate::{GeneratorParameters, Random, generate};
use formation_model::{
    Assembly, AssemblyWarning, MicroUnits, ModuleId, Plan, PlannerParameters, PlanningModule,
    PlanningProblem, Pose, RawSpot, RawTarget, SpotId, Target, Topology,
};

pub(super) type Cell = (i64, i64);

/// A formation to be ordered: module `i` on spot `i`, which lies on `cells[i]`.
#[derive(Clone, Debug, Default)]
pub(super) struct Case {
    pub(super) cells: Vec<Cell>,
    pub(super) edges: Vec<(usize, usize)>,
    pub(super) blocks: Vec<Vec<usize>>,
    pub(super) pins: BTreeSet<usize>,
    /// Spots that stay empty.
    pub(super) open: BTreeSet<usize>,
    /// A spot whose value is raised above all others.
    pub(super) favoured: Option<usize>,
}

/// Which orders with corridors a case has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    FromCentre,
    FromElsewhere,
    None,
}

const STEPS: [Cell; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

impl Case {
    /// Adds up to `count` of the edges that the lattice allows.
    pub(super) fn with_more_edges(mut self, random: &mut Random, count: usize) -> Self {
        for _ in 0..count {
            let first = random.index(self.cells.len());
            let step = STEPS[random.index(4)];
            let cell = (self.cells[first].0 + step.0, self.cells[first].1 + step.1);
            if let Some(second) = self.cells.iter().position(|&other| other == cell)
                && !self.edges.contains(&(first, second))
                && !self.edges.contains(&(second, first))
            {
                self.edges.push((first, second));
            }
        }
        self
    }

    /// Groups spots into connected blocks of up to `size`.
    pub(super) fn with_blocks(mut self, random: &mut Random, count: usize, size: usize) -> Self {
        let mut used = BTreeSet::new();
        for _ in 0..count {
            let mut block = vec![random.index(self.cells.len())];
            for _ in 0..3 * size {
                let from = block[random.index(block.len())];
                let near = self.neighbours(from);
                let next = near[random.index(near.len())];
                if block.len() < size && !block.contains(&next) {
                    block.push(next);
                }
            }
            if block.len() > 1 && block.iter().all(|spot| !used.contains(spot)) {
                used.extend(block.iter().copied());
                block.sort_unstable();
                self.blocks.push(block);
            }
        }
        self
    }

    fn neighbours(&self, spot: usize) -> Vec<usize> {
        let other = |&(first, second): &(usize, usize)| match (first == spot, second == spot) {
            (true, _) => Some(second),
            (_, true) => Some(first),
            _ => None,
        };
        self.edges.iter().filter_map(other).collect()
    }

    pub(super) fn problem(&self) -> PlanningProblem {
        let raw = RawTarget {
            frame_id: "map".to_owned(),
            spots: (0_u32..)
                .zip(&self.cells)
                .map(|(id, &(x, y))| RawSpot {
                    id,
                    x: x as f64 + 0.25,
                    y: y as f64 - 7.5,
                    theta: 0.0,
                })
                .collect(),
            edges: self
                .edges
                .iter()
                .map(|&(first, second)| [number(first), number(second)])
                .collect(),
        };
        let modules = (0..self.cells.len())
            .map(|spot| PlanningModule {
                id: ModuleId(number(spot)),
                pose: Pose::default(),
                links: BTreeSet::new(),
                configuration: None,
                leader: None,
                pin: self.pins.contains(&spot).then(|| SpotId(number(spot))),
            })
            .collect();
        let target = Arc::new(Target::try_from(raw).unwrap());
        PlanningProblem::new(target, PlannerParameters::default(), modules).unwrap()
    }

    pub(super) fn plan(&self) -> Plan {
        Plan {
            assignments: (0..self.cells.len())
                .filter(|spot| !self.open.contains(spot))
                .map(|spot| (ModuleId(number(spot)), SpotId(number(spot))))
                .collect(),
            blocks: self
                .blocks
                .iter()
                .map(|block| block.iter().map(|&spot| ModuleId(number(spot))).collect())
                .collect(),
            ..Plan::default()
        }
    }

    /// How many pairs of other spots each spot parts: on a tree its betweenness, before it is normalised.
    pub(super) fn values(&self) -> Vec<MicroUnits> {
        let count = self.cells.len();
        let topology = Topology::new(count, &self.edges);
        (0..count)
            .map(|spot| {
                let branches = topology.components_within(|other| other != spot);
                let sizes = branches.iter().map(Vec::len);
                let within = sizes.map(|size| size * (size - 1) / 2).sum::<usize>();
                let parted = (count - 1) * count.saturating_sub(2) / 2 - within;
                let favour = if self.favoured == Some(spot) {
                    1_000_000
                } else {
                    0
                };
                MicroUnits(i64::try_from(parted).unwrap() + favour)
            })
            .collect()
    }

    pub(super) fn order(&self) -> Assembly {
        order(&self.problem(), &self.plan(), &self.values())
    }

    /// The spot of greatest value.
    pub(super) fn root(&self) -> usize {
        let values = self.values();
        (0..values.len())
            .max_by_key(|&spot| (values[spot], usize::MAX - spot))
            .unwrap()
    }

    /// Whether free cells lead from far outside to a spot: a flood over the whole bounding box.
    fn has_corridor(&self, placed: &BTreeSet<usize>, spot: usize) -> bool {
        let obstacles: BTreeSet<Cell> = placed.iter().map(|&other| self.cells[other]).collect();
        let reach = |part: fn(&Cell) -> i64| {
            let along = self.cells.iter().map(part);
            (along.clone().min().unwrap() - 2, along.max().unwrap() + 2)
        };
        let ((left, right), (bottom, top)) = (reach(|cell| cell.0), reach(|cell| cell.1));
        let mut seen = BTreeSet::from([self.cells[spot]]);
        let mut stack = vec![self.cells[spot]];
        while let Some((x, y)) = stack.pop() {
            if x == left || x == right || y == bottom || y == top {
                return true;
            }
            for step in STEPS {
                let next = (x + step.0, y + step.1);
                if !obstacles.contains(&next) && seen.insert(next) {
                    stack.push(next);
                }
            }
        }
        false
    }

    /// Whether an order with corridors exists, by trying every set of placed spots; `root` is placed first.
    fn has_order(&self, root: Option<usize>) -> bool {
        let count = self.cells.len();
        let block_of = |spot: usize| self.blocks.iter().find(|block| block.contains(&spot));
        let start: BTreeSet<usize> = self.pins.clone();
        let mut reached = BTreeSet::from([start.clone()]);
        let mut stack = vec![start];
        while let Some(placed) = stack.pop() {
            if placed.len() == count {
                return true;
            }
            let begun = self.blocks.iter().find(|block| {
                let inside = block.iter().filter(|spot| placed.contains(spot)).count();
                inside > 0 && inside < block.len()
            });
            for spot in 0..count {
                let has_neighbour = match (placed.is_empty(), root) {
                    (true, Some(root)) => spot == root,
                    (true, None) => true,
                    _ => self
                        .neighbours(spot)
                        .iter()
                        .any(|other| placed.contains(other)),
                };
                let in_turn = begun.is_none_or(|block| block_of(spot) == Some(block));
                if placed.contains(&spot) || !has_neighbour || !in_turn {
                    continue;
                }
                let mut next = placed.clone();
                next.insert(spot);
                if !reached.contains(&next) && self.has_corridor(&placed, spot) {
                    reached.insert(next.clone());
                    stack.push(next);
                }
            }
        }
        false
    }

    /// Checks what every order has to keep, whether or not spots are walled in; returns its spots.
    pub(super) fn check(&self, assembly: &Assembly) -> Vec<usize> {
        let spots: Vec<usize> = assembly.spots().map(|spot| spot.0 as usize).collect();
        let filled: Vec<usize> = (0..self.cells.len())
            .filter(|spot| !self.open.contains(spot))
            .collect();
        let mut sorted = spots.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, filled, "every filled spot once: {self:?}");
        let restarts: Vec<usize> = assembly
            .warnings
            .iter()
            .filter_map(|warning| match warning {
                AssemblyWarning::Disconnected(spot) => Some(spot.0 as usize),
                _ => None,
            })
            .collect();
        let mut placed = BTreeSet::new();
        for (index, &spot) in spots.iter().enumerate() {
            let has_neighbour = self
                .neighbours(spot)
                .iter()
                .any(|other| placed.contains(other));
            if index > 0 && !self.pins.contains(&spot) {
                let named = restarts.contains(&spot);
                assert_ne!(
                    has_neighbour, named,
                    "spot {spot} in {assembly:?} of {self:?}"
                );
            }
            placed.insert(spot);
        }
        let mut blocks: BTreeSet<Vec<usize>> = BTreeSet::new();
        let mut pinned_over = false;
        for unit in &assembly.units {
            let mut modules: Vec<usize> = unit
                .placements
                .iter()
                .map(|&(module, _)| module.0 as usize)
                .collect();
            modules.sort_unstable();
            assert_eq!(unit.lead.0 as usize, modules[0]);
            assert_eq!(unit.pinned, self.pins.contains(&modules[0]));
            assert!(!(unit.pinned && pinned_over), "pinned units come first");
            pinned_over |= !unit.pinned;
            if modules.len() > 1 {
                blocks.insert(modules);
            }
        }
        assert_eq!(blocks, self.blocks.iter().cloned().collect(), "{self:?}");
        spots
    }

    pub(super) fn first_walled_in(&self, spots: &[usize]) -> Option<usize> {
        let mut placed = self.pins.clone();
        spots
            .iter()
            .copied()
            .filter(|spot| !self.pins.contains(spot))
            .find(|&spot| {
                let walled_in = !self.has_corridor(&placed, spot);
                placed.insert(spot);
                walled_in
            })
    }

    /// Compares with the search over all sets of placed spots.
    pub(super) fn check_against_every_order(&self) -> Order {
        let assembly = self.order();
        let spots = self.check(&assembly);
        let root = self.pins.is_empty().then(|| self.root());
        let exists = match (self.has_order(root), root) {
            (true, _) => Order::FromCentre,
            (false, Some(_)) if self.has_order(None) => Order::FromElsewhere,
            _ => Order::None,
        };
        let walled_in = self.first_walled_in(&spots);
        assert_eq!(
            walled_in.is_none(),
            exists != Order::None,
            "{assembly:?} of {self:?}"
        );
        let named: Vec<AssemblyWarning> = walled_in
            .map(|spot| AssemblyWarning::WalledIn(SpotId(number(spot))))
            .into_iter()
            .collect();
        assert_eq!(assembly.warnings, named);
        if let Some(root) = root {
            assert_eq!(spots[0] == root, exists != Order::FromElsewhere, "{self:?}");
        }
        exists
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a small whole number")]
fn whole(coordinate: f64) -> i64 {
    coordinate.round() as i64
}

fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap()
}

/// Trees of few branches, folded up in a small box so that they wall their own ends in.
pub(super) fn coiled_tree(random: &mut Random) -> Case {
    let (count, side) = (16 + random.index(7), 2);
    let mut case = Case {
        cells: vec![(0, 0)],
        ..Case::default()
    };
    let mut taken: BTreeSet<Cell> = [(0, 0)].into();
    let mut ends = vec![0, 0];
    for _ in 0..400 {
        if case.cells.len() == count {
            break;
        }
        let end = random.index(ends.len());
        let (x, y) = case.cells[ends[end]];
        let free: Vec<Cell> = STEPS
            .iter()
            .map(|step| (x + step.0, y + step.1))
            .filter(|cell| cell.0.abs() <= side && cell.1.abs() <= side && !taken.contains(cell))
            .collect();
        if free.is_empty() {
            // A new branch, rarely.
            if random.index(8) == 0 {
                ends.push(random.index(case.cells.len()));
            }
            continue;
        }
        // Of two cells the one with more taken around it, so that the tree coils.
        let crowd = |cell: &Cell| {
            (-1..=1)
                .flat_map(|right| (-1..=1).map(move |up| (right, up)))
                .filter(|(right, up)| taken.contains(&(cell.0 + right, cell.1 + up)))
                .count()
        };
        let (one, other) = (
            free[random.index(free.len())],
            free[random.index(free.len())],
        );
        let cell = if crowd(&one) >= crowd(&other) {
            one
        } else {
            other
        };
        taken.insert(cell);
        case.edges.push((ends[end], case.cells.len()));
        ends[end] = case.cells.len();
        case.cells.push(cell);
    }
    if random.index(2) == 0 {
        case.favoured = Some(random.index(case.cells.len()));
    }
    case
}

pub(super) fn generated(count: usize, seed: u64) -> Case {
    let scenario = generate(&GeneratorParameters::new(1, count, seed)).unwrap();
    let target = scenario.target;
    let position = |id: u32| target.spots.iter().position(|spot| spot.id == id).unwrap();
    Case {
        cells: target
            .spots
            .iter()
            .map(|spot| (whole(spot.x), whole(spot.y)))
            .collect(),
        edges: target
            .edges
            .iter()
            .map(|&[first, second]| (position(first), position(second)))
            .collect(),
        ..Case::default()
    }
}
