//! The request on the lattice: the groups on their way onto it, the arena, and the units.

use std::collections::BTreeSet;

use super::group::{Group, Phase};
use super::lattice::{Arena, Lattice, Site, Time};
use super::rectangle::{bounds, overlap};
use super::resting::{AtRest, Form, RestingBodies, cells_under, rigid_cells};
use super::result::{MotionError, MotionRequest, StartFault};
use super::schedule::NO_UNIT;
use super::shape::Shape;
use super::start::align;
use super::units::{Unit, split};
use super::waits::aligners;
use formation_model::turning::{Point, quarters};
use formation_model::{Area, ModuleId, Pose, Surroundings};

/// Paths lead around what lies this many cells or fewer from the starts and spots.
const DETOUR: i64 = 64;

/// The corners of the obstacles near some cells: the arena holds what leads around them.
fn corners_near(sites: &[Site], lattice: &Lattice, surroundings: &Surroundings) -> Vec<Site> {
    let (low, high) = bounds(sites);
    let (low, high) = (
        (low.0 - DETOUR, low.1 - DETOUR),
        (high.0 + DETOUR, high.1 + DETOUR),
    );
    let corners = surroundings.obstacles().iter().flat_map(|area| {
        let (from, to) = area.corners();
        let (first, last) = lattice.covered(from, to);
        let first = (first.0.max(low.0), first.1.max(low.1));
        let last = (last.0.min(high.0), last.1.min(high.1));
        let is_near = first.0 <= last.0 && first.1 <= last.1;
        is_near.then_some([first, last]).into_iter().flatten()
    });
    corners.collect()
}

/// How much wider the arena is on each side if there are blocks.
const BLOCK_MARGIN: i64 = 8;

/// All that does not depend on which blocks are taken apart.
pub(super) struct LatticeRequest<'a> {
    pub request: &'a MotionRequest<'a>,
    pub lattice: Lattice,
    /// The cell of each spot, or under it.
    pub spots: Vec<Site>,
    /// How bodies rest on the spots.
    pub resting: RestingBodies,
    /// Which modules stand on their spots off the lattice and are not pinned.
    stands: Vec<bool>,
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

/// Units and their places in the acting order.
pub(super) struct Crew {
    pub units: Vec<Unit>,
    /// The place of each unit in the acting order; units without a spot have none.
    pub ranks: Vec<Option<usize>>,
    /// Units with spots by position, in the order in which they dock: the acting order.
    pub docking: Vec<usize>,
    /// The unit to which each unit docks: of those next to it in the target, the first that docks before it.
    pub parents: Vec<Option<usize>>,
}

impl<'a> LatticeRequest<'a> {
    /// Checks target and starts.
    pub fn new(request: &'a MotionRequest<'a>) -> Result<Self, MotionError> {
        Self::with_room(request, 0)
    }

    /// The same, with an arena that is wider by some cells on each side.
    pub fn with_room(request: &'a MotionRequest<'a>, room: i64) -> Result<Self, MotionError> {
        let problem = request.problem;
        let target = problem.target();
        let (lattice, spots, is_off) = Lattice::of(target, request.parameters.tolerance);
        let form = Form::of(target, request.parameters.tolerance);
        let resting = RestingBodies::of(target, &lattice, &spots, is_off, form)?;
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
        let stands = resting.standing(problem, &spot_of);
        let rest = AtRest {
            bodies: &resting,
            stands: &stands,
        };
        let groups = align(request, &lattice, &rest, whole);
        let groups = groups.map_err(MotionError::Starts)?;
        let mut group_of = vec![0; problem.modules().len()];
        let mut starts = vec![(0, 0); problem.modules().len()];
        for (index, group) in groups.iter().enumerate() {
            for (member, &module) in group.modules.iter().enumerate() {
                group_of[module] = index;
                starts[module] = group.site_of(member);
            }
        }
        let mut all: Vec<Site> = spots.iter().chain(&starts).copied().collect();
        let near = corners_near(&all, &lattice, problem.target().surroundings());
        all.extend(near);
        let margin = if request.plan.blocks.is_empty() {
            0
        } else {
            BLOCK_MARGIN
        };
        let arena = Arena::around(
            &lattice,
            &all,
            room + margin,
            request.obstacles,
            request.walls,
        )?;
        let on_lattice = Self {
            request,
            aligners: aligners(&groups, &lattice, &arena),
            lattice,
            spots,
            resting,
            stands,
            spot_of,
            groups,
            group_of,
            starts,
            arena,
        };
        on_lattice.check_cover()?;
        Ok(on_lattice)
    }

    fn is_closed(&self, site: Site) -> bool {
        self.arena
            .cell(site)
            .is_none_or(|cell| self.arena.closed[cell])
    }

