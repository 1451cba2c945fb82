//! Units swap their spots where nothing can carry out the claims.
//!
//! The claims choose spots by distance, and so may reverse the order of modules in a lane in which none can pass another. The
//! swap looks at ways instead: it gives the same spots to the same kind of units, single modules or blocks of one shape, so that
//! the sum of their ways along free cells is least, and of equal sums the one with the least sum of squares. Then no two of them
//! go through a lane in opposite directions, and of two that go through it the one in front goes farther. Where that does
//! not help either, all blocks are taken apart, and single modules alone remain.
//!
//! Modules without a spot take part, as one of them may stand in the way of another; pinned modules never do.

use std::collections::{BTreeMap, BTreeSet};

use formation_baselines::hungarian;
use formation_model::{
    ActingUnit, ModuleId, MotionPlan, Plan, PlanningProblem, SpotId, SpotSelection,
};

use super::lattice::{Site, Time};
use super::lattice_request::LatticeRequest;
use super::plan_motion;
use super::result::MotionRequest;
use super::unlabelled::SpotFilling;

/// The most cells that the searches for ways visit.
const VISITS_MAX: usize = 200_000_000;

/// The most pairs of a unit and spots of its kind.
const PAIRS_MAX: usize = 1_000_000;

/// What a cell of a way costs, on top of the square of the way.
const STEP: i64 = 1 << 24;

/// The utility of spots that a unit cannot take; more than the longest way costs.
const NEVER: i64 = -(1 << 50);

/// Ways to choose new holders, in the order in which they are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// By the ways of blocks and single modules.
    Whole,
    /// By the ways of single modules; all blocks are taken apart.
    Apart,
    /// Single modules fill the spots one after another.
    Filled,
}

/// A unit with the spots that it was claimed, by positions; a spare module has none.
#[derive(Clone, Debug)]
struct Claim {
    modules: Vec<usize>,
    spots: Vec<usize>,
}

/// Hundredths of the bound, and steps on top of these, that a motion may take before spots are swapped for a shorter one.
const LONG: (u64, u64) = (160, 8);

/// Hundredths of a motion's steps that a swap leaves at most.
const SHORTER: u64 = 80;

/// A motion, and the plan with the new holders.
type Swapped = (MotionPlan, Plan);

/// Whether a motion takes far longer than the longest of its ways.
fn is_long(motion: &MotionPlan) -> bool {
    let (share, steps) = LONG;
    let most = u64::from(motion.bound) * share / 100 + steps;
    u64::from(motion.makespan) > most
}

/// A far shorter motion and the plan with the new holders, if this one is long and a swap makes it so.
pub(crate) fn plan_shorter(request: &MotionRequest, motion: &MotionPlan) -> Option<Swapped> {
    let may_pass = is_long(motion) && request.plan.blocks.is_empty();
    let swapped = may_pass.then(|| plan_passing(request))??;
    let most = u64::from(motion.makespan) * SHORTER / 100;
    (u64::from(swapped.0.makespan) <= most).then_some(swapped)
}

/// The motion after a swap, and the plan with the new holders; `None` if there is none within the limits.
pub(crate) fn plan_with_swaps(request: &MotionRequest) -> Option<Swapped> {
    let has_blocks = !request.plan.blocks.is_empty();
    let passing = (!has_blocks).then(|| plan_passing(request)).flatten();
    if let Some((motion, _)) = &passing
        && !is_long(motion)
    {
        return passing;
    }
    let chosen = plan_chosen(request, &[Choice::Whole, Choice::Apart]);
    let all = [passing, chosen].into_iter().flatten();
    all.min_by_key(|(motion, _)| motion.makespan)
        .or_else(|| has_blocks.then(|| plan_passing(request)).flatten())
        .or_else(|| plan_chosen(request, &[Choice::Filled]))
}

/// The same, where modules swap on the way; all blocks are taken apart.
fn plan_passing(request: &MotionRequest) -> Option<Swapped> {
    // All modules spread to turn.
    let room = i64::try_from(request.problem.modules().len().isqrt() / 2).ok()?;
    let claimed = LatticeRequest::with_room(request, room).ok()?;
    let passage = claimed.passage(&closed_cells(&claimed))?;
    let plan = with_holders(request.problem, request.plan, &passage.holders, false);
    let swapped = MotionRequest {
        plan: &plan,
        ..*request
    };
    let on_lattice = LatticeRequest::with_room(&swapped, room).ok()?;
    if on_lattice.starts != claimed.starts || !on_lattice.arena.covers_same(&claimed.arena) {
        return None;
    }
    let mut motion = on_lattice.plan_passage(&passage)?;
    motion.taken_apart.clone_from(&request.plan.blocks);
    Some((motion, plan))
}

