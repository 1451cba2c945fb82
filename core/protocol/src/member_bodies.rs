//! What an agent records of the bodies of others: when it leaves an epoch, for its store, and as they show themselves.

use formation_model::{
    BodyReport, ModuleState, Pose, Roster, RosterMember, Timing, Whereabouts, blocked_spots,
};

use super::Agent;
use super::peer::Peer;
use super::refusal::Refusal;
use super::stage::{HeldPlan, Stage};

impl Agent {
    /// Records, before an epoch is left, where its other members stand or may be on their way.
    /// Enforces B2.
    pub(super) fn remember_members(&mut self) {
        let reports = self.member_reports();
        self.context.bodies.note_ascending(reports.into_iter());
    }

    /// Where the other members of the present roster stand or may be on their way, in ascending order.
    fn member_reports(&self) -> Vec<BodyReport> {
        let mut reports = Vec::new();
        let Some(roster) = self.stage.roster() else {
            return reports;
        };
        let is_outside = matches!(self.stage, Stage::Outsider(_));
        let held = self.stage.held_plan();
        let own = self.context.module();
        let places = held.map(HeldPlan::places).unwrap_or_default();
        let others = roster
            .members
            .iter()
            .filter(|member| member.module.id != own);
        let others = others.map(|member| (member.module.id, member));
        for (module, member, peer) in self.context.peers.along(others) {
            let (pose, sequence) = seen_in(roster, member, peer);
            let whereabouts = match held {
                _ if is_outside => Whereabouts::Seen(pose),
                Some(held) => {
                    let place = places.get(&module).copied();
                    held.whereabouts((module, place), pose, peer)
                }
                None => Whereabouts::Halted(pose),
            };
            reports.push(BodyReport {
                module,
                incarnation: member.incarnation,
                epoch: Some(roster.epoch),
                sequence,
                whereabouts,
            });
        }
        reports
    }

    /// What the store holds of the bodies of others: where each may be until the next write, which comes before this module
    /// acts on another plan. A member may act meanwhile, so each may be on its way to the goal that the plan gives it. What the roster of
    /// the plan lists as removed is.
    pub(super) fn bodies_to_store(&self) -> Vec<BodyReport> {
        let mut bodies = self.context.bodies.clone();
        bodies.note_states(self.context.peers.states());
        bodies.note_ascending(self.member_reports().into_iter());
        if let Some(held) = self.stage.held_plan() {
            for report in self.context.removals.in_effect_by(&held.roster) {
                bodies.note(report.clone());
            }
        }
        bodies.into_reports().collect()
    }

    /// Takes over the bodies that the store of this module holds.
    pub(super) fn restore_bodies(&mut self, stored: &[BodyReport]) {
        for report in stored {
            self.context.bodies.note(report.clone());
        }
    }

    /// Records where a module shows itself that is no member of the present roster. Members are recorded when their epoch is
    /// left.
    pub(super) fn note_body(&mut self, state: &ModuleState) {
        let roster = self.stage.roster();
        let is_member =
            roster.is_some_and(|roster| blocked_spots::lists(&roster.members, state.module));
        if !is_member {
            self.context.bodies.note_state(state);
        }
    }

    /// Records where a module of another session shows itself. Its epochs are not those of this session.
    /// Enforces B6.
    pub(super) fn handle_other_session_state(&mut self, state: &ModuleState) {
        let report = BodyReport {
            module: state.module,
            incarnation: state.incarnation,
            epoch: None,
            sequence: state.sequence,
            whereabouts: Whereabouts::Seen(state.pose),
        };
        let context = &mut self.context;
        if !context.is_plausible(report.incarnation.0) {
            return;
        }
        let module = report.module;
        let is_own = module == context.module() || context.peers.get(module).is_some();
        if is_own || !context.bodies.note_of_other_session(report) {
            context.refuse(Some(module), Refusal::NumberOfOtherSession);
        }
    }

    /// Whether the latest roster that it took over lists it, or it waits for one.
    #[must_use]
    pub fn is_member(&self) -> bool {
        let own = self.context.module();
        let roster = self.stage.roster();
        matches!(self.stage, Stage::Gathering(_))
            || roster.is_some_and(|roster| blocked_spots::lists(&roster.members, own))
    }

    /// The times that its roster names, or would.
    #[must_use]
    pub fn timing(&self) -> Timing {
        self.context.parameters.timing()
    }
}

/// Where a member was last seen in the epoch of a roster, and the sequence number of the state that showed it.
fn seen_in(roster: &Roster, member: &RosterMember, peer: Option<&Peer>) -> (Pose, u64) {
    let state = peer.and_then(|peer| peer.state.as_ref()).filter(|state| {
        state.incarnation == member.incarnation && state.epoch == Some(roster.epoch)
    });
    state.map_or((member.module.pose, 0), |state| {
        (state.pose, state.sequence)
    })
}
