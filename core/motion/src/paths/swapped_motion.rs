//! The motion of single modules that swap their targets on the way, as [`TargetSwapping`] moves them.
//!
//! Square modules that have to turn need the cells beside theirs for that. In a crowd there is no such room, so all spread first:
//! each goes to a cell of a lattice on which the places of turning modules are next to each other and do not overlap.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use formation_baselines::hungarian;
use formation_model::{MotionPlan, Variant};

use super::improve::improve;
use super::lattice::FOREVER;
use super::lattice_request::LatticeRequest;
use super::output::Draft;
use super::schedule::{Schedule, Scheduling};
use super::sipp::Entry;
use super::target_swapping::{Move, TargetSwapping};
use super::units::split;
use super::variants::Solution;

/// The most pairs of a module and a place where it may turn.
const PAIRS_MAX: usize = 2_000_000;

/// Moves of modules by position, and the new holder of each spot.
pub(super) struct Passage {
    /// To where all have room to turn.
    spreading: Vec<Move>,
    /// To the spots.
    gathering: Vec<Move>,
    pub holders: BTreeMap<usize, usize>,
}

impl LatticeRequest<'_> {
    /// How all modules get to the spots that are taken if they may swap them, all blocks taken apart; `None` where spots are off the
    /// lattice, no way leads to a spot, or there is no room to turn.
    pub fn passage(&self, closed: &[bool]) -> Option<Passage> {
        if self.resting.is_off.contains(&true) {
            return None;
        }
        let units = self.crew(&[]).units;
        let movers: Vec<usize> = (0..units.len())
            .filter(|&unit| !units[unit].stays)
            .collect();
        let places = movers
            .iter()
            .map(|&module| self.arena.cell(self.starts[module]));
        let mut places: Vec<usize> = places.collect::<Option<_>>()?;
        let spots: Vec<Option<usize>> = movers.iter().map(|&module| self.spot_of[module]).collect();
        let goals = self.goals(closed, &places, &spots)?;
        let swapping = |places: &[usize], goals: &[usize]| {
            TargetSwapping::of(&self.arena, closed, places, goals)
        };
        let mut spreading = Vec::new();
        // Whose goal each module has.
        let mut claims: Vec<usize> = (0..movers.len()).collect();
        if movers.iter().any(|&unit| units[unit].needs_room_to_turn()) {
            let turning = self.turning_places(closed, &places, &goals)?;
            (spreading, claims) = swapping(&places, &turning)?.run();
            places = claims.iter().map(|&claim| turning[claim]).collect();
        }
        let own: Vec<usize> = claims.iter().map(|&claim| goals[claim]).collect();
        let (gathering, reached) = swapping(&places, &own)?.run();
        let holders = movers
            .iter()
            .zip(&reached)
            .filter_map(|(&module, &goal)| Some((spots[claims[goal]]?, module)));
        let by_module = |moves: Vec<Move>| {
            let moves = moves.into_iter();
            moves.map(|(mover, cell)| (movers[mover], cell)).collect()
        };
        Some(Passage {
            holders: holders.collect(),
            spreading: by_module(spreading),
            gathering: by_module(gathering),
        })
    }

    /// A cell for each module: that of its spot, or where it is, or the next one that is no spot.
    fn goals(
        &self,
        closed: &[bool],
        places: &[usize],
        spots: &[Option<usize>],
    ) -> Option<Vec<usize>> {
        let cells = spots.iter().flatten();
        let cells = cells.map(|&spot| self.arena.cell(self.spots[spot]));
        let is_spot: BTreeSet<usize> = cells.collect::<Option<_>>()?;
        let surplus = places.iter().zip(spots).filter(|(_, spot)| spot.is_none());
        let mut taken = is_spot.clone();
        taken.extend(surplus.map(|(&cell, _)| cell));
        let mut goals = Vec::with_capacity(places.len());
        for (&place, spot) in places.iter().zip(spots) {
            let goal = match spot {
                Some(spot) => self.arena.cell(self.spots[*spot])?,
                None if !is_spot.contains(&place) => place,
                None => self.nearest_but(&taken, closed, place)?,
            };
            taken.insert(goal);
            goals.push(goal);
        }
        Some(goals)
    }

    /// The nearest cell that is not taken.
    fn nearest_but(&self, taken: &BTreeSet<usize>, closed: &[bool], from: usize) -> Option<usize> {
        let mut waiting = VecDeque::from([from]);
        let mut seen = BTreeSet::from([from]);
        while let Some(cell) = waiting.pop_front() {
            if !taken.contains(&cell) {
                return Some(cell);
            }
            for next in self.arena.neighbours(cell) {
                if !closed[next] && seen.insert(next) {
                    waiting.push_back(next);
                }
            }
        }
        None
    }

    /// A cell for each module on which it may turn beside the others, so that the ways over them to the goals are short.
    fn turning_places(
        &self,
        closed: &[bool],
        places: &[usize],
        goals: &[usize],
    ) -> Option<Vec<usize>> {
        let arena = &self.arena;
        let has_room = |&cell: &usize| {
            let (x, y) = arena.site(cell);
            (x + 2 * y).rem_euclid(5) == 0
                && !closed[cell]
                && arena.neighbours(cell).all(|next| !closed[next])
        };
        let way = |place: usize, cell: usize, goal: usize| {
            i64::from(arena.distance(place, cell) + arena.distance(cell, goal))
        };
        let rank = |cell: usize| {
            let ways = places.iter().zip(goals);
            let ways = ways.map(|(&place, &goal)| way(place, cell, goal));
            (ways.min(), cell)
        };
        let mut candidates: Vec<_> = (0..arena.area()).filter(has_room).map(rank).collect();
        candidates.sort_unstable();
        candidates.truncate(PAIRS_MAX / places.len());
        if candidates.len() < places.len() {
            return None;
        }
        let utilities = places.iter().zip(goals).map(|(&place, &goal)| {
            let ways = candidates.iter();
            let ways = ways.map(|&(_, cell)| way(place, cell, goal));
            ways.map(|way| -way * way).collect()
        });
        let chosen = hungarian::assign(&utilities.collect::<Vec<Vec<i64>>>());
        let cells = chosen.into_iter().map(|one| Some(candidates[one?].1));
        cells.collect()
    }

    /// The motion of a passage, each move as soon as the cell is free; `None` if a module has to turn and has no room for that, or
    /// another one stands where it goes.
    pub fn plan_passage(&self, passage: &Passage) -> Option<MotionPlan> {
        let crew = self.crew(&[]);
        let (ready, parameters) = (self.ready(), &self.request.parameters);
        let mut schedule = Schedule::new(
            &self.arena,
            &crew.units,
            &ready,
            Scheduling::SafeIntervals,
            parameters.expansions_max,
        );
        schedule.follow(&passage.spreading)?;
        for unit in 0..crew.units.len() {
            schedule.turn(unit)?;
        }
        schedule.follow(&passage.gathering)?;
        let order = schedule.by_arrival();
        // A plan that the budget leaves half improved is a plan.
        let _ = improve(&mut schedule, &order, parameters.improvement_passes);
        let solution = Solution {
            expansions: schedule.expansions(),
            schedule,
            variant: Variant::Swapping,
        };
        let draft = Draft {
            on_lattice: self,
            crew: &crew,
            solution: &solution,
            spent: 0,
        };
        Some(draft.plan())
    }
}

