//! What a module's states prove to observers, so that they can judge the order of motions without clocks.

use std::collections::BTreeSet;

use formation_model::{CausalMark, ModuleId, ModuleState};

use super::super::context::Context;
use super::super::roster_plan::Place;
use super::HeldPlan;
use super::route::Route;

/// The proofs in the states of one module; empty before it moves.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Proofs {
    /// The settled states that it waited for.
    waited_for: Vec<CausalMark>,
    /// If it leads the first unit to move: the heartbeat of every member that showed agreement.
    agreed_on: Vec<CausalMark>,
    /// The sequence number of the first state that showed it settled; 0 before.
    settled_since: u64,
}

impl Proofs {
    /// The proofs of a module that leaves for its place: the lead of the first unit names the heartbeat of every member that showed
    /// agreement.
    /// Enforces X5.
    pub fn of_departure(held: &HeldPlan, place: Place, context: &Context) -> Self {
        let units = &held.plan.assembly.units;
        let leads = held.unit_of(place).lead == context.module();
        match leads && units[..place.unit].iter().all(|unit| unit.pinned) {
            true => Self::of_agreement(held, context),
            false => Self::default(),
        }
    }

    /// The heartbeat of every member that showed agreement.
    fn of_agreement(held: &HeldPlan, context: &Context) -> Self {
        let members = held.roster_plan.members.keys();
        Self {
            agreed_on: members
                .filter_map(|&module| heartbeat_mark(module, context))
                .collect(),
            ..Self::default()
        }
    }

    /// The proofs of a module without a spot that makes way: those of agreement, if no module with a spot moves. Otherwise the lead
    /// of the first unit has them.
    /// Enforces X5.
    pub fn of_making_way(held: &HeldPlan, context: &Context) -> Self {
        let mut units = held.plan.assembly.units.iter();
        match units.all(|unit| unit.pinned) {
            true => Self::of_agreement(held, context),
            false => Self::default(),
        }
    }

    /// The module has docked: it waited for the unit to which its unit docks, and for the holders next to its spot that
    /// are placed before it.
    pub fn note_docked(&mut self, held: &HeldPlan, place: Place, context: &Context) {
        let unit = &held.unit_of(place).placements;
        let parents = held.motion.route.iter().flat_map(Route::parents);
        let causes: BTreeSet<ModuleId> = parents.chain(held.docks_with(place)).collect();
        self.waited_for = causes
            .into_iter()
            .filter(|&partner| unit.iter().all(|&(module, _)| module != partner))
            .filter_map(|module| held.settled_mark(&context.peers, module))
            .collect();
    }

    /// The state with this sequence number shows that the module has settled.
    /// Enforces X5.
    pub fn note_settled(&mut self, sequence: u64) {
        if self.settled_since == 0 {
            self.settled_since = sequence;
        }
    }

    pub fn describe(&self, state: &mut ModuleState) {
        state.settled_since = self.settled_since;
        state.waited_for.clone_from(&self.waited_for);
        state.agreed_on.clone_from(&self.agreed_on);
    }
}

/// The mark of a module's latest heartbeat.
fn heartbeat_mark(module: ModuleId, context: &Context) -> Option<CausalMark> {
    let sequence = if module == context.module() {
        context.outbox.heartbeats.sequence
    } else {
        context.peers.heartbeat(module)?.sequence
    };
    Some(CausalMark { module, sequence })
}
