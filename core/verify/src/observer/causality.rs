//! Judges by causal marks, not by arrival, that all members had agreed before a module moved, and that spots were filled in
//! an order with a placed neighbour.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::kosaraju_scc;
use petgraph::graphmap::DiGraphMap;
use petgraph::visit::{Dfs, Reversed};

use super::claims::{disagreement, replay_claims};
use super::record::{Act, PlannedEpoch};
use crate::Violation;
use crate::plan::filled_parts;
use formation_model::{Digest, MicroUnits, ModuleId, RosterMember, SpotId};

/// The acts of the members of one epoch.
pub(super) struct Acts<'a> {
    planned: PlannedEpoch<'a>,
    members: BTreeMap<ModuleId, &'a RosterMember>,
    /// The acts of the members that have moved or settled, in the runs that the roster names.
    moved: BTreeMap<ModuleId, &'a Act>,
    /// The acting units that have moved; pinned modules do not move.
    pub(super) units: BTreeMap<ModuleId, Unit>,
    /// An edge leads from each unit to every unit that waited for one of its modules, which shows once it has docked.
    order: DiGraphMap<ModuleId, ()>,
}

/// One acting unit, as far as it is known.
#[derive(Default)]
pub(super) struct Unit {
    /// Those of its modules that have moved, ascending.
    pub(super) modules: Vec<ModuleId>,
    /// The modules of other units for which they waited.
    waited_for: BTreeSet<ModuleId>,
    /// Whether messages that were not received could add modules for which it waited.
    is_open: bool,
}

impl<'a> Acts<'a> {
    pub(super) fn new(planned: PlannedEpoch<'a>) -> Self {
        let members = planned.members().iter();
        let mut acts = Self {
            planned,
            members: members.map(|member| (member.module.id, member)).collect(),
            moved: BTreeMap::new(),
            units: BTreeMap::new(),
            order: DiGraphMap::new(),
        };
        for (&module, member) in &acts.members {
            let act = planned.act_of(member);
            if let Some(act) = act.filter(|act| act.moved_received.is_some()) {
                acts.moved.insert(module, act);
            }
        }
        acts.contract();
        acts
    }

    /// Joins the modules of each acting unit to one node of the order.
    fn contract(&mut self) {
        let mut units: BTreeMap<ModuleId, Unit> = BTreeMap::new();
        for &module in self.moved.keys() {
            if let Some(unit) = self.unit_of(module) {
                units.entry(unit).or_default().modules.push(module);
            }
        }
        for (&lead, unit) in &mut units {
            self.order.add_node(lead);
            // The lead lists all modules for which its unit waited; the others need not.
            unit.is_open = !self.moved.contains_key(&lead);
            let acts = unit.modules.iter().filter_map(|one| self.moved.get(one));
            let marks: BTreeSet<ModuleId> = acts
                .flat_map(|act| act.waited_for.keys().copied())
                .filter(|&module| self.planned.problem.position_of(module).is_some())
                .collect();
            for module in marks {
                let earlier = self.unit_of(module);
                if earlier == Some(lead) {
                    continue;
                }
                unit.waited_for.insert(module);
                match earlier {
                    Some(earlier) => {
                        self.order.add_edge(earlier, lead, ());
                    }
                    None => unit.is_open |= !self.is_pinned(module),
                }
            }
        }
        self.units = units;
    }

    fn is_pinned(&self, module: ModuleId) -> bool {
        let module = self.planned.problem.module(module);
        module.is_some_and(|module| module.pin.is_some())
    }

    /// The unit of a module that has moved, unless it is pinned.
    fn unit_of(&self, module: ModuleId) -> Option<ModuleId> {
        let act = self.moved.get(&module)?;
        let named = act.named.and_then(|(_, unit, _)| unit).unwrap_or(module);
        (!self.is_pinned(module)).then_some(named)
    }

    /// All acts that were too early or out of order, as far as the messages show them.
    pub(super) fn violations(&self, position_tolerance: MicroUnits) -> Vec<Violation> {
        let mut violations = Vec::new();
        self.check_digests(&mut violations);
        self.check_frozen(position_tolerance, &mut violations);
        self.check_marks(&mut violations);
        self.check_circles(&mut violations);
        // If messages are missing from a unit's causal past, they can contain what it lacks.
        let open = self.after_any(|unit| unit.is_open);
        self.check_agreement(&open, &mut violations);
        self.check_neighbours(&open, &mut violations);
        violations
    }

    /// Every module must act on a plan, and all on the same one.
    fn check_digests(&self, violations: &mut Vec<Violation>) {
        let mut first: Option<(ModuleId, Digest)> = None;
        for (&module, act) in &self.moved {
            for digest in &act.digests {
                let Some(digest) = *digest else {
                    violations.push(Violation::MovedWithoutPlan { module });
                    continue;
                };
                let &mut (other, other_digest) = first.get_or_insert((module, digest));
                if other_digest != digest {
                    violations.push(Violation::PlansDiffer {
                        epoch: self.planned.epoch,
                        first: other,
                        first_digest: other_digest,
                        second: module,
                        second_digest: digest,
                    });
                }
            }
        }
    }