    /// No module that may move starts on a closed cell or reaches into an obstacle on its way onto the lattice, and no spot that is
    /// taken may be closed.
    fn check_cover(&self) -> Result<(), MotionError> {
        let problem = self.request.problem;
        let mut covered = BTreeSet::new();
        for group in &self.groups {
            let swept = Phase::ALL.into_iter().flat_map(|phase| group.swept(phase));
            let is_open = |shape: Shape| self.request.is_open(&shape);
            // A group that shifts to where it has room has looked for its way.
            let reaches = !group.enters() && !swept.into_iter().all(is_open);
            for &module in &group.modules {
                let is_pinned = problem.modules()[module].pin.is_some();
                let stays = group.at_rest.is_some() || is_pinned;
                if !stays && (reaches || self.is_closed(self.starts[module])) {
                    covered.insert(problem.modules()[module].id);
                }
            }
        }
        if !covered.is_empty() {
            let faults = covered.into_iter().map(StartFault::Covered).collect();
            return Err(MotionError::Starts(faults));
        }
        let moving = self.spot_of.iter().zip(problem.modules());
        let moving = moving.filter(|(_, module)| module.pin.is_none());
        let mut taken = moving.filter_map(|(spot, _)| spot.as_ref());
        let is_covered = |spot: usize| match self.resting.is_off[spot] {
            true => !self.is_clear_of_obstacles(&self.resting.at(problem.target(), spot)),
            false => self.is_closed(self.spots[spot]),
        };
        match taken.find(|&&spot| is_covered(spot)) {
            Some(&spot) => Err(MotionError::CoveredSpot(problem.target().spots()[spot].id)),
            None => Ok(()),
        }
    }

    /// Whether a shape is clear of obstacles and within the walls.
    pub fn is_clear_of_obstacles(&self, shape: &Shape) -> bool {
        let (request, slack) = (self.request, self.resting.form.tolerance);
        let bounds = shape.bounds();
        let mut near = request
            .obstacles
            .iter()
            .filter(|area| overlap(&bounds, &area.corners(), slack));
        let is_within = |walls: &Area| {
            let (low, high) = walls.corners();
            let is_inside =
                |low: Point, high: Point| low.0 <= high.0 + slack && low.1 <= high.1 + slack;
            is_inside(low, bounds.0) && is_inside(bounds.1, high)
        };
        request.walls.iter().all(is_within)
            && !near.any(|area| shape.overlaps(&Shape::rectangle(area.corners()), slack))
    }

    /// The heading of a module that has come onto the lattice.
    pub fn heading(&self, module: usize) -> i64 {
        let start = self.request.problem.modules()[module].pose.theta.0;
        self.groups[self.group_of[module]].heading(start)
    }

    /// The cells that a spot takes from others.
    fn cells_of_spot(&self, spot: usize) -> Vec<usize> {
        if !self.resting.is_off[spot] {
            return self.arena.cell(self.spots[spot]).into_iter().collect();
        }
        let body = self.resting.cell_at(self.request.problem.target(), spot);
        cells_under(
            &body,
            &self.lattice,
            &self.arena,
            self.resting.form.tolerance,
        )
    }

    /// The cells that a pinned module takes from others.
    pub fn cells_taken_by(&self, module: usize) -> Vec<usize> {
        let spot = self.spot_of[module];
        spot.map_or_else(Vec::new, |spot| self.cells_of_spot(spot))
    }

    /// The cells that a unit takes from others when it rests on its spots.
    pub fn cells_at_rest(&self, unit: &Unit) -> Vec<usize> {
        let cells = self
            .spots_of(unit)
            .flat_map(|spot| self.cells_of_spot(spot));
        let cells: BTreeSet<usize> = cells.collect();
        cells.into_iter().collect()
    }

    /// Whether an exit leads a unit to its spots.
    pub fn exits(&self, unit: &Unit) -> bool {
        !unit.stays && self.spots_of(unit).any(|spot| self.resting.is_off[spot])
    }

    /// When a step into each cell may begin.
    pub fn ready(&self) -> Vec<Time> {
        let latest =
            |groups: &Vec<usize>| groups.iter().map(|&group| self.groups[group].ready()).max();
        self.aligners
            .iter()
            .map(|groups| latest(groups).unwrap_or_default())
            .collect()
    }

