//! Gathering: the members halt and freeze, and the convener collects their states into a roster.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ClosedRoster, Digest, Epoch, GivenRefused, Incarnation, Message, ModuleId, ModulePhase,
    ModuleState, PlanningModule, ProblemError, Roster, RosterMember, RosterMessage, Service,
    TargetAnnouncement, digest,
};

use super::super::context::Context;
use super::super::event::{EpochReason, Event};
use super::super::pins;
use super::super::session::{shortfall_of, votes_of};

use super::claims::EarlyClaims;
use super::planning::Planning;
use super::{Stage, Transition};

/// An epoch whose members are being gathered.
#[derive(Clone, Hash)]
pub(crate) struct Gathering {
    pub epoch: Epoch,
    since: Duration,
    /// Since when a member waits for a convener that does not compute which pins stay.
    waits_since: Duration,
    /// The target that the gathering is for, unless another is announced meanwhile: the members freeze with pins for this one.
    target: Digest,
    role: Part,
    /// The claims of members that received the roster earlier than this module.
    pub claims: EarlyClaims,
}

/// This module's part in a gathering.
#[derive(Clone, Hash)]
enum Part {
    /// It waits for the roster of this run of the convener.
    Member(Incarnation),
    /// It is the convener.
    Convener(Collection),
}

/// The progress of a convener's collection.
#[derive(Clone, Hash)]
struct Collection {
    /// The number of frozen members, this module included.
    frozen: usize,
    /// When the number of frozen members last changed.
    changed_at: Duration,
    reported_missing: bool,
    reported_limit: bool,
    /// Whether the plan that shows which pins stay is being computed.
    computes: bool,
    /// Why the allocation that the target gives cannot be carried out, as last reported.
    refused: Option<GivenRefused>,
}

/// Whether a collection is complete.
enum Collected {
    Incomplete,
    Complete { reports_limit: bool },
}

impl Gathering {
    /// Opens an epoch.
    pub fn convene(
        context: &mut Context,
        announcement: &TargetAnnouncement,
        reason: EpochReason,
    ) -> Self {
        let epoch = context.session.next_epoch(context.module());
        context.emit(Event::Convened(epoch, reason));
        let target = digest::of_target(announcement);
        context.publish(Message::Roster(RosterMessage::Gather {
            epoch,
            target_revision: announcement.revision,
            target,
        }));
        let collection = Collection {
            frozen: 0,
            changed_at: context.now,
            reported_missing: false,
            reported_limit: false,
            computes: false,
            refused: None,
        };
        Self::enter(context, epoch, target, Part::Convener(collection))
    }

    /// Halts for an epoch that this run of its convener has opened.
    pub fn join(
        context: &mut Context,
        epoch: Epoch,
        convener: Incarnation,
        target: Digest,
    ) -> Self {
        Self::enter(context, epoch, target, Part::Member(convener))
    }

    fn enter(context: &mut Context, epoch: Epoch, target: Digest, role: Part) -> Self {
        context.stand_still();
        context.note_opened(epoch);
        context.freeze();
        context.set_shortfall(None);
        context.mark_state_changed();
        context.emit(Event::Gathered(epoch));
        Self {
            epoch,
            since: context.now,
            waits_since: context.now,
            target,
            role,
            claims: EarlyClaims::default(),
        }
    }

    /// Whether this module convenes.
    pub fn is_convener(&self) -> bool {
        matches!(self.role, Part::Convener(_))
    }

    pub fn phase(&self) -> ModulePhase {
        match &self.role {
            Part::Convener(collection) if collection.computes => ModulePhase::Computing,
            Part::Convener(_) | Part::Member(_) => ModulePhase::Gathered,
        }
    }

    pub fn describe(&self, state: &mut ModuleState, context: &mut Context) {
        state.bodies = context.absent_bodies();
        context.describe_removals(state, self.epoch, self.since);
        state.spot = context.pin_for(|| self.target);
        let voters = context.session.voters();
        state.removed_voters.clone_from(&voters.removed);
        state.listed_voters.clone_from(&voters.listed);
        let frozen = &context.session.shown.frozen;
        (state.is_idle, state.last_plan) = (frozen.is_idle, frozen.last_plan);
    }

