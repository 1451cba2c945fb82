//! In which order units take their turns.
//!
//! The paper, section "Planning Phase": units take turns by the distance of their leader from the target's centre.
//! The option `size_first` lets larger configurations go first, which breaks fewer links.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::model::{MicroUnits, ModuleId, TurnOrder};
use crate::planner::assignment::Instance;

/// Modules that take one turn together: a single one, or a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Unit {
    /// The module that decides.
    pub(crate) leader: usize,
    /// All modules, ascending.
    pub(crate) members: Vec<usize>,
}

impl Unit {
    pub(crate) fn single(module: usize) -> Self {
        Self {
            leader: module,
            members: vec![module],
        }
    }

    pub(crate) fn is_block(&self) -> bool {
        self.members.len() > 1
    }
}

type Key = (Reverse<usize>, MicroUnits, ModuleId);

/// The units that have not taken their turn.
#[derive(Clone, Debug)]
pub(crate) struct TurnQueue {
    order: TurnOrder,
    waiting: BTreeMap<Key, Unit>,
    block_count: usize,
    /// Modules that left a configuration singly; they wait until no configuration is left.
    deferred: Vec<usize>,
}

impl TurnQueue {
    pub(crate) fn new(order: TurnOrder) -> Self {
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

    /// Adds a unit at its place among those that wait.
    pub(crate) fn insert(&mut self, instance: &Instance, unit: Unit) {
        self.block_count += usize::from(unit.is_block());
        self.waiting.insert(self.key(instance, &unit), unit);
    }

    /// Adds what is left of a configuration: a component of several modules waits like any configuration, led by its
    /// member of best rank; a single module waits until no configuration is left.
    pub(crate) fn insert_remainder(&mut self, instance: &Instance, components: &[Vec<usize>]) {
        for component in components {
            if component.len() > 1 {
                let unit = Unit {
                    leader: instance.leader_among(component),
                    members: component.clone(),
                };
                self.insert(instance, unit);
            } else {
                self.deferred.extend_from_slice(component);
            }
        }
        if self.block_count == 0 {
            for module in std::mem::take(&mut self.deferred) {
                self.insert(instance, Unit::single(module));
            }
        }
    }

    /// The unit whose turn it is.
    pub(crate) fn next(&self) -> Option<&Unit> {
        self.waiting.first_key_value().map(|(_, unit)| unit)
    }

    /// Whether a configuration waits beside the unit whose turn it is.
    pub(crate) fn has_other_blocks(&self) -> bool {
        self.block_count > usize::from(self.next().is_some_and(Unit::is_block))
    }

    /// Whether the unit whose turn it is comes last, unless it leaves a remainder.
    pub(crate) fn has_one_unit(&self) -> bool {
        self.waiting.len() == 1 && self.deferred.is_empty()
    }

    /// Takes the unit whose turn it is off the queue; to be followed by [`Self::insert_remainder`].
    pub(crate) fn pop(&mut self) -> Option<Unit> {
        let (_, unit) = self.waiting.pop_first()?;
        self.block_count -= usize::from(unit.is_block());
        Some(unit)
    }
}
