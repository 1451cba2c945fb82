//! The acting order: in which order the units take their spots.
//!
//! The paper (section "Acting Phase") lets modules move by the betweenness of their spots, centre first, and its
//! Theorem 1 concludes that nobody is walled in. Sorted by betweenness alone, almost every target has a spot that is
//! filled beside no placed one, and even breadth-first layers wall a spot in on most lattice trees. So the order here
//! is computed with the corridors in view:
//!
//! - Breadth-first layers from the spot of greatest value are the base.
//! - On a unit lattice the order is found in reverse, by taking the finished formation apart: of all spots that can
//!   go, because the rest stays connected and a unit module has a way out through free cells, the one latest in
//!   breadth-first order goes first (`peeling`). The root stays to the last; if that fails, any spot may.
//!   On trees this finds an order whenever there is one, for what can go once can still go later. On cyclic targets
//!   it may not, and a search under a budget follows (`search`).
//! - Where no order exists, or off the lattice, breadth-first it is, with a warning.
//!
//! **Units.** A block is contracted to one node: its spots follow one another, the first beside a placed spot. Each
//! of them must have a corridor for a unit module when its turn comes. How a block reshapes on its way is not
//! modelled, so this says that each of its modules has a way, not that the block fits through in one piece. Pinned
//! modules stand already: they come first, each a unit of its own, and count as obstacles from the start. Modules that
//! have no spot, and those still on their way, are no obstacles.

mod breadth_first;
mod corridor;
mod peeling;
mod search;
#[cfg(test)]
mod tests;

use crate::model::{
    ActingUnit, Assembly, AssemblyWarning, MicroUnits, ModuleId, Plan, PlanningProblem, Topology,
};

use breadth_first::BreadthFirst;
use corridor::Corridors;
use search::{Outcome, SEARCH_STEPS_MAX};

/// What is to be filled and by whom; spots are positions in the target.
struct Ground<'a> {
    topology: &'a Topology,
    values: &'a [MicroUnits],
    /// Who fills each spot.
    holders: Vec<Option<ModuleId>>,
    /// To which unit each spot belongs, if it is filled.
    unit_of: Vec<Option<usize>>,
    /// The spots of each unit, ascending.
    units: Vec<Vec<usize>>,
    /// Whether the holder of each spot stands on it already.
    pinned: Vec<bool>,
}

/// Whether the root of each component has to stay to the last when the formation is taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Root {
    /// The spot of greatest value.
    Centre,
    /// Whichever is left over.
    Free,
}

/// Orders the units of a plan; `values` are the spots' values by position in the problem's target, as the allocation
/// used them (a spot that it has not is taken for worthless).
///
/// Deterministic: equal values fall to the lower spot, neighbours go in ascending order. Assignments to spots that
/// the target does not have are left out. Takes about O(n log n) for n spots on trees with single modules; a
/// block of k modules can be tried once for each cell on its outline, O(k) each time.
#[must_use]
pub fn order(problem: &PlanningProblem, plan: &Plan, values: &[MicroUnits]) -> Assembly {
    order_within(problem, plan, values, SEARCH_STEPS_MAX)
}

fn order_within(
    problem: &PlanningProblem,
    plan: &Plan,
    values: &[MicroUnits],
    steps_max: u64,
) -> Assembly {
    let ground = Ground::new(problem, plan, values);
    let base = BreadthFirst::of(&ground);
    let mut warnings = Vec::new();
    let sequence = match Corridors::of(problem.target(), &ground) {
        None => {
            warnings.push(AssemblyWarning::OffLattice);
            base.sequence
        }
        Some(corridors) => match with_corridors(&ground, &base, &corridors, steps_max) {
            Found::Order(sequence) => sequence,
            Found::None { budget_spent } => {
                let walled_in = first_walled_in(&ground, &base.sequence, &corridors);
                warnings.extend(
                    walled_in
                        .map(|spot| AssemblyWarning::WalledIn(problem.target().spots()[spot].id)),
                );
                if budget_spent {
                    warnings.push(AssemblyWarning::BudgetSpent);
                }
                base.sequence
            }
        },
    };
    let restarts = ground.restarts_along(&sequence).into_iter();
    warnings.extend(
        restarts.map(|spot| AssemblyWarning::Disconnected(problem.target().spots()[spot].id)),
    );
    Assembly {
        units: ground.units_along(problem, &sequence),
        warnings,
    }
}

enum Found {
    Order(Vec<usize>),
    None { budget_spent: bool },
}

