//! Which module takes which spot if it does not matter which: single modules fill the spots one after another.
//!
//! A tree spans the free cells and loses one leaf after another. A leaf that is a spot goes to the nearest module, which no other
//! stands before; one that is neither a spot nor taken is of no use. From a taken leaf that is no spot, the modules up to the
//! nearest free cell move on by one. So there is a serial motion to whatever this gives, as long as one cell is free.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::lattice::Arena;

/// No cell: cells have a closed ring around them.
const NONE: usize = usize::MAX;

/// Ordered by what goes first: a leaf of no use, a spot that is held already, another spot, a module that has to leave; of
/// equal ones the farthest from the root.
type Leaf = (u8, Reverse<usize>, usize);

pub(super) struct SpotFilling<'a> {
    arena: &'a Arena,
    /// The cell before each in the tree; the cell itself for a root.
    parents: Vec<usize>,
    depths: Vec<usize>,
    /// Whether each cell is still in the tree.
    is_left: Vec<bool>,
    modules: BTreeMap<usize, usize>,
    spots: BTreeMap<usize, usize>,
    leaves: BTreeSet<Leaf>,
}

impl<'a> SpotFilling<'a> {
    /// With the cells that are not open, and the modules and the spots by their cells.
    pub fn new(
        arena: &'a Arena,
        closed: &[bool],
        modules: BTreeMap<usize, usize>,
        spots: BTreeMap<usize, usize>,
    ) -> Self {
        let mut filling = Self {
            arena,
            parents: vec![NONE; arena.area()],
            depths: vec![0; arena.area()],
            is_left: closed.iter().map(|closed| !closed).collect(),
            modules,
            spots,
            leaves: BTreeSet::new(),
        };
        filling.span();
        for cell in 0..arena.area() {
            filling.note_leaf(cell);
        }
        filling
    }

    /// Spans a tree over each region with spots, and leaves out what they cannot reach.
    fn span(&mut self) {
        let roots: Vec<usize> = self.spots.keys().copied().collect();
        for root in roots {
            if !self.is_left[root] || self.parents[root] != NONE {
                continue;
            }
            self.parents[root] = root;
            let mut waiting = VecDeque::from([root]);
            while let Some(cell) = waiting.pop_front() {
                for next in self.arena.neighbours(cell) {
                    if self.is_left[next] && self.parents[next] == NONE {
                        self.parents[next] = cell;
                        self.depths[next] = self.depths[cell] + 1;
                        waiting.push_back(next);
                    }
                }
            }
        }
        for (is_left, &parent) in self.is_left.iter_mut().zip(&self.parents) {
            *is_left &= parent != NONE;
        }
    }

    /// The cells next to one in what is left of the tree.
    fn joined(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        let next = self.arena.neighbours(cell);
        next.filter(move |&next| {
            self.is_left[next] && (self.parents[next] == cell || self.parents[cell] == next)
        })
    }

    fn leaf(&self, cell: usize) -> Option<Leaf> {
        if !self.is_left[cell] || self.joined(cell).count() > 1 {
            return None;
        }
        let (is_spot, is_held) = (
            self.spots.contains_key(&cell),
            self.modules.contains_key(&cell),
        );
        let class = match (is_spot, is_held) {
            (false, false) => 0,
            (true, true) => 1,
            (true, false) => 2,
            (false, true) => 3,
        };
        Some((class, Reverse(self.depths[cell]), cell))
    }

    fn note_leaf(&mut self, cell: usize) {
        for class in 0..4 {
            self.leaves
                .remove(&(class, Reverse(self.depths[cell]), cell));
        }
        self.leaves.extend(self.leaf(cell));
    }

    /// The module that each spot gets; `None` if no module gets there.
    pub fn holders(mut self) -> Option<BTreeMap<usize, usize>> {
        let mut holders = BTreeMap::new();
        while !self.spots.is_empty() {
            let (_, _, leaf) = self.leaves.pop_first()?;
            if let Some(spot) = self.spots.remove(&leaf) {
                let from = *self
                    .way(leaf, |filling, cell| filling.modules.contains_key(&cell))?
                    .last()?;
                holders.insert(spot, self.modules.remove(&from)?);
                self.note_leaf(from);
            } else if self.modules.contains_key(&leaf) {
                let way = self.way(leaf, |filling, cell| !filling.modules.contains_key(&cell))?;
                for pair in way.windows(2).rev() {
                    if let Some(module) = self.modules.remove(&pair[0]) {
                        self.modules.insert(pair[1], module);
                    }
                }
                self.note_leaf(*way.last()?);
            }
            self.is_left[leaf] = false;
            let next: Vec<usize> = self.arena.neighbours(leaf).collect();
            for cell in next {
                self.note_leaf(cell);
            }
        }
        Some(holders)
    }

    /// The cells in the tree from one to the nearest for which this holds.
    fn way(&self, from: usize, is_end: impl Fn(&Self, usize) -> bool) -> Option<Vec<usize>> {
        let mut before: BTreeMap<usize, usize> = [(from, from)].into();
        let mut waiting = VecDeque::from([from]);
        while let Some(cell) = waiting.pop_front() {
            if is_end(self, cell) {
                let mut way = vec![cell];
                while let Some(&last) = way.last().filter(|&&last| last != from) {
                    way.push(*before.get(&last)?);
                }
                way.reverse();
                return Some(way);
            }
            for next in self.joined(cell) {
                before.entry(next).or_insert_with(|| {
                    waiting.push_back(next);
                    cell
                });
            }
        }
        None
    }
}
