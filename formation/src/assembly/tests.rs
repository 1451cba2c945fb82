use std::collections::BTreeSet;
use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::generate::{GeneratorParameters, generate};
use crate::geometry::Pose;
use crate::id::SpotId;
use crate::parameters::PlannerParameters;
use crate::problem::PlanningModule;
use crate::target::{RawSpot, RawTarget, Target};

type Cell = (i64, i64);

/// Steele, Lea and Flood's SplitMix64, so that every case can be named by its seed.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        usize::try_from(bits % limit as u64).unwrap()
    }
}

/// A formation to be ordered: module `i` on spot `i`, which lies on `cells[i]`.
#[derive(Clone, Debug, Default)]
struct Case {
    cells: Vec<Cell>,
    edges: Vec<(usize, usize)>,
    blocks: Vec<Vec<usize>>,
    pins: BTreeSet<usize>,
    /// Spots that nobody fills.
    open: BTreeSet<usize>,
    /// A spot whose value is raised above all others.
    favoured: Option<usize>,
}

/// Which orders with corridors a case has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    FromCentre,
    FromElsewhere,
    None,
}

const STEPS: [Cell; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

impl Case {
    /// Adds up to `count` of the edges that the lattice allows.
    fn with_more_edges(mut self, random: &mut Random, count: usize) -> Self {
        for _ in 0..count {
            let first = random.below(self.cells.len());
            let step = STEPS[random.below(4)];
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
    fn with_blocks(mut self, random: &mut Random, count: usize, size: usize) -> Self {
        let mut used = BTreeSet::new();
        for _ in 0..count {
            let mut block = vec![random.below(self.cells.len())];
            for _ in 0..3 * size {
                let from = block[random.below(block.len())];
                let near = self.neighbours(from);
                let next = near[random.below(near.len())];
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

    fn problem(&self) -> PlanningProblem {
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

    fn plan(&self) -> Plan {
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
    fn values(&self) -> Vec<MicroUnits> {
        let count = self.cells.len();
        let topology = Topology::new(count, &self.edges).unwrap();
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

    fn order(&self) -> Assembly {
        order(&self.problem(), &self.plan(), &self.values())
    }

    /// The spot of greatest value.
    fn root(&self) -> usize {
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
                let beside = match (placed.is_empty(), root) {
                    (true, Some(root)) => spot == root,
                    (true, None) => true,
                    _ => self
                        .neighbours(spot)
                        .iter()
                        .any(|other| placed.contains(other)),
                };
                let in_turn = begun.is_none_or(|block| block_of(spot) == Some(block));
                if placed.contains(&spot) || !beside || !in_turn {
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
    fn check(&self, assembly: &Assembly) -> Vec<usize> {
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
            let beside = self
                .neighbours(spot)
                .iter()
                .any(|other| placed.contains(other));
            if index > 0 && !self.pins.contains(&spot) {
                let named = restarts.contains(&spot);
                assert_ne!(beside, named, "spot {spot} in {assembly:?} of {self:?}");
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

    fn first_walled_in(&self, spots: &[usize]) -> Option<usize> {
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
    fn check_against_every_order(&self) -> Order {
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
fn coiled_tree(random: &mut Random) -> Case {
    let (count, side) = (16 + random.below(7), 2);
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
        let end = random.below(ends.len());
        let (x, y) = case.cells[ends[end]];
        let free: Vec<Cell> = STEPS
            .iter()
            .map(|step| (x + step.0, y + step.1))
            .filter(|cell| cell.0.abs() <= side && cell.1.abs() <= side && !taken.contains(cell))
            .collect();
        if free.is_empty() {
            // A new branch, rarely.
            if random.below(8) == 0 {
                ends.push(random.below(case.cells.len()));
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
            free[random.below(free.len())],
            free[random.below(free.len())],
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
    if random.below(2) == 0 {
        case.favoured = Some(random.below(case.cells.len()));
    }
    case
}

/// Runs `make` over seeds and compares with every order; returns how many cases had which.
fn compare_with_every_order(seeds: u64, make: impl Fn(&mut Random) -> Case) -> [usize; 3] {
    let mut outcomes = [0; 3];
    for seed in 0..seeds {
        let outcome = make(&mut Random(seed)).check_against_every_order();
        outcomes[outcome as usize] += 1;
    }
    outcomes
}

#[test]
fn small_trees_are_ordered_whenever_an_order_exists() {
    let outcomes = compare_with_every_order(3_000, coiled_tree);
    assert!(outcomes.iter().all(|&count| count >= 10), "{outcomes:?}");
}

#[test]
fn small_trees_with_blocks_are_ordered_whenever_an_order_exists() {
    let outcomes = compare_with_every_order(3_000, |random| {
        coiled_tree(random).with_blocks(random, 3, 5)
    });
    assert!(outcomes.iter().all(|&count| count >= 10), "{outcomes:?}");
}

#[test]
fn small_cyclic_targets_are_ordered_whenever_an_order_exists() {
    let outcomes = compare_with_every_order(6_000, |random| {
        let edges = 1 + random.below(6);
        let case = coiled_tree(random).with_more_edges(random, edges);
        if random.below(2) == 0 {
            case
        } else {
            case.with_blocks(random, 2, 5)
        }
    });
    assert!(outcomes.iter().all(|&count| count >= 10), "{outcomes:?}");
}

#[test]
fn pinned_modules_are_obstacles_from_the_start() {
    let outcomes = compare_with_every_order(3_000, |random| {
        let mut case = coiled_tree(random);
        for _ in 0..1 + random.below(4) {
            case.pins.insert(random.below(case.cells.len()));
        }
        case
    });
    assert!(outcomes[0] >= 10 && outcomes[2] >= 10, "{outcomes:?}");
}

fn generated(count: usize, seed: u64) -> Case {
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

/// The prototype's figures: breadth-first alone about 14 of 100, from the centre 93, from anywhere 96. Here: 46, 382
/// and 388 of 400.
#[test]
fn most_random_lattice_trees_of_100_spots_have_an_order() {
    let (mut breadth_first, mut from_centre, mut from_anywhere) = (0, 0, 0);
    for seed in 0..400 {
        let case = generated(100, seed);
        let (problem, plan, values) = (case.problem(), case.plan(), case.values());
        let base = BreadthFirst::of(&Ground::new(&problem, &plan, &values));
        breadth_first += usize::from(case.first_walled_in(&base.sequence).is_none());
        let assembly = case.order();
        let spots = case.check(&assembly);
        let is_free = assembly.warnings.is_empty();
        assert_eq!(is_free, case.first_walled_in(&spots).is_none());
        from_anywhere += usize::from(is_free);
        from_centre += usize::from(is_free && spots[0] == case.root());
    }
    assert_eq!((breadth_first, from_centre, from_anywhere), (46, 382, 388));
}

#[test]
fn a_large_formation_with_large_blocks_is_ordered() {
    for (seed, blocks) in [(1, 0), (2, 40)] {
        let case = generated(10_000, seed).with_blocks(&mut Random(seed), blocks, 200);
        let values = vec![MicroUnits::ZERO; 10_000];
        let assembly = order(&case.problem(), &case.plan(), &values);
        case.check(&assembly);
        // At this size some end is walled in for certain.
        assert!(matches!(
            assembly.warnings[..],
            [AssemblyWarning::WalledIn(_)]
        ));
    }
}

/// Nine cells in a row of turns: the first of them ends up walled in by the others.
const SPIRAL: [Cell; 9] = [
    (0, 0),
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
    (-1, -1),
    (0, -1),
    (0, -2),
];

fn path(cells: &[Cell]) -> Case {
    Case {
        cells: cells.to_vec(),
        edges: (1..cells.len()).map(|spot| (spot - 1, spot)).collect(),
        ..Case::default()
    }
}

/// Two spirals that share their outer end: whichever inner end is placed first, the other is walled in.
fn double_spiral() -> Case {
    let mut cells = SPIRAL.to_vec();
    cells.extend(SPIRAL.iter().rev().skip(1).map(|&(x, y)| (-x, -4 - y)));
    path(&cells)
}

#[test]
fn a_spiral_begins_inside_and_a_double_one_is_warned_of() {
    let mut cells = SPIRAL.to_vec();
    cells.extend((3..12).map(|down| (0, -down)));
    let spiral = path(&cells);
    let assembly = spiral.order();
    // From the middle of the path outward, spot 0 would be walled in by spots 1 to 8.
    assert_eq!(spiral.root(), 8);
    assert_eq!(spiral.check(&assembly)[..9], [6, 5, 4, 3, 2, 1, 0, 7, 8]);
    assert_eq!(assembly.warnings, []);

    let double = double_spiral();
    let assembly = double.order();
    // Breadth-first from the middle both ends come last, the lower first.
    assert_eq!(double.check(&assembly)[13..], [1, 15, 0, 16]);
    assert_eq!(
        assembly.warnings,
        [AssemblyWarning::WalledIn(SpotId(0))],
        "{assembly:?}"
    );
}

#[test]
fn a_search_that_is_cut_says_so_and_goes_breadth_first() {
    let mut case = double_spiral();
    // A ring beside the middle makes the target cyclic.
    case.cells.extend([(1, -2), (2, -2), (2, -1), (1, -1)]);
    case.edges
        .extend([(8, 17), (17, 18), (18, 19), (19, 20), (17, 20)]);
    let ordered = |steps_max| {
        let assembly = order_within(&case.problem(), &case.plan(), &case.values(), steps_max);
        (case.check(&assembly), assembly.warnings)
    };
    let (searched, warnings) = ordered(SEARCH_STEPS_MAX);
    assert_eq!(warnings, [AssemblyWarning::WalledIn(SpotId(0))]);
    let (cut, warnings) = ordered(100);
    assert_eq!(
        warnings,
        [
            AssemblyWarning::WalledIn(SpotId(0)),
            AssemblyWarning::BudgetSpent
        ]
    );
    assert_eq!(cut, searched);
}

#[test]
fn off_the_lattice_corridors_are_not_checked() {
    let far_apart = path(&[(0, 0), (2, 0), (4, 0)]);
    let assembly = far_apart.order();
    assert_eq!(far_apart.check(&assembly), [1, 0, 2]);
    assert_eq!(assembly.warnings, [AssemblyWarning::OffLattice]);
    let on_one_cell = path(&[(0, 0), (1, 0), (0, 0)]);
    assert_eq!(on_one_cell.order().warnings, [AssemblyWarning::OffLattice]);
}

#[test]
fn disconnected_parts_begin_anew_and_say_where() {
    let mut case = path(&[(0, 0), (1, 0), (2, 0), (3, 0), (4, 0)]);
    case.open.insert(1);
    let assembly = case.order();
    assert_eq!(case.check(&assembly), [2, 3, 4, 0]);
    assert_eq!(
        assembly.warnings,
        [AssemblyWarning::Disconnected(SpotId(0))]
    );
}

proptest! {
    #[test]
    fn every_spot_has_a_placed_neighbour(
        seed in any::<u64>(), count in 1_usize..60, edges in 0_usize..20, blocks in 0_usize..6,
        pins in 0_usize..3, open in 0_usize..8,
    ) {
        let mut random = Random(seed);
        let mut case = generated(count, seed).with_more_edges(&mut random, edges);
        if count > 1 {
            case = case.with_blocks(&mut random, blocks, 8);
        }
        for _ in 0..pins {
            let pin = random.below(count);
            if case.blocks.iter().all(|block| !block.contains(&pin)) {
                case.pins.insert(pin);
            }
        }
        for _ in 0..open {
            let spot = random.below(count);
            if !case.pins.contains(&spot) && case.blocks.iter().all(|block| !block.contains(&spot)) {
                case.open.insert(spot);
            }
        }
        let assembly = order_within(&case.problem(), &case.plan(), &case.values(), 100_000);
        let spots = case.check(&assembly);
        let named = assembly.warnings.iter().find_map(|warning| match warning {
            AssemblyWarning::WalledIn(spot) => Some(spot.0 as usize),
            _ => None,
        });
        prop_assert_eq!(case.first_walled_in(&spots), named);
    }
}
