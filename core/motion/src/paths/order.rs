//! The order in which units fill their spots, found by taking the finished formation apart.
//!
//! A unit may go if it gets out past the units that are left, to the side on which it starts. What may go now may go later, as
//! cells only become free; so this finds an order whenever there is one in which each unit goes straight to its spots. Where
//! there is none, a unit goes that gets out to another side: it has to be there before the others close the way. Reversed,
//! this is an order in which each unit has a way to its spots past those that are at rest. To which units it docks then does
//! not matter here: docking is apart from arrival.

use std::cmp::Reverse;

use super::exit::Exit;
use super::exits::ExitSearch;
use super::lattice::{Arena, Site};
use super::lattice_request::LatticeRequest;
use super::regions::Regions;
use super::route::{Errand, Routes, STEP};
use super::units::{Node, Unit, node_count, split};

/// Why the formation cannot be taken apart.
#[derive(Clone, Debug)]
pub(super) struct Stuck {
    /// The latest block that touches the outside, else the latest one: as single modules its members may get out.
    pub block: Option<usize>,
    /// The latest unit that is left.
    pub unit: usize,
}

/// The units in the order in which they fill their spots, and the exits of those whose spots are off the lattice.
pub(super) struct Filling {
    pub order: Vec<usize>,
    pub exits: Vec<Option<Exit>>,
}

/// What is taken apart.
pub(super) struct Formation<'a> {
    pub on_lattice: &'a LatticeRequest<'a>,
    pub arena: &'a Arena,
    pub units: &'a [Unit],
    /// The place of each unit in the acting order; units without a spot have none.
    pub ranks: &'a [Option<usize>],
    /// The lowest and the highest column and row of the target.
    pub target: (Site, Site),
}

impl Formation<'_> {
    /// The units with spots that are not pinned, in the order in which they fill them. Of those that can go, the latest in the
    /// acting order goes first.
    pub fn filling_order(&self) -> Result<Filling, Stuck> {
        let mut waiting: Vec<usize> = (0..self.units.len())
            .filter(|&unit| self.ranks[unit].is_some() && !self.units[unit].stays)
            .collect();
        waiting.sort_unstable_by_key(|&unit| (Reverse(self.ranks[unit]), unit));
        let mut rest = Rest::new(self);
        let mut removed = Vec::with_capacity(waiting.len());
        while !waiting.is_empty() {
            let Some(index) = rest.next(&waiting) else {
                let is_block = |&unit: &usize| self.units[unit].is_block();
                let blocks = || waiting.iter().copied().filter(is_block);
                let outer = blocks().find(|&unit| rest.touches_outside(unit));
                return Err(Stuck {
                    block: outer.or_else(|| blocks().next()),
                    unit: waiting[0],
                });
            };
            let unit = waiting.remove(index);
            rest.remove(unit);
            removed.push(unit);
        }
        removed.reverse();
        Ok(Filling {
            order: removed,
            exits: rest.exits,
        })
    }

    fn goal_cells(&self, unit: usize) -> Vec<usize> {
        if self.exits(unit) || self.units[unit].stays {
            return self.on_lattice.cells_at_rest(&self.units[unit]);
        }
        let goal = self.units[unit].goal;
        goal.map_or_else(Vec::new, |goal| {
            self.units[unit].cells(self.arena, goal).collect()
        })
    }

    fn exits(&self, unit: usize) -> bool {
        self.on_lattice.exits(&self.units[unit])
    }
}

/// What is left of the formation while it is taken apart.
struct Rest<'a> {
    formation: &'a Formation<'a>,
    /// Units that are left, and obstacles, take cells.
    regions: Regions<'a>,
    /// A cell of the region that was the largest at first: the outside.
    outside: Option<usize>,
    routes: Routes,
    seen: Vec<usize>,
    stamp: usize,
    /// The units that are left, by the cells that they take.
    holders: Vec<Vec<usize>>,
    exits: Vec<Option<Exit>>,
    /// Whether a unit had no exit when it was last tried, and nothing near it has gone since.
    is_shut_in: Vec<bool>,
}

impl<'a> Rest<'a> {
    fn new(formation: &'a Formation<'a>) -> Self {
        let arena = formation.arena;
        let mut taken = arena.closed.clone();
        let mut holders = vec![Vec::new(); arena.area()];
        for unit in 0..formation.units.len() {
            for cell in formation.goal_cells(unit) {
                taken[cell] = true;
                holders[cell].push(unit);
            }
        }
        let regions = Regions::new(arena, &taken);
        Self {
            formation,
            outside: regions.largest(),
            regions,
            routes: Routes::new(node_count(formation.units, arena)),
            seen: vec![0; arena.area()],
            stamp: 0,
            holders,
            exits: vec![None; formation.units.len()],
            is_shut_in: vec![false; formation.units.len()],
        }
    }

