//! Target swapping: single modules go to their goals at the same time, and swap goals instead of passing each other.
//!
//! After TSWAP (Okumura and Défago, Artificial Intelligence 2023), for bodies that enter a cell only once its last user has left
//! it. Each module goes along a shortest way. If another one is on it, the two swap goals where that makes the sum of what is left of
//! all ways less, or for equal sums the sum of squares: so one at rest goes on in place of one that would have to pass it.
//! Where modules wait for each other in a circle, their goals move on by one. Each of these makes one of the sums less and none makes
//! the first one more, so all modules come to rest as long as ways lead to their goals.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use super::lattice::{Arena, Time};
use super::schedule::NO_UNIT;

/// The most entries of the tables of distances.
const DISTANCES_MAX: usize = 60_000_000;

/// A distance where no way leads.
const UNREACHABLE: u16 = u16::MAX;

/// A module steps to a cell.
pub(super) type Move = (usize, usize);

/// The distances of all cells from some goals along open cells.
enum Distances {
    /// Nothing is in between.
    Open,
    /// For each cell, from the goal of that number.
    Around(Vec<Vec<u16>>),
}

/// Modules on their way to goals; both by position.
pub(super) struct TargetSwapping<'a> {
    arena: &'a Arena,
    /// Where each module is.
    places: Vec<usize>,
    /// The goal of each module, as a number.
    goal_of: Vec<usize>,
    /// The cell of each goal.
    goals: Vec<usize>,
    /// Which module is on each cell.
    standing: Vec<usize>,
    /// The last round in which a module left each cell.
    left_in: Vec<Time>,
    round: Time,
    distances: Distances,
}

impl<'a> TargetSwapping<'a> {
    /// Modules at places with goals; `None` if two share one, if no way leads to some goal, or if the field is too large.
    pub fn of(
        arena: &'a Arena,
        closed: &[bool],
        places: &[usize],
        goals: &[usize],
    ) -> Option<Self> {
        if !(are_distinct(places) && are_distinct(goals)) {
            return None;
        }
        let mut standing = vec![NO_UNIT; arena.area()];
        for (module, &cell) in places.iter().enumerate() {
            standing[cell] = module;
        }
        let all = Self {
            arena,
            distances: distances(arena, closed, goals)?,
            goal_of: (0..goals.len()).collect(),
            goals: goals.to_vec(),
            places: places.to_vec(),
            standing,
            left_in: vec![0; arena.area()],
            round: 0,
        };
        let mut modules = 0..all.places.len();
        modules
            .all(|module| all.left_of(module) < Time::from(UNREACHABLE))
            .then_some(all)
    }

    /// The moves in order, and the goal on which each module comes to rest; the goals keep their numbers.
    pub fn run(mut self) -> (Vec<Move>, Vec<usize>) {
        let mut moves = Vec::new();
        loop {
            let mut waiting: Vec<usize> = (0..self.places.len())
                .filter(|&module| self.left_of(module) > 0)
                .collect();
            if waiting.is_empty() {
                return (moves, self.goal_of);
            }
            waiting.sort_unstable_by_key(|&module| (Reverse(self.left_of(module)), module));
            self.round += 1;
            let mut has_changed = false;
            for &module in &waiting {
                has_changed |= self.advance(module, &mut moves);
            }
            if !has_changed && !self.rotate(&waiting) {
                debug_assert!(false, "some modules wait for each other in a circle");
                return (moves, self.goal_of);
            }
        }
    }

    /// The steps from a cell to a goal.
    fn distance(&self, cell: usize, goal: usize) -> Time {
        match &self.distances {
            Distances::Open => self.arena.distance(cell, self.goals[goal]),
            Distances::Around(all) => Time::from(all[goal][cell]),
        }
    }

    /// The steps that a module has left.
    fn left_of(&self, module: usize) -> Time {
        self.distance(self.places[module], self.goal_of[module])
    }

