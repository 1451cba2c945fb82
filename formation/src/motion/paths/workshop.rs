//! From a request to a motion plan: units, order, paths; blocks that do not get in are taken apart.

use std::collections::BTreeSet;

use super::diagnose::{Names, obstruction, region};
use super::field::{Failure, NO_UNIT};
use super::group::{Group, Phase};
use super::lattice::{Arena, Lattice, Site, Time, bounds};
use super::order::Formation;
use super::output;
use super::result::{Area, MotionError, MotionPlan, MotionRequest, Obstruction};
use super::start::{StartFault, align};
use super::units::Unit;
use super::variants::Ground;
use super::waits::aligners;
use crate::model::{ModuleId, Pose, SpotId};

/// After this many tries to plan with blocks, all are taken apart.
const TRIES_MAX: usize = 12;
/// How much wider the arena is on each side if there are blocks.
const BLOCK_MARGIN: i64 = 8;

/// All that does not depend on which blocks are taken apart.
pub(super) struct Workshop<'a> {
    pub request: &'a MotionRequest<'a>,
    pub lattice: Lattice,
    /// The cell of each spot.
    pub spots: Vec<Site>,
    /// The spot of each module, by positions.
    pub spot_of: Vec<Option<usize>>,
    pub groups: Vec<Group>,
    /// The group of each module.
    pub group_of: Vec<usize>,
    /// The cell of each module at the start.
    pub starts: Vec<Site>,
    pub arena: Arena,
    /// The groups that sweep each cell on their way onto the lattice.
    pub aligners: Vec<Vec<usize>>,
}

/// What comes of an attempt to plan.
enum Attempt {
    Solved(Box<MotionPlan>),
    /// These blocks do not get to their spots; none if single modules among blocks do not.
    Blamed(Vec<usize>),
}

/// Units and their places in the acting order.
pub(super) struct Crew {
    pub units: Vec<Unit>,
    ranks: Vec<Option<usize>>,
    by_edges: Vec<Vec<usize>>,
}

impl<'a> Workshop<'a> {
    /// Checks target and starts.
    pub fn new(request: &'a MotionRequest<'a>) -> Result<Self, MotionError> {
        let problem = request.problem;
        let (lattice, spots) = Lattice::of(problem.target(), request.parameters.tolerance)?;
        let target = problem.target();
        let spot_of: Vec<Option<usize>> = problem
            .modules()
            .iter()
            .map(|module| {
                let spot = module
                    .pin
                    .or(request.plan.assignments.get(&module.id).copied());
                spot.and_then(|spot| target.position_of(spot))
            })
            .collect();
        let pose_of = |module: usize| spot_of[module].map(|spot| target.spots()[spot].pose);
        let whole = |modules: &[usize]| -> Option<Vec<Pose>> {
            let ids: Vec<ModuleId> = modules
                .iter()
                .map(|&module| problem.modules()[module].id)
                .collect();
            let is_unit = modules.len() == 1 || request.plan.blocks.contains(&ids);
            modules
                .iter()
                .map(|&module| pose_of(module).filter(|_| is_unit))
                .collect()
        };
        let tolerance = request.parameters.tolerance;
        let groups = align(problem, &lattice, tolerance, whole).map_err(MotionError::Starts)?;
        let mut group_of = vec![0; problem.modules().len()];
        let mut starts = vec![(0, 0); problem.modules().len()];
        for (index, group) in groups.iter().enumerate() {
            for (member, &module) in group.modules.iter().enumerate() {
                group_of[module] = index;
                starts[module] = group.site_of(member);
            }
        }
        let all: Vec<Site> = spots.iter().chain(&starts).copied().collect();
        let margin = if request.plan.blocks.is_empty() {
            0
        } else {
            BLOCK_MARGIN
        };
        let arena = Arena::around(&lattice, &all, margin, request.obstacles, request.walls)?;
        let workshop = Self {
            request,
            aligners: aligners(&groups, &lattice, &arena),
            lattice,
            spots,
            spot_of,
            groups,
            group_of,
            starts,
            arena,
        };
        workshop.check_cover()?;
        Ok(workshop)
    }

    fn is_closed(&self, site: Site) -> bool {
        self.arena
            .cell(site)
            .is_none_or(|cell| self.arena.closed[cell])
    }

    /// No module may start on a closed cell or reach into an obstacle on its way onto the lattice, and no spot that is
    /// taken may be closed.
    fn check_cover(&self) -> Result<(), MotionError> {
        let problem = self.request.problem;
        let corners = |area: &Area| ((area.low.0.0, area.low.1.0), (area.high.0.0, area.high.1.0));
        let meets = |(low, high): ((i64, i64), (i64, i64))| {
            let inside = |area: &Area| {
                let (from, to) = corners(area);
                low.0 < to.0 && from.0 < high.0 && low.1 < to.1 && from.1 < high.1
            };
            self.request.obstacles.iter().any(inside)
                || self.request.walls.iter().any(|walls| {
                    let (from, to) = corners(walls);
                    low.0 < from.0 || low.1 < from.1 || high.0 > to.0 || high.1 > to.1
                })
        };
        let mut covered = BTreeSet::new();
        for group in &self.groups {
            let phases = [Phase::Turn, Phase::Column, Phase::Row];
            let reaches = phases
                .into_iter()
                .flat_map(|phase| group.swept(phase))
                .any(meets);
            for &module in &group.modules {
                if reaches || self.is_closed(self.starts[module]) {
                    covered.insert(problem.modules()[module].id);
                }
            }
        }
        if !covered.is_empty() {
            let faults = covered.into_iter().map(StartFault::Covered).collect();
            return Err(MotionError::Starts(faults));
        }
        let mut taken = self.spot_of.iter().flatten();
        match taken.find(|&&spot| self.is_closed(self.spots[spot])) {
            Some(&spot) => Err(MotionError::CoveredSpot(problem.target().spots()[spot].id)),
            None => Ok(()),
        }
    }

