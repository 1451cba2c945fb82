//! The order in which units dock, found by taking the finished formation apart.
//!
//! A unit may go if that does not part what it is docked to and its target layout gets out, as a rigid body, past the
//! units that are left. The latest in the acting order goes first. Reversed, this is an order in which each unit docks
//! to a placed one and has a corridor.

use std::cmp::Reverse;

use super::lattice::{Arena, Site};
use super::units::{Unit, split};
use formation_model::{OrderKind, cut_nodes};

/// Units in the order in which they dock, pinned ones first.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub kind: OrderKind,
    /// Positions of units.
    pub sequence: Vec<usize>,
    /// For each unit its earliest neighbour in the sequence, if it docks to one.
    pub parents: Vec<Option<usize>>,
}

/// Why the formation cannot be taken apart.
#[derive(Clone, Debug)]
pub(super) struct Stuck {
    /// The latest block that touches the outside, else the latest one: as single modules its members may get out.
    pub block: Option<usize>,
    /// The latest unit that is left.
    pub unit: usize,
}

/// What is taken apart.
pub(super) struct Formation<'a> {
    pub arena: &'a Arena,
    pub units: &'a [Unit],
    /// The place of each unit in the acting order; units without a spot have none.
    pub ranks: &'a [Option<usize>],
    /// The units that share an edge of the target with each unit, ascending.
    pub by_edges: &'a [Vec<usize>],
    /// The lowest and the highest column and row of the target.
    pub target: (Site, Site),
}