impl Schedule<'_> {
    /// Single modules make moves in this order, each as soon as it can; `None` if another one stands where one goes.
    fn follow(&mut self, moves: &[Move]) -> Option<()> {
        for &(unit, cell) in moves {
            let (layout, _) = split(self.arena, self.place(unit));
            self.enter(unit, layout * self.arena.area() + cell)?;
        }
        Some(())
    }

    /// A module turns where it is, if it has to; `None` if there is no room.
    fn turn(&mut self, unit: usize) -> Option<()> {
        let body = &self.units[unit];
        while body.goal.is_some() && !body.stays {
            let (layout, _) = split(self.arena, self.place(unit));
            if layout == body.last_on_lattice() {
                break;
            }
            let next = body.fold(self.arena, self.place(unit))?;
            let cells: Vec<usize> = body.cells(self.arena, next).collect();
            if self.first_other(unit, &cells).is_some() || cells.iter().any(|&it| self.solid[it]) {
                return None;
            }
            self.enter(unit, next)?;
        }
        Some(())
    }

    /// A unit steps into a node as soon as those before it have left; `None` if another one stands there.
    fn enter(&mut self, unit: usize, node: usize) -> Option<()> {
        let cells = self.units[unit].cells(self.arena, node);
        let free = cells.map(|cell| self.table.free_from(cell, unit)).max();
        let free = free.filter(|&free| free != FOREVER)?;
        let begin = free.max(self.since(unit));
        self.append(unit, &[Entry { node, begin }]);
        Some(())
    }

    /// The units that move, by when they arrive.
    pub fn by_arrival(&self) -> Vec<usize> {
        let moving = (0..self.units.len()).filter(|&unit| !self.units[unit].stays);
        let mut order: Vec<usize> = moving.collect();
        order.sort_unstable_by_key(|&unit| (self.since(unit), unit));
        order
    }
}