/// Looks for an order with corridors, with the root at the centre before a free one, the quick way before the search.
fn with_corridors(
    ground: &Ground,
    base: &BreadthFirst,
    corridors: &Corridors,
    steps_max: u64,
) -> Found {
    let standing = base.sequence.iter().filter(|&&spot| ground.pinned[spot]);
    let mut budget_spent = false;
    for root in [Root::Centre, Root::Free] {
        let removed = peeling::peel(ground, base, corridors.clone(), root).or_else(|| {
            if base.spans_every_edge {
                return None;
            }
            match search::search(ground, base, corridors.clone(), root, steps_max / 2) {
                Outcome::Found(removed) => Some(removed),
                Outcome::None => None,
                Outcome::BudgetSpent => {
                    budget_spent = true;
                    None
                }
            }
        });
        if let Some(removed) = removed {
            return Found::Order(standing.chain(removed.iter().rev()).copied().collect());
        }
    }
    Found::None { budget_spent }
}

/// The first spot of an order that has no corridor when its turn comes.
fn first_walled_in(ground: &Ground, sequence: &[usize], corridors: &Corridors) -> Option<usize> {
    let mut corridors = corridors.clone();
    let mut first = None;
    for &spot in sequence.iter().rev().filter(|&&spot| !ground.pinned[spot]) {
        if !corridors.reaches(spot) {
            first = Some(spot);
        }
        corridors.vacate(spot);
    }
    first
}

impl<'a> Ground<'a> {
    fn new(problem: &'a PlanningProblem, plan: &Plan, values: &'a [MicroUnits]) -> Self {
        let target = problem.target();
        let count = target.spots().len();
        let mut ground = Self {
            topology: target.topology(),
            values,
            holders: vec![None; count],
            unit_of: vec![None; count],
            units: Vec::new(),
            pinned: vec![false; count],
        };
        let spot_of = |module: &ModuleId| {
            let spot = target.position_of(*plan.assignments.get(module)?)?;
            let pin = problem.module(*module).and_then(|module| module.pin);
            Some((spot, pin == Some(target.spots()[spot].id)))
        };
        for &module in plan.assignments.keys() {
            let Some((spot, pinned)) = spot_of(&module) else {
                continue;
            };
            ground.holders[spot] = Some(module);
            ground.pinned[spot] = pinned;
        }
        for block in &plan.blocks {
            let mut spots: Vec<usize> = block
                .iter()
                .filter_map(spot_of)
                .filter(|&(spot, pinned)| !pinned && ground.unit_of[spot].is_none())
                .map(|(spot, _)| spot)
                .collect();
            spots.sort_unstable();
            spots.dedup();
            ground.add_unit(spots);
        }
        for spot in 0..count {
            if ground.holders[spot].is_some() && ground.unit_of[spot].is_none() {
                ground.add_unit(vec![spot]);
            }
        }
        ground
    }

    fn add_unit(&mut self, spots: Vec<usize>) {
        if spots.is_empty() {
            return;
        }
        for &spot in &spots {
            self.unit_of[spot] = Some(self.units.len());
        }
        self.units.push(spots);
    }

    fn is_filled(&self, spot: usize) -> bool {
        self.unit_of[spot].is_some()
    }

    fn value(&self, spot: usize) -> MicroUnits {
        self.values.get(spot).copied().unwrap_or_default()
    }

    /// The filled neighbours of a spot, ascending.
    fn neighbours(&self, spot: usize) -> impl Iterator<Item = usize> + '_ {
        self.topology
            .neighbours(spot)
            .iter()
            .copied()
            .filter(|&neighbour| self.is_filled(neighbour))
    }

    /// The spots of a sequence that are filled beside no placed one; the first, and pinned ones, aside.
    fn restarts_along(&self, sequence: &[usize]) -> Vec<usize> {
        let mut placed = vec![false; self.unit_of.len()];
        let mut restarts = Vec::new();
        for (index, &spot) in sequence.iter().enumerate() {
            if index > 0
                && !self.pinned[spot]
                && !self.neighbours(spot).any(|neighbour| placed[neighbour])
            {
                restarts.push(spot);
            }
            placed[spot] = true;
        }
        restarts
    }

    /// The units in the order in which a sequence of spots names them; it names the spots of a unit one after another.
    fn units_along(&self, problem: &PlanningProblem, sequence: &[usize]) -> Vec<ActingUnit> {
        let mut units: Vec<ActingUnit> = Vec::with_capacity(self.units.len());
        let mut current = None;
        for &spot in sequence {
            let Some(holder) = self.holders[spot] else {
                continue;
            };
            let placement = (holder, problem.target().spots()[spot].id);
            match units.last_mut() {
                Some(unit) if current == self.unit_of[spot] => {
                    unit.lead = unit.lead.min(holder);
                    unit.placements.push(placement);
                }
                _ => units.push(ActingUnit {
                    lead: holder,
                    placements: vec![placement],
                    pinned: self.pinned[spot],
                }),
            }
            current = self.unit_of[spot];
        }
        units
    }
}