/// The same, where new holders are chosen before the motion is planned.
fn plan_chosen(request: &MotionRequest, choices: &[Choice]) -> Option<Swapped> {
    let swap = Swap::new(request)?;
    let claimed = request.plan;
    let mut tried = vec![claimed.assignments.clone()];
    for &choice in choices {
        let keeps_blocks = choice == Choice::Whole;
        let Some(holders) = swap.chosen(choice) else {
            continue;
        };
        let plan = with_holders(request.problem, claimed, &holders, keeps_blocks);
        if tried.contains(&plan.assignments) {
            continue;
        }
        let swapped = MotionRequest {
            plan: &plan,
            ..*request
        };
        if let Ok(mut motion) = plan_motion(&swapped) {
            if !keeps_blocks {
                motion.taken_apart.clone_from(&claimed.blocks);
            }
            return Some((motion, plan));
        }
        tried.push(plan.assignments);
    }
    None
}

/// Cells that no module may enter; pinned modules close theirs.
fn closed_cells(on_lattice: &LatticeRequest) -> Vec<bool> {
    let mut closed = on_lattice.arena.closed.clone();
    let modules = on_lattice.request.problem.modules().iter();
    for (module, &site) in modules.zip(&on_lattice.starts) {
        if module.pin.is_some()
            && let Some(cell) = on_lattice.arena.cell(site)
        {
            closed[cell] = true;
        }
    }
    closed
}

/// What the choice of new holders needs.
struct Swap<'a> {
    on_lattice: LatticeRequest<'a>,
    /// Cells that no module may enter; pinned modules close theirs.
    closed: Vec<bool>,
    /// The cells from the start of each module to each spot that is taken; `None` where no way leads.
    ways: BTreeMap<usize, Vec<Option<Time>>>,
}

impl<'a> Swap<'a> {
    fn new(request: &'a MotionRequest<'a>) -> Option<Self> {
        let on_lattice = LatticeRequest::new(request).ok()?;
        let spots = on_lattice.spot_of.iter().flatten().count();
        if spots.saturating_mul(on_lattice.arena.area()) > VISITS_MAX {
            return None;
        }
        let mut swap = Self {
            closed: closed_cells(&on_lattice),
            on_lattice,
            ways: BTreeMap::new(),
        };
        swap.measure();
        Some(swap)
    }

    fn is_pinned(&self, module: usize) -> bool {
        let problem = self.on_lattice.request.problem;
        problem.modules()[module].pin.is_some()
    }

    /// Measures all ways.
    fn measure(&mut self) {
        let LatticeRequest {
            arena,
            starts,
            spots,
            spot_of,
            ..
        } = &self.on_lattice;
        let cells: Vec<usize> = starts.iter().filter_map(|&site| arena.cell(site)).collect();
        let taken = (0..starts.len()).filter(|&module| !self.is_pinned(module));
        let taken: Vec<usize> = taken.filter_map(|module| spot_of[module]).collect();
        for spot in taken {
            let mut steps: Vec<Option<Time>> = vec![None; arena.area()];
            let first = arena.cell(spots[spot]).filter(|&cell| !self.closed[cell]);
            let mut found: Vec<usize> = first.into_iter().collect();
            first.inspect(|&cell| steps[cell] = Some(0));
            let mut next = 0;
            while let Some(&cell) = found.get(next) {
                next += 1;
                for neighbour in arena.neighbours(cell) {
                    if !self.closed[neighbour] && steps[neighbour].is_none() {
                        steps[neighbour] = steps[cell].map(|so_far| so_far + 1);
                        found.push(neighbour);
                    }
                }
            }
            let ways = cells.iter().map(|&cell| steps[cell]).collect();
            self.ways.insert(spot, ways);
        }
    }