    /// The units: the blocks that are not taken apart, and single modules.
    pub fn crew(&self, apart: &[bool]) -> Crew {
        let problem = self.request.problem;
        let mut partition: Vec<Vec<usize>> = Vec::new();
        let mut is_placed = vec![false; self.starts.len()];
        let blocks = self.request.plan.blocks.iter().zip(apart);
        for (block, _) in blocks.filter(|(_, apart)| !**apart) {
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
        let singles = (0..is_placed.len()).filter(|&module| !is_placed[module]);
        partition.extend(singles.map(|module| vec![module]));
        partition.sort_unstable();
        let units = partition.into_iter().map(|modules| self.unit(modules));
        let mut units: Vec<Unit> = units.collect();
        self.rest_staying(&mut units);
        let mut unit_at = vec![NO_UNIT; self.spots.len()];
        for (index, unit) in units.iter().enumerate() {
            for spot in self.spots_of(unit) {
                unit_at[spot] = index;
            }
        }
        let ranks = self.ranks(&units);
        let first = |unit: usize| (!units[unit].pinned, ranks[unit], unit);
        let mut docking: Vec<usize> = (0..units.len())
            .filter(|&unit| ranks[unit].is_some())
            .collect();
        docking.sort_unstable_by_key(|&unit| first(unit));
        let topology = problem.target().topology();
        let parents = units.iter().enumerate().map(|(index, unit)| {
            let next = self
                .spots_of(unit)
                .flat_map(|spot| topology.neighbours(spot));
            next.map(|&next| unit_at[next])
                .filter(|&other| other != NO_UNIT && first(other) < first(index))
                .filter(|_| !unit.pinned)
                .min_by_key(|&other| first(other))
        });
        Crew {
            parents: parents.collect(),
            docking,
            ranks,
            units,
        }
    }

    /// Units that stay off the lattice hold all cells that they reach into; one that two reach into is held by the first.
    fn rest_staying(&self, units: &mut [Unit]) {
        let mut held = BTreeSet::new();
        for unit in units.iter_mut().filter(|unit| unit.stays) {
            let cells = self.cells_at_rest(unit);
            if self.spots_of(unit).any(|spot| self.resting.is_off[spot]) {
                let own: Vec<usize> = cells
                    .iter()
                    .copied()
                    .filter(|cell| !held.contains(cell))
                    .collect();
                unit.rest_on(&own, &self.arena);
            }
            held.extend(cells);
        }
    }

    fn unit(&self, modules: Vec<usize>) -> Unit {
        let starts: Vec<Site> = modules.iter().map(|&module| self.starts[module]).collect();
        let spots: Option<Vec<usize>> =
            modules.iter().map(|&module| self.spot_of[module]).collect();
        let spots = spots.unwrap_or_default();
        let is_off = spots.iter().any(|&spot| self.resting.is_off[spot]);
        let stands = modules.iter().all(|&module| self.stands[module]);
        let goals = match is_off {
            _ if spots.is_empty() || stands => None,
            true => self.cells_before_exit(&spots),
            false => Some(spots.iter().map(|&spot| self.spots[spot]).collect()),
        };
        let first = modules[0];
        let turns = modules.iter().any(|&module| self.turns(module));
        let turns = turns && !(is_off && modules.len() == 1);
        let mut unit = Unit::new(modules, &starts, goals.as_deref(), turns, &self.arena);
        if self.resting.form.is_round {
            unit.turn_within_cell(&self.arena);
        }
        if is_off && unit.goal.is_none() {
            // It folds on its exit.
            let (_, middle) = split(&self.arena, unit.start);
            let under = self.arena.cell(self.spots[spots[0]]);
            unit.goal = Some(under.unwrap_or(middle));
        }
        unit.ready = self.groups[self.group_of[first]].ready();
        unit.pinned = self.request.problem.modules()[first].pin.is_some();
        unit.stays = unit.pinned || stands;
        if stands {
            unit.goal = Some(unit.start);
        }
        unit
    }

    /// The cells near spots off the lattice on which a unit is laid out as on them; none if they are on no common lattice.
    fn cells_before_exit(&self, spots: &[usize]) -> Option<Vec<Site>> {
        let poses = spots
            .iter()
            .map(|&spot| self.request.problem.target().spots()[spot].pose);
        let cells = rigid_cells(&poses.collect::<Vec<_>>())?;
        let (x, y) = self.spots[spots[0]];
        Some(cells.iter().map(|cell| (x + cell.0, y + cell.1)).collect())
    }

    /// Whether a module that has come onto the lattice has to turn for its spot.
    fn turns(&self, module: usize) -> bool {
        let problem = self.request.problem;
        let member = &problem.modules()[module];
        let heading = self.groups[self.group_of[module]].heading(member.pose.theta.0);
        let spot = self.spot_of[module].filter(|_| member.pin.is_none());
        spot.is_some_and(|spot| {
            let goal = problem.target().spots()[spot].pose.theta.0;
            (quarters(goal) - quarters(heading)).rem_euclid(4) != 0
        })
    }

    /// The spots of a unit, by positions.
    pub fn spots_of(&self, unit: &Unit) -> impl Iterator<Item = usize> {
        unit.modules
            .iter()
            .filter_map(|&module| self.spot_of[module])
    }

    /// The place of each unit with a spot in the plan's acting order; units that the order leaves out come last.
    fn ranks(&self, units: &[Unit]) -> Vec<Option<usize>> {
        let problem = self.request.problem;
        let mut rank_of = vec![usize::MAX; self.starts.len()];
        let placed = self.request.plan.assembly.placements();
        for (rank, (module, _)) in placed.enumerate() {
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
}
