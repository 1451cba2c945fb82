//! The order in which units take their turns.
//!
//! The paper, section "Planning Phase": units take turns by the distance of their leader from the target's centre.
//! With the option `size_first`, larger configurations come first, which breaks fewer links.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::assignment::Instance;
use formation_model::{MicroUnits, ModuleId, TurnOrder};

/// Modules that take one turn together: a single one, or a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Unit {
    /// The module that decides.
    pub(super) leader: usize,
    /// All modules, ascending.
    pub(super) members: Vec<usize>,
}

impl Unit {
    pub(super) fn single(module: usize) -> Self {
        Self {
            leader: module,
            members: vec![module],
        }
    }

    pub(super) fn is_block(&self) -> bool {
        self.members.len() > 1
    }
}

type Key = (Reverse<usize>, MicroUnits, ModuleId);

/// The units that have not taken their turn, in the order of their turns.
#[derive(Clone, Debug)]
pub(super) struct TurnQueue {
    order: TurnOrder,
    waiting: BTreeMap<Key, Unit>,
    block_count: usize,
    /// Modules that left a configuration as single ones; they take their turns after the last configuration.
    deferred: Vec<usize>,
}

impl TurnQueue {
    pub(super) fn new(order: TurnOrder) -> Self {
        Self {
            order,
            waiting: BTreeMap::new(),
            block_count: 0,
            deferred: Vec::new(),
        }
    }

    fn key(&self, instance: &Instance, unit: &Unit) -> Key {
        let size = match self.order {
            TurnOrder::Rank => 0,
            TurnOrder::SizeFirst => unit.members.len(),
        };
        let (distance, id) = instance.ranks[unit.leader];
        (Reverse(size), distance, id)
    }

    /// Adds a unit at its place in the order.
    pub(super) fn insert(&mut self, instance: &Instance, unit: Unit) {
        self.block_count += usize::from(unit.is_block());
        self.waiting.insert(self.key(instance, &unit), unit);
    }

    /// Adds the remainder of a configuration. A component of several modules takes a turn like any configuration, led by its
    /// lowest-ranked member; a single module takes its turn after the last configuration.
    pub(super) fn insert_remainder(&mut self, instance: &Instance, components: &[Vec<usize>]) {
        for component in components {
            match instance.leader_among(component) {
                Some(leader) if component.len() > 1 => {
                    let members = component.clone();
                    self.insert(instance, Unit { leader, members });
                }
                _ => self.deferred.extend_from_slice(component),
            }
        }
        if self.block_count == 0 {
            for module in std::mem::take(&mut self.deferred) {
                self.insert(instance, Unit::single(module));
            }
        }
    }

    /// The unit whose turn it is.
    pub(super) fn next(&self) -> Option<&Unit> {
        self.waiting.first_key_value().map(|(_, unit)| unit)
    }

    /// The number of turns to come, as far as it is known.
    pub(super) fn len(&self) -> usize {
        self.waiting.len() + self.deferred.len()
    }

    /// Whether another configuration follows the unit whose turn it is.
    pub(super) fn has_other_blocks(&self) -> bool {
        self.block_count > usize::from(self.next().is_some_and(Unit::is_block))
    }

    /// The configurations that have not taken their turn.
    pub(super) fn block_count(&self) -> usize {
        self.block_count
    }

    /// Whether the unit whose turn it is has to finish the allocation once it has its spots: with `exact_finish` and a bounded
    /// `d_max`, the last unit, unless it leaves a remainder.
    pub(super) fn exact_finish_is_due(&self, instance: &Instance) -> bool {
        let parameters = instance.problem.parameters();
        let is_last = self.waiting.len() == 1 && self.deferred.is_empty();
        parameters.exact_finish && parameters.d_max.is_some() && is_last
    }

    /// Removes the unit whose turn it is; the caller then calls [`Self::insert_remainder`].
    pub(super) fn pop(&mut self) -> Option<Unit> {
        let (_, unit) = self.waiting.pop_first()?;
        self.block_count -= usize::from(unit.is_block());
        Some(unit)
    }
}