    /// Why a member no longer waits for the roster, if so.
    /// Enforces G6.
    pub fn doubt(&self, context: &mut Context) -> Option<EpochReason> {
        let Part::Member(incarnation) = self.role else {
            return None;
        };
        let refused = context.removals.refused_in(self.epoch);
        if let Some(reason) = refused.or_else(|| context.bodies.contested_in(self.epoch)) {
            return Some(reason);
        }
        if let Some((_, moved)) = context
            .robot
            .moved_in
            .filter(|(epoch, _)| *epoch == self.epoch)
        {
            return Some(EpochReason::Displaced(vec![(context.module(), moved)]));
        }
        let convener = self.epoch.convener;
        let peer = context.peers.get(convener);
        let is_live = context.peers.is_live(context.liveness(), convener)
            && peer.is_some_and(|peer| peer.incarnation == incarnation);
        let patience = context.parameters.gather_limit + context.parameters.stuck;
        // A convener that has entered another epoch, or has planned without this module, will not end this gathering.
        let still_waits = peer
            .and_then(|peer| peer.heartbeat.as_ref())
            .is_some_and(|heartbeat| {
                heartbeat.phase == ModulePhase::WaitingForQuorum
                    && heartbeat.epoch == Some(self.epoch)
                    && heartbeat.digest.is_none()
            });
        let is_overdue = context.now > self.waits_since + patience
            && !(still_waits && context.live_shortfall().is_some());
        let has_left = context.peers.heartbeat(convener).is_some_and(|heartbeat| {
            heartbeat.epoch == Some(self.epoch) && heartbeat.phase == ModulePhase::Listening
        });
        let is_over = !is_live || has_left || is_overdue;
        if is_over {
            return Some(EpochReason::ConvenerSilent(convener));
        }
        let is_received = context.clique().binary_search(&convener).is_ok();
        (!is_received).then(|| EpochReason::NotReceived(vec![convener]))
    }

    /// Waits for the roster; as the convener, publishes it once all members have frozen or the time is up.
    pub fn step(mut self, context: &mut Context) -> Transition {
        let Part::Convener(collection) = &mut self.role else {
            let computes = context.peers.computes(self.epoch.convener, self.epoch);
            if computes && context.now <= self.since + context.parameters.plan_limit {
                self.waits_since = context.now;
            }
            return Transition::Stay(Stage::Gathering(self));
        };
        if !context.can_convene() {
            return Transition::Stay(Stage::Listening(Some(self.epoch)));
        }
        let frozen = frozen_states(self.epoch, context);
        let frozen = receiving_each_other(frozen, context);
        let progress = collection.advance(self.since, &frozen, context);
        let Collected::Complete { reports_limit } = progress else {
            return Transition::Stay(Stage::Gathering(self));
        };
        if !context.robot.is_at_rest() {
            return Transition::Stay(Stage::Gathering(self));
        }
        context.learn_bodies(&frozen, self.since);
        if reports_limit {
            report_missing(&frozen, context);
        }
        collection.computes = false;
        self.close(&frozen, context)
    }

    /// Waits for more modules, as no roster can be made of those that have frozen. Live modules that show a later epoch do not
    /// come back to this one, so they are called to another.
    /// Enforces E3.
    fn wait_for_others(
        self,
        announcement: &TargetAnnouncement,
        context: &mut Context,
    ) -> Transition {
        let live = context.peers.live(context.liveness());
        let ahead = live.filter(|(_, peer)| peer.is_ahead_of(self.epoch));
        let ahead: Vec<ModuleId> = ahead.map(|(module, _)| module).collect();
        let own = context.module();
        let is_left_out = context.clique().binary_search(&own).is_err();
        if ahead.is_empty() || is_left_out || context.is_led(Some(self.epoch)) {
            context.pacing.clear_reason();
            return Transition::Stay(Stage::Gathering(self));
        }
        // The call of one that is ahead may be on its way.
        let due = context.pacing.due(context.now, context.parameters.convene);
        if context.now < due {
            context.wake_at(due);
            return Transition::Stay(Stage::Gathering(self));
        }
        let next = Self::convene(context, announcement, EpochReason::MembersAhead(ahead));
        Transition::Enter(Stage::Gathering(next))
    }

