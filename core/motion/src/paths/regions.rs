//! Which free cells are connected while more and more cells become free.

use super::lattice::Arena;

/// The regions of the free cells of an arena.
pub(super) struct Regions<'a> {
    arena: &'a Arena,
    /// Cells that are not free.
    pub taken: Vec<bool>,
    /// A cell nearer to the one that stands for its region, which leads to itself.
    towards: Vec<usize>,
    /// The number of cells of the region for which a cell stands.
    sizes: Vec<usize>,
}

impl<'a> Regions<'a> {
    pub fn new(arena: &'a Arena, taken: &[bool]) -> Self {
        let mut regions = Self {
            arena,
            towards: (0..taken.len()).collect(),
            sizes: vec![1; taken.len()],
            taken: vec![true; taken.len()],
        };
        for (cell, &is_taken) in taken.iter().enumerate() {
            if !is_taken {
                regions.free(cell);
            }
        }
        regions
    }

    /// A cell becomes free. It must not be of the arena's ring.
    pub fn free(&mut self, cell: usize) {
        self.taken[cell] = false;
        for next in self.arena.neighbours(cell) {
            if self.taken[next] {
                continue;
            }
            let (one, other) = (self.of(cell), self.of(next));
            if one != other {
                let (less, more) = if self.sizes[one] < self.sizes[other] {
                    (one, other)
                } else {
                    (other, one)
                };
                self.towards[less] = more;
                self.sizes[more] += self.sizes[less];
            }
        }
    }

    /// The cell that stands for the region of a free cell.
    pub fn of(&self, mut cell: usize) -> usize {
        while self.towards[cell] != cell {
            cell = self.towards[cell];
        }
        cell
    }

    /// Whether two cells are one, or free and connected.
    pub fn joins(&self, one: usize, other: usize) -> bool {
        one == other || !self.taken[one] && !self.taken[other] && self.of(one) == self.of(other)
    }

    /// How many cells the region of a free cell has.
    pub fn size(&self, cell: usize) -> usize {
        self.sizes[self.of(cell)]
    }

    /// The free cells next to some cells.
    pub fn next_to<'b>(&'b self, cells: &'b [usize]) -> impl Iterator<Item = usize> + 'b {
        let around = cells.iter().flat_map(|&cell| self.arena.neighbours(cell));
        around.filter(|&cell| !self.taken[cell])
    }

    /// A cell of the largest region; of equal ones the region of the first cell. None if no cell is free.
    pub fn largest(&self) -> Option<usize> {
        let free = (0..self.taken.len()).filter(|&cell| !self.taken[cell]);
        free.max_by_key(|&cell| (self.size(cell), std::cmp::Reverse(cell)))
    }
}