    fn remove(&mut self, unit: usize) {
        for cell in self.formation.goal_cells(unit) {
            self.holders[cell].retain(|&holder| holder != unit);
            if self.holders[cell].is_empty() {
                self.regions.free(cell);
            }
        }
        self.open_near(unit);
    }

    /// Units that had no exit may have one once a unit near them has gone.
    fn open_near(&mut self, unit: usize) {
        const NEAR: i64 = 8;
        let arena = self.formation.arena;
        let sites = |unit: usize| -> Vec<Site> {
            let cells = self.formation.goal_cells(unit);
            cells.into_iter().map(|cell| arena.site(cell)).collect()
        };
        let gone = sites(unit);
        for other in 0..self.is_shut_in.len() {
            let is_near = |one: &Site| {
                let mut gone = gone.iter();
                gone.any(|it| (it.0 - one.0).abs().max((it.1 - one.1).abs()) <= NEAR)
            };
            if self.is_shut_in[other] && sites(other).iter().any(is_near) {
                self.is_shut_in[other] = false;
            }
        }
    }

    /// The position of the unit that goes next: one that gets out to its own side, else one that stands on its spots already, else
    /// the single module that gets out to the largest region.
    fn next(&mut self, waiting: &[usize]) -> Option<usize> {
        let units = self.formation.units;
        let mut gets_out = waiting.iter().position(|&unit| self.gets_out(unit));
        if gets_out.is_none() && self.is_shut_in.contains(&true) {
            // One far away may have closed the way.
            self.is_shut_in.fill(false);
            gets_out = waiting.iter().position(|&unit| self.gets_out(unit));
        }
        let exits = |unit: usize| self.formation.exits(unit);
        let exits: Vec<bool> = waiting.iter().map(|&unit| exits(unit)).collect();
        let by_route = |rest: &mut Self| {
            let mut blocks = waiting.iter().zip(&exits);
            blocks
                .position(|(&unit, exits)| !exits && units[unit].is_block() && rest.has_route(unit))
        };
        let in_place = || {
            let mut all = waiting.iter().zip(&exits);
            all.position(|(&unit, exits)| !exits && units[unit].goal == Some(units[unit].start))
        };
        gets_out
            .or_else(|| by_route(self))
            .or_else(in_place)
            .or_else(|| self.next_to_largest(waiting))
            .or_else(|| waiting.iter().position(|&unit| self.finds_exit(unit, None)))
    }

    /// Whether an exit leads to the spots of a unit from a cell that a way connects with one in a region, or with any.
    fn finds_exit(&mut self, unit: usize, region: Option<usize>) -> bool {
        let formation = self.formation;
        let (arena, body) = (formation.arena, &formation.units[unit]);
        if !formation.exits(unit) || region.is_some() && self.is_shut_in[unit] {
            return false;
        }
        let search = ExitSearch {
            on_lattice: formation.on_lattice,
            units: formation.units,
        };
        let region = region.map(|cell| self.regions.of(cell));
        let exit = self.without(unit, |rest| {
            let holders = std::mem::take(&mut rest.holders);
            let exit = search.find(unit, &holders, |cell| {
                let node = body.last_on_lattice() * arena.area() + cell;
                if body.is_block() {
                    return rest.finds_way_out(unit, node);
                }
                region.is_none_or(|region| rest.leads_to(region, cell, unit, &holders))
            });
            rest.holders = holders;
            exit
        });
        self.is_shut_in[unit] = exit.is_none();
        self.exits[unit] = exit;
        self.exits[unit].is_some()
    }

    /// Whether a way connects a cell with a region, at most past cells that one unit alone takes.
    fn leads_to(&self, region: usize, cell: usize, unit: usize, holders: &[Vec<usize>]) -> bool {
        let arena = self.formation.arena;
        let is_own = |cell: usize| holders[cell].contains(&unit);
        if !is_own(cell) {
            return !self.regions.taken[cell] && self.regions.of(cell) == region;
        }
        let next = arena
            .neighbours(cell)
            .filter(|&next| !self.regions.taken[next]);
        let beyond = next.flat_map(|next| {
            arena
                .neighbours(next)
                .filter(move |_| is_own(next))
                .chain([next])
        });
        beyond.into_iter().any(|next| {
            !self.regions.taken[next] && !is_own(next) && self.regions.of(next) == region
        })
    }