    /// A module must stand where the roster says until it publishes that it moves.
    fn check_frozen(&self, position_tolerance: MicroUnits, violations: &mut Vec<Violation>) {
        for (&module, &member) in &self.members {
            let act = self.planned.act_of(member);
            let distance = act.map(|act| act.farthest_from(&member.module.pose));
            if let Some(distance) = distance.filter(|&distance| distance > position_tolerance) {
                let epoch = self.planned.epoch;
                violations.push(Violation::MovedEarly {
                    epoch,
                    module,
                    distance,
                });
            }
        }
    }

    /// The states for which a module waited must be settled, and the heartbeats on which it moved must show agreement.
    /// Enforces X5.
    fn check_marks(&self, violations: &mut Vec<Violation>) {
        let epoch = self.planned.epoch;
        for (&module, act) in &self.moved {
            for (&other, &sequence) in &act.waited_for {
                let member = self.members.get(&other);
                let unsettled = member
                    .and_then(|member| self.planned.act_of(member))
                    .and_then(|act| act.unsettled_until);
                if unsettled.is_some_and(|until| sequence <= until) {
                    violations.push(Violation::WaitedForUnsettled {
                        epoch,
                        module,
                        other,
                        sequence,
                    });
                }
            }
            let Some(digest) = act.digests.iter().copied().flatten().next() else {
                continue;
            };
            for (&member, &sequence) in &act.agreed_on {
                let shown = self
                    .members
                    .get(&member)
                    .and_then(|member| self.planned.shown_by(member)?.get(&digest));
                if let Some(plan) = shown.filter(|plan| plan.since > sequence) {
                    violations.push(Violation::MovedBeforeAgreement {
                        epoch,
                        module,
                        member,
                        sequence,
                        agreed_since: plan.since,
                    });
                }
            }
        }
    }

    /// The units that `holds` accepts, and all units with one of these in their causal past.
    /// Enforces V3.
    fn after_any(&self, holds: impl Fn(&Unit) -> bool) -> BTreeSet<ModuleId> {
        let accepted = self.units.iter().filter(|(_, unit)| holds(unit));
        let mut walk = Dfs::empty(&self.order);
        walk.stack = accepted.map(|(&lead, _)| lead).collect();
        std::iter::from_fn(|| walk.next(&self.order)).collect()
    }

    /// No two units can have waited for each other.
    fn check_circles(&self, violations: &mut Vec<Violation>) {
        let components = kosaraju_scc(&self.order).into_iter();
        let circles = components.filter(|component| component.len() > 1);
        if let Some(module) = circles.flatten().min() {
            let epoch = self.planned.epoch;
            violations.push(Violation::CircularWait { epoch, module });
        }
    }

    /// One unit must prove that all members had agreed.
    fn check_agreement(&self, open: &BTreeSet<ModuleId>, violations: &mut Vec<Violation>) {
        let proven = self.after_any(|unit| self.lacking_agreement(unit).is_none());
        if !proven.is_empty() || !open.is_empty() || !self.all_have_moved() {
            return;
        }
        for (&module, unit) in &self.units {
            if let Some(member) = self.lacking_agreement(unit) {
                violations.push(Violation::AgreementNotShown {
                    epoch: self.planned.epoch,
                    module,
                    member,
                });
            }
        }
    }

    /// Whether every module that has to move published that it does. The lead of the first unit alone carries the proof of
    /// agreement, and units do not wait for each other to set off, so that this lead may end before it publishes.
    fn all_have_moved(&self) -> bool {
        let claimed = replay_claims(self.planned);
        let (_, turns) = disagreement(self.planned);
        let holders = claimed.replay.spots;
        let to_fill = self.planned.problem.fillable_count();
        let mut modules = holders.keys();
        // A claim that did not arrive may have given a spot to another.
        turns.is_some_and(|turns| turns <= claimed.turns)
            && holders.len() == to_fill
            && modules.all(|&module| self.is_pinned(module) || self.moved.contains_key(&module))
    }

    /// The lowest member whose agreement the unit's own marks do not prove. A module need not prove its own.
    fn lacking_agreement(&self, unit: &Unit) -> Option<ModuleId> {
        let marks: BTreeSet<ModuleId> = unit
            .modules
            .iter()
            .filter_map(|&module| Some((module, self.moved.get(&module)?)))
            .filter(|(_, act)| !act.agreed_on.is_empty() || self.members.len() == 1)
            .flat_map(|(module, act)| act.agreed_on.keys().copied().chain([module]))
            .collect();
        let mut members = self.members.keys().copied();
        members.find(|member| !marks.contains(member))
    }