    /// Plans; takes blocks apart until all units get to their spots.
    pub fn plan(&self) -> Result<MotionPlan, MotionError> {
        let blocks = &self.request.plan.blocks;
        let mut apart = vec![false; blocks.len()];
        let taken: Vec<Site> = self
            .spot_of
            .iter()
            .flatten()
            .map(|&spot| self.spots[spot])
            .collect();
        let target = if taken.is_empty() {
            bounds(&self.spots)
        } else {
            bounds(&taken)
        };
        let ready = self.ready();
        let mut spent = 0;
        let mut attempt = 0;
        loop {
            let crew = self.crew(&apart);
            let blamed = match self.attempt(&crew, target, &ready, &mut spent)? {
                Attempt::Blamed(blamed) => blamed,
                Attempt::Solved(mut plan) => {
                    let names = blocks.iter().zip(&apart).filter(|(_, apart)| **apart);
                    plan.taken_apart = names.map(|(block, _)| block.clone()).collect();
                    return Ok(*plan);
                }
            };
            // Each round takes a block apart, and without blocks an attempt solves or fails.
            self.take_apart(&crew, &blamed, attempt, &mut apart);
            attempt += 1;
        }
    }

    /// Orders and plans the units.
    fn attempt(
        &self,
        crew: &Crew,
        target: (Site, Site),
        ready: &[Time],
        spent: &mut u64,
    ) -> Result<Attempt, MotionError> {
        let formation = Formation {
            arena: &self.arena,
            units: &crew.units,
            ranks: &crew.ranks,
            by_edges: &crew.by_edges,
            target,
        };
        let order = match formation.order() {
            Ok(order) => order,
            Err(stuck) => {
                let block = stuck
                    .block
                    .ok_or_else(|| self.walled_in(crew, stuck.unit))?;
                return Ok(Attempt::Blamed(vec![block]));
            }
        };
        let mut parameters = self.request.parameters;
        parameters.expansions_max = parameters.expansions_max.saturating_sub(*spent);
        let ground = Ground {
            arena: &self.arena,
            units: &crew.units,
            ready,
            order: &order,
            target,
            parameters: &parameters,
        };
        match ground.solve() {
            Ok(solution) => {
                let draft = output::Draft {
                    workshop: self,
                    order: &order,
                    solution: &solution,
                    spent: *spent,
                };
                Ok(Attempt::Solved(Box::new(draft.plan())))
            }
            Err(failed) => {
                let (field, failure) = *failed;
                *spent += field.expansions();
                if crew.units.iter().all(|unit| !unit.is_block()) {
                    return Err(self.unreachable(crew, &failure, &field));
                }
                let units = [Some(failure.unit), failure.in_the_way]
                    .into_iter()
                    .flatten();
                let blocks = units.filter(|&unit| crew.units[unit].is_block());
                Ok(Attempt::Blamed(blocks.collect()))
            }
        }
    }

    fn take_apart(&self, crew: &Crew, blamed: &[usize], attempt: usize, apart: &mut [bool]) {
        let before = apart.iter().filter(|&&is_apart| is_apart).count();
        for &unit in blamed {
            let lead = self.request.problem.modules()[crew.units[unit].modules[0]].id;
            for (index, block) in self.request.plan.blocks.iter().enumerate() {
                apart[index] |= block.contains(&lead);
            }
        }
        let after = apart.iter().filter(|&&is_apart| is_apart).count();
        if attempt + 1 >= TRIES_MAX || after == before {
            apart.fill(true);
        }
    }

    /// When a step into each cell may begin.
    fn ready(&self) -> Vec<Time> {
        let latest =
            |groups: &Vec<usize>| groups.iter().map(|&group| self.groups[group].ready()).max();
        self.aligners
            .iter()
            .map(|groups| latest(groups).unwrap_or_default())
            .collect()
    }