    /// The units that may swap, in the order of their first modules, and modules without a spot.
    fn claims(&self, keeps_blocks: bool) -> Vec<Claim> {
        let request = self.on_lattice.request;
        let blocks = request.plan.blocks.iter().filter(|_| keeps_blocks);
        let positions = |block: &Vec<ModuleId>| -> Vec<usize> {
            let modules = block.iter();
            modules
                .filter_map(|&module| request.problem.position_of(module))
                .collect()
        };
        let mut groups: Vec<Vec<usize>> = blocks.map(positions).collect();
        let in_blocks: BTreeSet<usize> = groups.iter().flatten().copied().collect();
        let singles = 0..self.on_lattice.starts.len();
        let singles = singles.filter(|module| !in_blocks.contains(module));
        groups.extend(singles.map(|module| vec![module]));
        groups.sort_unstable();
        groups.retain(|modules| !modules.iter().any(|&module| self.is_pinned(module)));
        let spots_of = |modules: &[usize]| -> Vec<usize> {
            let spots = modules.iter();
            spots
                .filter_map(|&module| self.on_lattice.spot_of[module])
                .collect()
        };
        let claims = groups.into_iter().map(|modules| Claim {
            spots: spots_of(&modules),
            modules,
        });
        claims.collect()
    }

    /// The new holder of each spot whose holder may change; `None` if not all spots can be held.
    fn chosen(&self, choice: Choice) -> Option<BTreeMap<usize, usize>> {
        match choice {
            Choice::Whole => self.holders(true),
            Choice::Apart => self.holders(false),
            Choice::Filled => {
                let LatticeRequest {
                    arena,
                    starts,
                    spots,
                    ..
                } = &self.on_lattice;
                let (mut modules, mut places) = (BTreeMap::new(), BTreeMap::new());
                for claim in self.claims(false) {
                    let standing = claim.modules.iter();
                    modules
                        .extend(standing.filter_map(|&one| Some((arena.cell(starts[one])?, one))));
                    let taken = claim.spots.iter();
                    places.extend(taken.filter_map(|&spot| Some((arena.cell(spots[spot])?, spot))));
                }
                SpotFilling::new(arena, &self.closed, modules, places).holders()
            }
        }
    }

    /// The same, where the sum of all ways is least.
    fn holders(&self, keeps_blocks: bool) -> Option<BTreeMap<usize, usize>> {
        let mut by_size: BTreeMap<usize, Vec<Claim>> = BTreeMap::new();
        for claim in self.claims(keeps_blocks) {
            by_size.entry(claim.modules.len()).or_default().push(claim);
        }
        let mut holders = BTreeMap::new();
        for claims in by_size.values() {
            let places = claims.iter().filter(|claim| !claim.spots.is_empty());
            let places: Vec<&Claim> = places.collect();
            if places.len().saturating_mul(claims.len()) > PAIRS_MAX {
                return None;
            }
            let utilities = places.iter().map(|place| {
                let utility = |unit: &Claim| self.utility(unit, place).unwrap_or(NEVER);
                claims.iter().map(utility).collect()
            });
            let utilities: Vec<Vec<i64>> = utilities.collect();
            let chosen = hungarian::assign(&utilities);
            for ((place, unit), row) in places.iter().zip(chosen).zip(&utilities) {
                let unit = unit.filter(|&unit| row[unit] > NEVER)?;
                let pairs = self.fitted(&claims[unit], place)?;
                holders.extend(pairs.into_iter().map(|(module, spot)| (spot, module)));
            }
        }
        Some(holders)
    }

    /// What the spots of a place are worth to a unit: the less, the longer its ways; `None` if it cannot take them.
    fn utility(&self, unit: &Claim, place: &Claim) -> Option<i64> {
        let pairs = self.fitted(unit, place)?;
        let mut utility = 0;
        for (module, spot) in pairs {
            let way = i64::from(*self.ways.get(&spot)?.get(module)?.as_ref()?);
            utility -= way * STEP + way * way;
        }
        Some(utility)
    }

    /// Which module of a unit takes which spot of a place, if the unit fits there and keeps the same links: as it stands at the
    /// start, or as it was to stand on its own spots.
    fn fitted(&self, unit: &Claim, place: &Claim) -> Option<Vec<(usize, usize)>> {
        let pairs = |spots: &[usize]| {
            unit.modules
                .iter()
                .copied()
                .zip(spots.iter().copied())
                .collect()
        };
        if unit.modules == place.modules || unit.modules.len() == 1 {
            return Some(pairs(&place.spots));
        }
        let LatticeRequest { starts, spots, .. } = &self.on_lattice;
        let at_start = unit.modules.iter().map(|&module| starts[module]);
        let at_goal = unit.spots.iter().map(|&spot| spots[spot]);
        let layouts: [Vec<Site>; 2] = [at_start.collect(), at_goal.collect()];
        let fitting = layouts
            .iter()
            .filter_map(|layout| self.laid(layout, &place.spots));
        let mut keeping = fitting.filter(|spots| self.keeps_links(unit, spots));
        keeping.next().map(|spots| pairs(&spots))
    }