    /// Each unit must have a placed module adjacent to one of its spots in its causal past, except the first unit of each
    /// connected part of the filled spots. Units of which not all have settled are not judged.
    fn check_neighbours(&self, open: &BTreeSet<ModuleId>, violations: &mut Vec<Violation>) {
        let mut holders: BTreeMap<SpotId, ModuleId> = self
            .planned
            .problem
            .modules()
            .iter()
            .filter_map(|module| Some((module.pin?, module.id)))
            .collect();
        let pins: BTreeSet<SpotId> = holders.keys().copied().collect();
        for (&module, act) in &self.moved {
            if let Some((_, _, Some(spot))) = act.named {
                holders.entry(spot).or_insert(module);
            }
        }
        let filled: BTreeSet<SpotId> = holders.keys().copied().collect();
        let parts = filled_parts(self.planned.problem, &filled);
        let part_of: BTreeMap<SpotId, usize> = parts
            .iter()
            .enumerate()
            .flat_map(|(number, part)| part.iter().map(move |&spot| (spot, number)))
            .collect();
        let mut without: BTreeMap<usize, Vec<(usize, ModuleId, SpotId)>> = BTreeMap::new();
        for (&lead, unit) in &self.units {
            if !self.have_settled(&unit.modules)
                || open.contains(&lead)
                || self.has_placed_neighbour(unit, &holders)
            {
                continue;
            }
            let Some(spot) = self.spots_of(unit).next() else {
                continue;
            };
            if let Some(&part) = part_of.get(&spot) {
                let waited = unit.waited_for.len();
                without.entry(part).or_default().push((waited, lead, spot));
            }
        }
        let mut torn = None;
        for (part, mut units) in without {
            // A part with a pinned module exists before any module moves; otherwise the unit that waited for the fewest
            // modules was the first.
            let begun = parts[part].iter().any(|spot| pins.contains(spot));
            let first = usize::from(!begun);
            if units.len() > first {
                let torn = torn.get_or_insert_with(|| self.leads_of_torn_blocks());
                let may_be_torn =
                    |lead: &ModuleId| torn.as_ref().is_none_or(|torn| torn.contains(lead));
                units.retain(|(_, lead, _)| !may_be_torn(lead));
            }
            units.sort_unstable();
            violations.extend(
                units
                    .into_iter()
                    .skip(first)
                    .map(|(_, module, spot)| Violation::NoPlacedNeighbour { module, spot }),
            );
        }
    }

    /// The lowest modules of blocks of which not all have settled: where the others go may be what a placed module is adjacent to. `None`
    /// if claims did not arrive, so that any module may belong to such a block.
    fn leads_of_torn_blocks(&self) -> Option<BTreeSet<ModuleId>> {
        let claimed = replay_claims(self.planned);
        let (_, turns) = disagreement(self.planned);
        let blocks = claimed.replay.blocks.into_iter();
        let torn = blocks.filter(|block| !self.have_settled(block));
        let leads = torn.filter_map(|block| block.first().copied()).collect();
        turns
            .is_some_and(|turns| turns <= claimed.turns)
            .then_some(leads)
    }

    fn have_settled(&self, modules: &[ModuleId]) -> bool {
        let mut modules = modules.iter();
        modules.all(|module| self.moved.get(module).is_some_and(|act| act.settled))
    }

    fn spots_of(&self, unit: &Unit) -> impl Iterator<Item = SpotId> {
        let modules = unit.modules.iter();
        modules.filter_map(|module| self.moved.get(module)?.named?.2)
    }

    /// Whether a module adjacent to one of the unit's spots is in its causal past.
    fn has_placed_neighbour(&self, unit: &Unit, holders: &BTreeMap<SpotId, ModuleId>) -> bool {
        let adjacent: BTreeSet<ModuleId> = self
            .spots_of(unit)
            .flat_map(|spot| self.planned.problem.target().neighbours_of(spot))
            .filter_map(|spot| holders.get(&spot).copied())
            .collect();
        let is_first_hand =
            |module: &ModuleId| self.is_pinned(*module) || unit.waited_for.contains(module);
        if adjacent.iter().any(is_first_hand) {
            return true;
        }
        let units = adjacent
            .into_iter()
            .filter_map(|module| self.unit_of(module));
        let wanted: BTreeSet<ModuleId> =
            units.filter(|lead| !unit.modules.contains(lead)).collect();
        let earlier = unit.waited_for.iter();
        let past = Reversed(&self.order);
        let mut walk = Dfs::empty(past);
        walk.stack = earlier.filter_map(|&module| self.unit_of(module)).collect();
        std::iter::from_fn(|| walk.next(past)).any(|lead| wanted.contains(&lead))
    }
}