    /// The cells next to a module that are nearer to its goal.
    fn nearer(&self, module: usize) -> impl Iterator<Item = usize> + '_ {
        let (left, goal) = (self.left_of(module), self.goal_of[module]);
        let next = self.arena.neighbours(self.places[module]);
        next.filter(move |&cell| self.distance(cell, goal) < left)
    }

    /// A module steps, or swaps goals until it can step; whether any of the two was done.
    fn advance(&mut self, module: usize, moves: &mut Vec<Move>) -> bool {
        let mut has_changed = false;
        while self.left_of(module) > 0 {
            if let Some(cell) = self.free_step(module) {
                let from = self.places[module];
                self.standing[from] = NO_UNIT;
                self.left_in[from] = self.round;
                self.standing[cell] = module;
                self.places[module] = cell;
                moves.push((module, cell));
                return true;
            }
            let others = self.nearer(module).map(|cell| self.standing[cell]);
            let gains = others
                .filter(|&other| other != NO_UNIT)
                .filter_map(|other| Some((self.gain(module, other)?, Reverse(other))));
            let Some((_, Reverse(other))) = gains.max() else {
                break;
            };
            self.goal_of.swap(module, other);
            has_changed = true;
        }
        has_changed
    }

    /// The free cell to which a module steps: along the axis on which it has more left.
    fn free_step(&self, module: usize) -> Option<usize> {
        let is_free =
            |&cell: &usize| self.standing[cell] == NO_UNIT && self.left_in[cell] != self.round;
        let goal = self.arena.site(self.goals[self.goal_of[module]]);
        let rest = |cell: usize| {
            let (x, y) = self.arena.site(cell);
            (goal.0 - x).abs().max((goal.1 - y).abs())
        };
        let free = self.nearer(module).filter(is_free);
        free.min_by_key(|&cell| (rest(cell), cell))
    }

    /// By how much the sum of what two modules have left, and of the squares, gets less if they swap goals.
    fn gain(&self, one: usize, other: usize) -> Option<(i64, i64)> {
        let left = |module: usize, goal: usize| {
            i64::from(self.distance(self.places[module], self.goal_of[goal]))
        };
        let before = [left(one, one), left(other, other)];
        let after = [left(one, other), left(other, one)];
        let sum = |both: [i64; 2]| both[0] + both[1];
        let squares = |both: [i64; 2]| both[0] * both[0] + both[1] * both[1];
        let gain = (sum(before) - sum(after), squares(before) - squares(after));
        (gain > (0, 0)).then_some(gain)
    }

    /// Moves on the goals of modules that wait for each other in a circle: each gets the one of the module that waits for it.
    fn rotate(&mut self, waiting: &[usize]) -> bool {
        let ahead = |module: usize| self.nearer(module).map(|cell| self.standing[cell]).next();
        let mut seen = vec![false; self.places.len()];
        let mut module = waiting[0];
        while !seen[module] {
            seen[module] = true;
            match ahead(module) {
                Some(next) if next != NO_UNIT => module = next,
                _ => return false,
            }
        }
        let mut circle = vec![module];
        let mut next = ahead(module);
        while let Some(other) = next.filter(|&other| other != module) {
            circle.push(other);
            next = ahead(other);
        }
        let last = self.goal_of[circle[circle.len() - 1]];
        for index in (1..circle.len()).rev() {
            self.goal_of[circle[index]] = self.goal_of[circle[index - 1]];
        }
        self.goal_of[circle[0]] = last;
        true
    }
}

fn are_distinct(cells: &[usize]) -> bool {
    let distinct: BTreeSet<usize> = cells.iter().copied().collect();
    distinct.len() == cells.len()
}

/// The distances from all goals; `None` if the tables would be too large.
fn distances(arena: &Arena, closed: &[bool], goals: &[usize]) -> Option<Distances> {
    if arena.is_open(closed) {
        return Some(Distances::Open);
    }
    if goals.len().saturating_mul(arena.area()) > DISTANCES_MAX {
        return None;
    }
    let around = |&goal: &usize| {
        let mut steps = vec![UNREACHABLE; arena.area()];
        let mut found = vec![goal];
        steps[goal] = 0;
        let mut next = 0;
        while let Some(&cell) = found.get(next) {
            next += 1;
            if steps[cell] + 1 == UNREACHABLE {
                continue;
            }
            for neighbour in arena.neighbours(cell) {
                if !closed[neighbour] && steps[neighbour] == UNREACHABLE {
                    steps[neighbour] = steps[cell] + 1;
                    found.push(neighbour);
                }
            }
        }
        steps
    };
    Some(Distances::Around(goals.iter().map(around).collect()))
}
