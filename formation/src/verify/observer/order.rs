//! Judges by causal marks, never by arrival, that all had agreed before anything moved, and that spots filled in an order
//! with a placed neighbour.

use std::collections::{BTreeMap, BTreeSet};

use super::record::{Act, PlannedEpoch};
use crate::model::{Digest, MicroUnits, ModuleId, RosterMember, SpotId};
use crate::verify::Violation;
use crate::verify::plan::filled_parts;

/// What the members of one epoch did, by their own reports.
pub(super) struct Acts<'a> {
    planned: PlannedEpoch<'a>,
    /// The acts of the members that moved or settled, in the runs that the roster names.
    moved: BTreeMap<ModuleId, &'a Act>,
    /// The acting units that moved; pinned modules do not.
    units: BTreeMap<ModuleId, Unit>,
}

/// What is known of one acting unit.
#[derive(Default)]
pub(super) struct Unit {
    /// Those of its modules that moved, ascending.
    pub(super) modules: Vec<ModuleId>,
    /// The modules that they waited for, their own unit's apart.
    waited_for: BTreeSet<ModuleId>,
    /// The units of those modules.
    after: BTreeSet<ModuleId>,
    /// Whether a message that did not arrive could name more modules that it waited for.
    is_open: bool,
}

impl<'a> Acts<'a> {
    pub(super) fn new(planned: PlannedEpoch<'a>) -> Self {
        let members = planned.members().iter();
        let mut acts = Self {
            planned,
            moved: members
                .filter_map(|member| Some((member.module.id, planned.act_of(member)?)))
                .filter(|(_, act)| act.moved)
                .collect(),
            units: BTreeMap::new(),
        };
        acts.units = acts.contract();
        acts
    }

    /// Joins the modules of each acting unit to one node of the order.
    fn contract(&self) -> BTreeMap<ModuleId, Unit> {
        let mut units: BTreeMap<ModuleId, Unit> = BTreeMap::new();
        for &module in self.moved.keys() {
            if let Some(unit) = self.unit_of(module) {
                units.entry(unit).or_default().modules.push(module);
            }
        }
        for (&lead, unit) in &mut units {
            // The lead lists all that its unit waited for; the others need not.
            unit.is_open = !self.moved.contains_key(&lead);
            let marks: BTreeSet<ModuleId> = unit
                .modules
                .iter()
                .filter_map(|module| self.moved.get(module))
                .flat_map(|act| act.waited_for.keys().copied())
                .filter(|&module| self.planned.problem.position_of(module).is_some())
                .collect();
            for module in marks {
                let earlier = self.unit_of(module);
                if earlier == Some(lead) {
                    continue;
                }
                unit.is_open |= earlier.is_none() && !self.is_pinned(module);
                unit.waited_for.insert(module);
                unit.after.extend(earlier);
            }
        }
        units
    }

    fn is_pinned(&self, module: ModuleId) -> bool {
        let problem = self.planned.problem;
        problem
            .module(module)
            .is_some_and(|module| module.pin.is_some())
    }

    /// The unit of a module that moved, unless it is pinned.
    fn unit_of(&self, module: ModuleId) -> Option<ModuleId> {
        let act = self.moved.get(&module)?;
        let named = act.named.and_then(|(_, unit, _)| unit).unwrap_or(module);
        (!self.is_pinned(module)).then_some(named)
    }

    /// The acting units that moved.
    pub(super) fn units(&self) -> &BTreeMap<ModuleId, Unit> {
        &self.units
    }

    /// Everything that was done too early or out of order, as far as the received messages show it.
    pub(super) fn violations(&self, position_tolerance: MicroUnits) -> Vec<Violation> {
        let mut violations = Vec::new();
        self.check_digests(&mut violations);
        self.check_frozen(position_tolerance, &mut violations);
        self.check_marks(&mut violations);
        self.check_circles(&mut violations);
        // What a unit lacks may merely have been missed if messages are missing from its past.
        let open = self.after_any(|unit| unit.is_open);
        self.check_agreement(&open, &mut violations);
        self.check_neighbours(&open, &mut violations);
        violations
    }

    /// Every module must act on a plan, and all on the same.
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

    /// Until a module says that it moves, it must stand where the roster froze it.
    fn check_frozen(&self, position_tolerance: MicroUnits, violations: &mut Vec<Violation>) {
        for member in self.planned.members() {
            let Some(act) = self.planned.act_of(member) else {
                continue;
            };
            let distance = act.farthest_from(&member.module.pose);
            if distance > position_tolerance {
                violations.push(Violation::MovedEarly {
                    epoch: self.planned.epoch,
                    module: member.module.id,
                    distance,
                });
            }
        }
    }