    fn next_to_largest(&self, waiting: &[usize]) -> Option<usize> {
        let size = |unit: usize| {
            let cells = self.formation.goal_cells(unit);
            let free = self.regions.next_to(&cells);
            free.map(|cell| self.regions.size(cell)).max()
        };
        let singles = waiting.iter().enumerate();
        singles
            .filter(|&(_, &unit)| {
                !self.formation.units[unit].is_block() && !self.formation.exits(unit)
            })
            .filter_map(|(index, &unit)| Some((size(unit)?, Reverse(index))))
            .max()
            .map(|(_, Reverse(index))| index)
    }

    fn touches(&self, unit: usize, region: Option<usize>) -> bool {
        let Some(region) = region.map(|cell| self.regions.of(cell)) else {
            return false;
        };
        let cells = self.formation.goal_cells(unit);
        let mut free = self.regions.next_to(&cells);
        free.any(|cell| self.regions.of(cell) == region)
    }

    fn touches_outside(&self, unit: usize) -> bool {
        self.touches(unit, self.outside)
    }

    /// Whether a single module gets out to where it starts, or to the outside if it starts on a spot; or a block, as a rigid
    /// body, out of the target's box past what is left.
    fn gets_out(&mut self, unit: usize) -> bool {
        let formation = self.formation;
        let (arena, body) = (formation.arena, &formation.units[unit]);
        if formation.exits(unit) {
            let (_, start) = split(arena, body.start);
            let side = (!self.regions.taken[start]).then_some(start);
            return self.finds_exit(unit, side.or(self.outside));
        }
        if body.is_block() {
            return self.touches_outside(unit) && self.leaves_box(unit);
        }
        let (_, start) = split(arena, body.start);
        let side = (!self.regions.taken[start]).then_some(start);
        self.touches(unit, side.or(self.outside))
    }

    /// Frees the cells of a unit for a question.
    fn without<T>(&mut self, unit: usize, question: impl FnOnce(&mut Self) -> T) -> T {
        let mut own = self.formation.goal_cells(unit);
        own.retain(|&cell| self.holders[cell].len() == 1);
        for &cell in &own {
            self.regions.taken[cell] = false;
        }
        let answer = question(self);
        for &cell in &own {
            self.regions.taken[cell] = true;
        }
        answer
    }

    fn leaves_box(&mut self, unit: usize) -> bool {
        let body = &self.formation.units[unit];
        let (Some(goal), Some(_)) = (body.goal, body.layouts.last()) else {
            return false;
        };
        self.without(unit, |rest| rest.finds_way_out(unit, goal))
    }

    fn finds_way_out(&mut self, unit: usize, goal: Node) -> bool {
        let formation = self.formation;
        let arena = formation.arena;
        let Some(layout) = formation.units[unit].layouts.last() else {
            return false;
        };
        self.stamp += 1;
        let (_, start) = split(arena, goal);
        let mut waiting = vec![start];
        self.seen[start] = self.stamp;
        while let Some(cell) = waiting.pop() {
            let (low, high) = formation.target;
            let (x, y) = arena.site(cell);
            let sites = &layout.sites;
            if sites.iter().all(|site| x + site.0 < low.0)
                || sites.iter().all(|site| x + site.0 > high.0)
                || sites.iter().all(|site| y + site.1 < low.1)
                || sites.iter().all(|site| y + site.1 > high.1)
            {
                return true;
            }
            for (direction, next) in arena.neighbours(cell).enumerate() {
                let leading = &layout.leading[direction];
                if self.seen[next] != self.stamp
                    && leading
                        .iter()
                        .all(|&offset| !self.regions.taken[next.wrapping_add_signed(offset)])
                {
                    self.seen[next] = self.stamp;
                    waiting.push(next);
                }
            }
        }
        false
    }

    /// Whether a block gets from its start to its spots past what is left.
    fn has_route(&mut self, unit: usize) -> bool {
        let body = &self.formation.units[unit];
        let Some(goal) = body.goal else { return false };
        let errand = Errand {
            arena: self.formation.arena,
            unit: body,
            from: body.start,
            folds: true,
        };
        self.without(unit, |rest| {
            let taken = &rest.regions.taken;
            let cost = |cell: usize| (!taken[cell]).then_some(0);
            let distance = |node: Node| body.distance(errand.arena, node, goal) * STEP;
            let route = rest
                .routes
                .find(&errand, cost, distance, |node| node == goal);
            route.is_some()
        })
    }
}