    /// The spots in the order of the sites of a layout of the same shape.
    fn laid(&self, layout: &[Site], place: &[usize]) -> Option<Vec<usize>> {
        let site = |spot: usize| self.on_lattice.spots[spot];
        let low = *layout.iter().min()?;
        let at = place.iter().map(|&spot| site(spot)).min()?;
        let spot_on = |one: &Site| {
            let wanted = (one.0 - low.0 + at.0, one.1 - low.1 + at.1);
            place.iter().copied().find(|&spot| site(spot) == wanted)
        };
        layout.iter().map(spot_on).collect()
    }

    /// Whether a unit keeps on these spots, in the order of its modules, the links that it keeps on those it was claimed.
    fn keeps_links(&self, unit: &Claim, spots: &[usize]) -> bool {
        let request = self.on_lattice.request;
        let topology = request.problem.target().topology();
        let spot_of = |module: ModuleId| {
            let module = request.problem.position_of(module)?;
            let member = unit.modules.iter().position(|&one| one == module)?;
            spots.get(member).copied()
        };
        let mut links = request.plan.kept_links.iter();
        links.all(|&(one, other)| match (spot_of(one), spot_of(other)) {
            (Some(one), Some(other)) => topology.has_edge(one, other),
            _ => true,
        })
    }
}

/// The plan with new holders of some spots, by positions, and without blocks unless it keeps them.
fn with_holders(
    problem: &PlanningProblem,
    claimed: &Plan,
    holders: &BTreeMap<usize, usize>,
    keeps_blocks: bool,
) -> Plan {
    let spots = problem.target().spots();
    let modules = problem.modules();
    let held = claimed
        .assignments
        .iter()
        .map(|(&module, &spot)| (spot, module));
    let before: BTreeMap<SpotId, ModuleId> = held.collect();
    let mut after = before.clone();
    let new = holders.iter();
    after.extend(new.map(|(&spot, &module)| (spots[spot].id, modules[module].id)));
    let swaps = after
        .iter()
        .filter(|&(spot, module)| before.get(spot) != Some(module));
    let swaps = swaps
        .map(|(&spot, &module)| SpotSelection { spot, module })
        .collect();
    let mut plan = Plan {
        assignments: after
            .iter()
            .map(|(&spot, &module)| (module, spot))
            .collect(),
        blocks: if keeps_blocks {
            claimed.blocks.clone()
        } else {
            Vec::new()
        },
        kept_links: BTreeSet::new(),
        assembly: claimed.assembly.clone(),
        swaps,
    };
    plan.kept_links = kept_links(problem, &plan);
    plan.assembly.units.clear();
    for unit in &claimed.assembly.units {
        let spots = unit.placements.iter().map(|&(_, spot)| spot);
        let placements = spots.filter_map(|spot| Some((*after.get(&spot)?, spot)));
        let placements: Vec<(ModuleId, SpotId)> = placements.collect();
        let parts = match unit.pinned || keeps_blocks {
            true => vec![placements],
            false => placements.into_iter().map(|one| vec![one]).collect(),
        };
        plan.assembly
            .units
            .extend(parts.into_iter().filter_map(|placements| {
                Some(ActingUnit {
                    lead: placements.iter().map(|&(module, _)| module).min()?,
                    placements,
                    pinned: unit.pinned,
                })
            }));
    }
    plan
}

/// The links between modules of one block, or between pinned ones, that are on adjacent spots.
fn kept_links(problem: &PlanningProblem, plan: &Plan) -> BTreeSet<(ModuleId, ModuleId)> {
    let target = problem.target();
    let is_pinned = |module: ModuleId| problem.module(module).is_some_and(|one| one.pin.is_some());
    let together = |one: ModuleId, other: ModuleId| {
        let mut blocks = plan.blocks.iter();
        is_pinned(one) && is_pinned(other)
            || blocks.any(|block| block.contains(&one) && block.contains(&other))
    };
    let spot_of = |module: ModuleId| target.position_of(*plan.assignments.get(&module)?);
    let adjacent = |one: ModuleId, other: ModuleId| {
        let ends = spot_of(one).zip(spot_of(other));
        ends.is_some_and(|(one, other)| target.topology().has_edge(one, other))
    };
    let links = problem.modules().iter().flat_map(|module| {
        let others = module.links.iter().filter(|&&other| module.id < other);
        others.map(|&other| (module.id, other))
    });
    links
        .filter(|&(one, other)| together(one, other) && adjacent(one, other))
        .collect()
}