    /// Reports that these modules cannot carry out the allocation that the target gives, once for each reason, and waits for
    /// other modules, or another target.
    fn refuse_given(
        mut self,
        announcement: &TargetAnnouncement,
        reason: GivenRefused,
        context: &mut Context,
    ) -> Transition {
        if let Part::Convener(collection) = &mut self.role {
            collection.computes = false;
            if collection.refused.as_ref() != Some(&reason) {
                collection.refused = Some(reason.clone());
                context.emit(Event::GivenRefused(reason));
            }
        }
        self.wait_for_others(announcement, context)
    }

    /// Publishes the roster, unless it lacks a quorum or the target has changed.
    /// Enforces G5.
    fn close(mut self, frozen: &[Arc<ModuleState>], context: &mut Context) -> Transition {
        let Some(announcement) = context.target.announcement().cloned() else {
            return Transition::Stay(Stage::Gathering(self));
        };
        let mut members: Vec<RosterMember> = frozen.iter().map(|state| member_of(state)).collect();
        members.push(context.as_member(|| digest::of_target(&announcement)));
        members.sort_by_key(|member| member.module.id);
        if follows_last_plan(&members, frozen, context) {
            members.iter_mut().for_each(|member| member.is_idle = true);
        }
        let is_active = |member: &RosterMember| member.service == Service::Active;
        let some_is_active = members.iter().any(is_active);
        let voters = context
            .session
            .voters_for(frozen, context.removals.due_votes());
        let mut roster = Roster {
            epoch: self.epoch,
            target: (*announcement).clone(),
            bodies: context.bodies_outside(&members, self.epoch),
            members,
            voters,
            timing: context.parameters.timing(),
        };
        let votes = votes_of(&roster.members);
        let shortfall = shortfall_of(&roster.voters, votes, Some(&announcement));
        context.set_shortfall(shortfall);
        if shortfall.is_some() {
            if context.live_shortfall().is_none() {
                return self.wait_for_others(&announcement, context);
            }
            // The members stay frozen, and the gathering continues when more modules are within reach.
            return Transition::Stay(Stage::Gathering(self));
        }
        // Judged after the quorum: a group without one waits for it, even if nothing could be planned.
        if !some_is_active {
            return self.wait_for_others(&announcement, context);
        }
        let Some(open) = roster.open_target() else {
            // Bodies block every spot. The state of this module lists them.
            if context.report_blocked(roster.blocked_spots()) {
                context.mark_state_changed();
            }
            return self.wait_for_others(&announcement, context);
        };
        if self.target != digest::of_target(&announcement) {
            // Another target was announced since. The members froze with pins for the former one, and have to announce
            // their pins for the new one.
            let next = Self::convene(context, &announcement, EpochReason::NewTarget);
            return Transition::Enter(Stage::Gathering(next));
        }
        if pins::release(&mut roster, &open, context).is_none() {
            if let Part::Convener(collection) = &mut self.role {
                collection.computes = true;
            }
            return Transition::Stay(Stage::Gathering(self));
        }
        let roster = Arc::new(ClosedRoster::from(roster));
        if let Err(ProblemError::Given(reason)) = roster.problem() {
            return self.refuse_given(&announcement, reason, context);
        }
        let plan = RosterMessage::Plan(Arc::clone(&roster));
        context.publish(Message::Roster(plan));
        match Planning::begin(roster, context) {
            Some(planning) => {
                let planning = planning.with_claims(self.claims);
                Transition::Enter(Stage::Planning(Box::new(planning)))
            }
            None => Transition::Stay(Stage::Gathering(self)),
        }
    }
}

impl Collection {
    /// Counts the frozen members, and judges whether the roster may be closed.
    /// Enforces G2.
    fn advance(
        &mut self,
        since: Duration,
        frozen: &[Arc<ModuleState>],
        context: &mut Context,
    ) -> Collected {
        let count = frozen.len() + usize::from(context.robot.is_at_rest());
        if count != self.frozen {
            self.frozen = count;
            self.changed_at = context.now;
        }
        let quiet_at = self.changed_at + context.parameters.gather;
        let limit_at = since + context.parameters.gather_limit;
        let is_quiet = context.now >= quiet_at;
        // Only the first roster waits for a number; later ones replace members that may be gone for good.
        let is_first = !context.session.number_was_met && !context.session.has_seen_plan;
        let expected = context.target.expected_modules().filter(|_| is_first);
        let is_complete = match expected {
            Some(expected) if context.running() < expected as usize => false,
            // What heartbeats list may be over by now, so one that is left out is waited for as well.
            Some(expected) if context.missed_pairs().is_empty() => count >= expected as usize,
            _ => is_quiet || count >= context.live_modules().len(),
        };
        if is_complete {
            return Collected::Complete {
                reports_limit: false,
            };
        }
        if context.now >= limit_at {
            let reports_limit = !std::mem::replace(&mut self.reported_limit, true);
            return Collected::Complete { reports_limit };
        }
        if is_quiet && !std::mem::replace(&mut self.reported_missing, true) {
            report_missing(frozen, context);
        }
        context.wake_at(quiet_at);
        context.wake_at(limit_at);
        Collected::Incomplete
    }
}