impl Formation<'_> {
    /// An order by edges if there is one, else by adjacency; with the first unit of the acting order first if possible.
    pub fn order(&self) -> Result<Order, Stuck> {
        let adjacent = self.adjacency();
        let mut stuck = None;
        for (kind, neighbours) in [
            (OrderKind::Edges, self.by_edges),
            (OrderKind::Adjacency, adjacent.as_slice()),
        ] {
            for first_stays in [true, false] {
                match self.taken_apart(neighbours, first_stays) {
                    Ok(mut removed) => {
                        removed.reverse();
                        let pinned = (0..self.units.len()).filter(|&unit| self.units[unit].pinned);
                        let sequence: Vec<usize> = pinned.chain(removed).collect();
                        let parents = self.parents(&sequence, neighbours);
                        return Ok(Order {
                            kind,
                            sequence,
                            parents,
                        });
                    }
                    Err(found) => stuck = Some(found),
                }
            }
        }
        Err(stuck.unwrap_or(Stuck {
            block: None,
            unit: 0,
        }))
    }

    fn goal_cells(&self, unit: usize) -> Vec<usize> {
        let goal = self.units[unit].goal;
        goal.map_or_else(Vec::new, |goal| {
            self.units[unit].cells(self.arena, goal).collect()
        })
    }

    /// The units on adjacent cells of each unit's spots, ascending.
    fn adjacency(&self) -> Vec<Vec<usize>> {
        let mut holder = vec![None; self.arena.area()];
        for unit in 0..self.units.len() {
            for cell in self.goal_cells(unit) {
                holder[cell] = Some(unit);
            }
        }
        (0..self.units.len())
            .map(|unit| {
                let cells = self.goal_cells(unit);
                let mut neighbours: Vec<usize> = cells
                    .iter()
                    .flat_map(|&cell| self.arena.neighbours(cell).filter_map(|next| holder[next]))
                    .filter(|&other| other != unit)
                    .collect();
                neighbours.sort_unstable();
                neighbours.dedup();
                neighbours
            })
            .collect()
    }

    /// The neighbours of each unit with all pinned ones taken together as the first of them.
    fn with_one_anchor(&self, neighbours: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let anchor = (0..self.units.len()).find(|&unit| self.units[unit].pinned);
        let node = |unit: usize| match anchor {
            Some(anchor) if self.units[unit].pinned => anchor,
            _ => unit,
        };
        let mut joined = vec![Vec::new(); neighbours.len()];
        for (unit, others) in neighbours.iter().enumerate() {
            let others = others.iter().map(|&other| node(other));
            joined[node(unit)].extend(others.filter(|&other| other != node(unit)));
        }
        joined
    }

    fn parents(&self, sequence: &[usize], neighbours: &[Vec<usize>]) -> Vec<Option<usize>> {
        let mut rank = vec![usize::MAX; self.units.len()];
        for (index, &unit) in sequence.iter().enumerate() {
            rank[unit] = index;
        }
        let earliest = |unit: usize| {
            let before = neighbours[unit]
                .iter()
                .copied()
                .filter(|&other| rank[other] < rank[unit]);
            before.min_by_key(|&other| rank[other])
        };
        (0..self.units.len())
            .map(|unit| earliest(unit).filter(|_| !self.units[unit].pinned))
            .collect()
    }

    /// The units that are not pinned in the order in which they can go.
    fn taken_apart(
        &self,
        neighbours: &[Vec<usize>],
        first_stays: bool,
    ) -> Result<Vec<usize>, Stuck> {
        let mut waiting: Vec<usize> = (0..self.units.len())
            .filter(|&unit| self.ranks[unit].is_some() && !self.units[unit].pinned)
            .collect();
        waiting.sort_unstable_by_key(|&unit| (Reverse(self.ranks[unit]), unit));
        let has_pinned = self.units.iter().any(|unit| unit.pinned);
        let root = waiting
            .last()
            .copied()
            .filter(|_| first_stays && !has_pinned);
        let neighbours = self.with_one_anchor(neighbours);
        let mut rest = Rest::new(self);
        let mut removed = Vec::with_capacity(waiting.len());
        while !waiting.is_empty() {
            let cut = rest.cut_units(&neighbours);
            let may_go = |unit: usize| !cut[unit] && (waiting.len() == 1 || root != Some(unit));
            let gets_out = |&unit: &usize| may_go(unit) && rest.gets_out(unit);
            let mut free = waiting.iter().position(gets_out);
            if free.is_none() {
                // After a halt, a single module may stand behind those that have docked.
                let is_in_pocket = |&unit: &usize| may_go(unit) && rest.is_in_pocket(unit);
                free = waiting.iter().position(is_in_pocket);
            }
            let Some(index) = free else {
                let is_block = |&unit: &usize| self.units[unit].is_block();
                let blocks = || waiting.iter().copied().filter(is_block);
                let outer = blocks().find(|&unit| rest.touches_outside(unit));
                let block = outer.or_else(|| blocks().next());
                return Err(Stuck {
                    block,
                    unit: waiting[0],
                });
            };
            let unit = waiting.remove(index);
            rest.remove(unit);
            removed.push(unit);
        }
        Ok(removed)
    }
}

/// What is left of the formation while it is taken apart.
struct Rest<'a> {
    formation: &'a Formation<'a>,
    is_left: Vec<bool>,
    /// Whether a unit that is left, or an obstacle, is on the cell.
    taken: Vec<bool>,
    /// Whether the cell is connected to the outside.
    open: Vec<bool>,
    /// Whether it would be if only pinned units were left.
    open_past_pinned: Vec<bool>,
    seen: Vec<usize>,
    stamp: usize,
}

impl<'a> Rest<'a> {
    fn new(formation: &'a Formation<'a>) -> Self {
        let mut taken = formation.arena.closed.clone();
        let is_left = formation.units.iter().map(|unit| unit.goal.is_some());
        let is_left: Vec<bool> = is_left.collect();
        for cell in (0..is_left.len()).flat_map(|unit| formation.goal_cells(unit)) {
            taken[cell] = true;
        }
        let open = largest_region(formation.arena, &taken);
        let mut pinned = formation.arena.closed.clone();
        for unit in (0..is_left.len()).filter(|&unit| formation.units[unit].pinned) {
            for cell in formation.goal_cells(unit) {
                pinned[cell] = true;
            }
        }
        Self {
            formation,
            is_left,
            open,
            open_past_pinned: largest_region(formation.arena, &pinned),
            seen: vec![0; taken.len()],
            stamp: 0,
            taken,
        }
    }