    /// What a module counted as settled must have been, and what it counted as agreed as well.
    fn check_marks(&self, violations: &mut Vec<Violation>) {
        let members = self.planned.members().iter();
        let runs: BTreeMap<ModuleId, &RosterMember> =
            members.map(|member| (member.module.id, member)).collect();
        for (&module, act) in &self.moved {
            for (&other, &sequence) in &act.waited_for {
                let unsettled = runs
                    .get(&other)
                    .and_then(|member| self.planned.act_of(member))
                    .and_then(|act| act.unsettled_until);
                if unsettled.is_some_and(|until| sequence <= until) {
                    violations.push(Violation::WaitedForUnsettled {
                        epoch: self.planned.epoch,
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
                let since = runs
                    .get(&member)
                    .and_then(|one| self.planned.record.shown.get(&(member, one.incarnation)))
                    .and_then(|shown| shown.get(&digest))
                    .map(|plan| plan.since);
                if let Some(agreed_since) = since.filter(|&since| since > sequence) {
                    violations.push(Violation::MovedBeforeAgreement {
                        epoch: self.planned.epoch,
                        module,
                        member,
                        sequence,
                        agreed_since,
                    });
                }
            }
        }
    }

    /// The units that waited for each unit.
    fn followers(&self) -> BTreeMap<ModuleId, Vec<ModuleId>> {
        let mut followers: BTreeMap<ModuleId, Vec<ModuleId>> = BTreeMap::new();
        for (&lead, unit) in &self.units {
            for &earlier in &unit.after {
                followers.entry(earlier).or_default().push(lead);
            }
        }
        followers
    }

    /// The units that `holds` accepts, and all that have one of them in their causal past.
    fn after_any(&self, holds: impl Fn(&Unit) -> bool) -> BTreeSet<ModuleId> {
        let followers = self.followers();
        let mut reached: BTreeSet<ModuleId> = self
            .units
            .iter()
            .filter(|(_, unit)| holds(unit))
            .map(|(&lead, _)| lead)
            .collect();
        let mut open: Vec<ModuleId> = reached.iter().copied().collect();
        while let Some(unit) = open.pop() {
            for &follower in followers.get(&unit).into_iter().flatten() {
                if reached.insert(follower) {
                    open.push(follower);
                }
            }
        }
        reached
    }

    /// No unit can have waited for one that waited for it.
    fn check_circles(&self, violations: &mut Vec<Violation>) {
        let mut waits: BTreeMap<ModuleId, usize> = self
            .units
            .iter()
            .map(|(&lead, unit)| (lead, unit.after.len()))
            .collect();
        let followers = self.followers();
        let mut free: Vec<ModuleId> = waits
            .iter()
            .filter(|&(_, &count)| count == 0)
            .map(|(&lead, _)| lead)
            .collect();
        while let Some(unit) = free.pop() {
            waits.remove(&unit);
            for follower in followers.get(&unit).into_iter().flatten() {
                if let Some(count) = waits.get_mut(follower) {
                    *count -= 1;
                    if *count == 0 {
                        free.push(*follower);
                    }
                }
            }
        }
        if let Some((&module, _)) = waits.first_key_value() {
            violations.push(Violation::CircularWait {
                epoch: self.planned.epoch,
                module,
            });
        }
    }

    /// Each unit, or one in its causal past, must have seen all members agree.
    fn check_agreement(&self, open: &BTreeSet<ModuleId>, violations: &mut Vec<Violation>) {
        let proven = self.after_any(|unit| self.lacking_agreement(unit).is_none());
        for (&module, unit) in &self.units {
            if open.contains(&module) || proven.contains(&module) {
                continue;
            }
            if let Some(member) = self.lacking_agreement(unit) {
                violations.push(Violation::AgreementNotShown {
                    epoch: self.planned.epoch,
                    module,
                    member,
                });
            }
        }
    }

    /// The lowest member on whose agreement the unit does not rest by its own marks. A module need not prove its own.
    fn lacking_agreement(&self, unit: &Unit) -> Option<ModuleId> {
        let marks: BTreeSet<ModuleId> = unit
            .modules
            .iter()
            .filter_map(|&module| Some((module, self.moved.get(&module)?)))
            .filter(|(_, act)| !act.agreed_on.is_empty() || self.planned.members().len() == 1)
            .flat_map(|(module, act)| act.agreed_on.keys().copied().chain([module]))
            .collect();
        let members = self.planned.members().iter();
        members
            .map(|member| member.module.id)
            .find(|member| !marks.contains(member))
    }

    /// Each unit must have a placed module next to one of its spots in its causal past, except the first of each connected
    /// part of the filled spots.
    fn check_neighbours(&self, open: &BTreeSet<ModuleId>, violations: &mut Vec<Violation>) {
        let modules = self.planned.problem.modules().iter();
        let mut holders: BTreeMap<SpotId, ModuleId> = modules
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
            if open.contains(&lead) || self.has_placed_neighbour(unit, &holders) {
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
        for (part, mut units) in without {
            units.sort_unstable();
            // A part with a pinned module was begun before anything moved; otherwise the unit that waited for the
            // fewest began it.
            let begun = parts[part].iter().any(|spot| pins.contains(spot));
            violations.extend(
                units
                    .into_iter()
                    .skip(usize::from(!begun))
                    .map(|(_, module, spot)| Violation::NoPlacedNeighbour { module, spot }),
            );
        }
    }

    fn spots_of(&self, unit: &Unit) -> impl Iterator<Item = SpotId> + '_ {
        let modules = unit.modules.clone();
        modules
            .into_iter()
            .filter_map(|module| self.moved.get(&module)?.named?.2)
    }

    fn has_placed_neighbour(&self, unit: &Unit, holders: &BTreeMap<SpotId, ModuleId>) -> bool {
        let adjacent: BTreeSet<ModuleId> = self
            .spots_of(unit)
            .flat_map(|spot| self.planned.problem.target().neighbours_of(spot))
            .filter_map(|spot| holders.get(&spot).copied())
            .collect();
        if adjacent
            .iter()
            .any(|&module| self.is_pinned(module) || unit.waited_for.contains(&module))
        {
            return true;
        }
        let wanted: BTreeSet<ModuleId> = adjacent
            .into_iter()
            .filter_map(|module| self.unit_of(module))
            .filter(|lead| !unit.modules.contains(lead))
            .collect();
        let mut past = unit.after.clone();
        let mut open: Vec<ModuleId> = past.iter().copied().collect();
        while let Some(earlier) = open.pop() {
            if wanted.contains(&earlier) {
                return true;
            }
            let further = self.units.get(&earlier).map(|unit| &unit.after);
            open.extend(
                further
                    .into_iter()
                    .flatten()
                    .filter(|&&one| past.insert(one)),
            );
        }
        false
    }
}