/// The states of the live modules that have frozen for this epoch, and that are not about to take a later number.
fn frozen_states(epoch: Epoch, context: &Context) -> Vec<Arc<ModuleState>> {
    context
        .peers
        .live(context.liveness())
        .filter_map(|(_, peer)| peer.state.clone())
        .filter(|state| state.epoch == Some(epoch) && state.phase == ModulePhase::Gathered)
        .filter(|state| !context.is_outdated(state.module))
        .collect()
}

/// Those of some frozen modules that form the best clique with this one.
/// Enforces G2.
fn receiving_each_other(
    frozen: Vec<Arc<ModuleState>>,
    context: &mut Context,
) -> Vec<Arc<ModuleState>> {
    let own = context.module();
    let mut missed = context.missed_pairs().to_vec();
    if missed.is_empty() {
        return frozen;
    }
    let of_own = missed
        .iter()
        .filter(|(one, other)| *one == own || *other == own);
    let of_own: BTreeSet<ModuleId> = of_own.flat_map(|&(one, other)| [one, other]).collect();
    let is_candidate = |module: ModuleId| module == own || !of_own.contains(&module);
    let candidates = frozen.iter().map(|state| state.module);
    let candidates: BTreeSet<ModuleId> = candidates
        .filter(|&module| is_candidate(module))
        .chain([own])
        .collect();
    let mut votes = context.live_votes();
    votes.retain(|(module, _)| candidates.contains(module));
    missed.retain(|(one, other)| candidates.contains(one) && candidates.contains(other));
    let clique = context.clique_of(votes, missed);
    let is_in = |state: &Arc<ModuleState>| clique.binary_search(&state.module).is_ok();
    frozen.into_iter().filter(is_in).collect()
}

/// Whether all who can be in motion are members, frozen: each of them is idle, or can have shown no plan within the lease but the last one
/// of this module, whose members are all here. A run that is not in that plan counts for the one that is if it knows of the plan, as
/// the next run of a process does; another process might not be the only one.
/// Enforces A2.
fn follows_last_plan(
    members: &[RosterMember],
    frozen: &[Arc<ModuleState>],
    context: &Context,
) -> bool {
    let Some(last) = context.session.shown.frozen_with() else {
        return false;
    };
    let digest = Some(last.digest());
    let showed = frozen.iter().filter(|state| state.last_plan == digest);
    let mut showed: BTreeSet<ModuleId> = showed.map(|state| state.module).collect();
    showed.insert(context.module());
    let is_known = |state: &Arc<ModuleState>| state.is_idle || showed.contains(&state.module);
    last.is_within(members, |module| showed.contains(&module)) && frozen.iter().all(is_known)
}

fn report_missing(frozen: &[Arc<ModuleState>], context: &mut Context) {
    let present: BTreeSet<ModuleId> = frozen.iter().map(|state| state.module).collect();
    let named = frozen
        .iter()
        .flat_map(|state| state.links.iter().copied())
        .chain(context.robot.links.iter().copied())
        .chain(context.live_modules());
    let absent: BTreeSet<ModuleId> = named
        .filter(|id| *id != context.module() && !present.contains(id))
        .collect();
    context.emit(Event::Missing {
        expected: context.target.expected_modules(),
        gathered: present.len() + 1,
        absent: absent.into_iter().collect(),
    });
}

fn member_of(state: &ModuleState) -> RosterMember {
    RosterMember {
        incarnation: state.incarnation,
        knows: state.knows,
        is_idle: state.is_idle,
        service: state.service,
        module: PlanningModule {
            id: state.module,
            pose: state.pose,
            links: state.links.clone(),
            configuration: state.configuration,
            leader: state.leader,
            pin: state.spot,
        },
    }
}