    fn remove(&mut self, unit: usize) {
        self.is_left[unit] = false;
        let cells = self.formation.goal_cells(unit);
        for &cell in &cells {
            self.taken[cell] = false;
        }
        let arena = self.formation.arena;
        let mut waiting: Vec<usize> = cells
            .into_iter()
            .filter(|&cell| arena.neighbours(cell).any(|next| self.open[next]))
            .collect();
        while let Some(cell) = waiting.pop() {
            if !self.open[cell] {
                self.open[cell] = true;
                let around = arena.neighbours(cell);
                waiting.extend(around.filter(|&next| !self.open[next] && !self.taken[next]));
            }
        }
    }

    fn touches_outside(&self, unit: usize) -> bool {
        let cells = self.formation.goal_cells(unit);
        let arena = self.formation.arena;
        cells
            .iter()
            .any(|&cell| arena.neighbours(cell).any(|next| self.open[next]))
    }

    /// Whether the unit, as a rigid body, can leave the target's box past what is left.
    fn gets_out(&mut self, unit: usize) -> bool {
        if !self.touches_outside(unit) {
            return false;
        }
        let formation = self.formation;
        let (arena, body) = (formation.arena, &formation.units[unit]);
        let (Some(goal), Some(layout)) = (body.goal, body.layouts.last()) else {
            return false;
        };
        if !body.is_block() {
            return true;
        }
        let own = formation.goal_cells(unit);
        for &cell in &own {
            self.taken[cell] = false;
        }
        self.stamp += 1;
        let (_, start) = split(arena, goal);
        let mut waiting = vec![start];
        self.seen[start] = self.stamp;
        let mut is_out = false;
        while let Some(cell) = waiting.pop() {
            let (low, high) = formation.target;
            let (x, y) = arena.site(cell);
            let sites = &layout.sites;
            if sites.iter().all(|site| x + site.0 < low.0)
                || sites.iter().all(|site| x + site.0 > high.0)
                || sites.iter().all(|site| y + site.1 < low.1)
                || sites.iter().all(|site| y + site.1 > high.1)
            {
                is_out = true;
                break;
            }
            for (direction, next) in arena.neighbours(cell).enumerate() {
                let leading = &layout.leading[direction];
                if self.seen[next] != self.stamp
                    && leading
                        .iter()
                        .all(|&offset| !self.taken[next.wrapping_add_signed(offset)])
                {
                    self.seen[next] = self.stamp;
                    waiting.push(next);
                }
            }
        }
        for &cell in &own {
            self.taken[cell] = true;
        }
        is_out
    }

    /// Whether a single module and its spot are in one pocket that pinned units close.
    fn is_in_pocket(&self, unit: usize) -> bool {
        let formation = self.formation;
        let (arena, body) = (formation.arena, &formation.units[unit]);
        let goal = formation.goal_cells(unit);
        if body.is_block() || goal.iter().any(|&cell| self.open_past_pinned[cell]) {
            return false;
        }
        let pocket = arena.flood(goal, &mut self.taken.clone());
        pocket.contains(&split(arena, body.start).1)
    }

    /// Which units would part what is left if they went.
    fn cut_units(&self, neighbours: &[Vec<usize>]) -> Vec<bool> {
        cut_nodes(
            self.is_left.len(),
            |unit| self.is_left[unit],
            |unit, index| neighbours[unit].get(index).copied(),
        )
    }
}

/// The cells of the largest connected region that is not taken; of equal ones the first.
fn largest_region(arena: &Arena, taken: &[bool]) -> Vec<bool> {
    let mut is_shut = taken.to_vec();
    let mut largest = Vec::new();
    for start in 0..taken.len() {
        if !is_shut[start] {
            let region = arena.flood(vec![start], &mut is_shut);
            if region.len() > largest.len() {
                largest = region;
            }
        }
    }
    let mut is_largest = vec![false; taken.len()];
    for cell in largest {
        is_largest[cell] = true;
    }
    is_largest
}