    /// The units: the blocks that are not taken apart, and single modules.
    fn crew(&self, apart: &[bool]) -> Crew {
        let problem = self.request.problem;
        let mut partition: Vec<Vec<usize>> = Vec::new();
        let mut is_placed = vec![false; self.starts.len()];
        for (block, _) in self
            .request
            .plan
            .blocks
            .iter()
            .zip(apart)
            .filter(|(_, apart)| !**apart)
        {
            let modules: Vec<usize> = block
                .iter()
                .filter_map(|&module| problem.position_of(module))
                .collect();
            let is_free = |&module: &usize| {
                problem.modules()[module].pin.is_none() && self.spot_of[module].is_some()
            };
            if modules.len() == block.len() && modules.iter().all(is_free) {
                for &module in &modules {
                    is_placed[module] = true;
                }
                partition.push(modules);
            }
        }
        partition.extend(
            (0..is_placed.len())
                .filter(|&module| !is_placed[module])
                .map(|module| vec![module]),
        );
        partition.sort_unstable();
        let units: Vec<Unit> = partition
            .into_iter()
            .map(|modules| self.unit(modules))
            .collect();
        let mut unit_at = vec![NO_UNIT; self.spots.len()];
        for (index, unit) in units.iter().enumerate() {
            for spot in unit
                .modules
                .iter()
                .filter_map(|&module| self.spot_of[module])
            {
                unit_at[spot] = index;
            }
        }
        let topology = problem.target().topology();
        let by_edges = units.iter().enumerate().map(|(index, unit)| {
            let spots = unit
                .modules
                .iter()
                .filter_map(|&module| self.spot_of[module]);
            let mut neighbours: Vec<usize> = spots
                .flat_map(|spot| topology.neighbours(spot).iter().map(|&next| unit_at[next]))
                .filter(|&other| other != NO_UNIT && other != index)
                .collect();
            neighbours.sort_unstable();
            neighbours.dedup();
            neighbours
        });
        Crew {
            by_edges: by_edges.collect(),
            ranks: self.ranks(&units),
            units,
        }
    }

    fn unit(&self, modules: Vec<usize>) -> Unit {
        let starts: Vec<Site> = modules.iter().map(|&module| self.starts[module]).collect();
        let goals: Option<Vec<Site>> = modules
            .iter()
            .map(|&module| self.spot_of[module].map(|spot| self.spots[spot]))
            .collect();
        let first = modules[0];
        let mut unit = Unit::new(modules, &starts, goals.as_deref(), &self.arena);
        unit.ready = self.groups[self.group_of[first]].ready();
        unit.pinned = self.request.problem.modules()[first].pin.is_some();
        unit
    }

    /// The place of each unit with a spot in the plan's acting order; units that the order leaves out come last.
    fn ranks(&self, units: &[Unit]) -> Vec<Option<usize>> {
        let problem = self.request.problem;
        let mut rank_of = vec![usize::MAX; self.starts.len()];
        let acting = self.request.plan.assembly.units.iter();
        let placed = acting.flat_map(|unit| unit.placements.iter().map(|&(module, _)| module));
        for (rank, module) in placed.enumerate() {
            if let Some(module) = problem.position_of(module) {
                rank_of[module] = rank;
            }
        }
        let first = |unit: &Unit| unit.modules.iter().map(|&module| rank_of[module]).min();
        units
            .iter()
            .map(|unit| unit.goal.and_then(|_| first(unit)))
            .collect()
    }

    fn spot_at(&self, cell: usize) -> Option<SpotId> {
        let site = self.arena.site(cell);
        let spot = self.spots.iter().position(|&spot| spot == site)?;
        Some(self.request.problem.target().spots()[spot].id)
    }

    fn unreachable_unit(&self, unit: &Unit, reason: Obstruction) -> MotionError {
        let problem = self.request.problem;
        let spots = unit
            .modules
            .iter()
            .filter_map(|&module| self.spot_of[module]);
        MotionError::Unreachable {
            modules: unit
                .modules
                .iter()
                .map(|&module| problem.modules()[module].id)
                .collect(),
            spots: spots
                .map(|spot| problem.target().spots()[spot].id)
                .collect(),
            reason,
        }
    }

    fn unreachable(
        &self,
        crew: &Crew,
        failure: &Failure,
        field: &super::field::Field,
    ) -> MotionError {
        let names = Names {
            module_of: &|module| self.request.problem.modules()[module].id,
            spot_at: &|cell| self.spot_at(cell),
        };
        let reason = obstruction(field, failure, &names);
        self.unreachable_unit(&crew.units[failure.unit], reason)
    }

    /// A unit that no order leaves a corridor.
    fn walled_in(&self, crew: &Crew, unit: usize) -> MotionError {
        let unit = &crew.units[unit];
        let own: Vec<usize> = unit
            .goal
            .map_or_else(Vec::new, |goal| unit.cells(&self.arena, goal).collect());
        let reachable = region(&self.arena, &self.arena.closed, &own);
        let mut starts = unit.cells(&self.arena, unit.start);
        if !starts.all(|cell| reachable.contains(&cell)) {
            return self.unreachable_unit(unit, Obstruction::Obstacles);
        }
        let around = own.iter().flat_map(|&cell| self.arena.neighbours(cell));
        let mut walls: Vec<SpotId> = around
            .filter(|cell| !own.contains(cell))
            .filter_map(|cell| self.spot_at(cell))
            .collect();
        walls.sort_unstable();
        walls.dedup();
        self.unreachable_unit(unit, Obstruction::WalledIn(walls))
    }
}
