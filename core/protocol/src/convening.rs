//! Opening epochs: which module convenes, when, and why.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    BodyReport, DriveState, Epoch, ModuleId, ModulePhase, ModuleRun, Roster, RosterMember, Service,
    SpotId, Whereabouts,
};

use super::Agent;
use super::context::Context;
use super::event::EpochReason;
use super::peer::Peer;
use super::stage::{Gathering, Stage};

impl Agent {
    /// Opens an epoch when there has been a reason for long enough and it is this module's turn to do so.
    /// Enforces E4, Q6.
    pub(super) fn consider_new_epoch(&mut self) {
        if matches!(&self.stage, Stage::Gathering(gathering) if gathering.is_convener()) {
            return;
        }
        let context = &mut self.context;
        if !context.can_convene() {
            return;
        }
        let Some(reason) = self.stage.doubt(context) else {
            context.pacing.clear_reason();
            context.set_shortfall(None);
            return;
        };
        let clique = context.clique();
        let own = context.module();
        if context.is_led(self.stage.epoch()) || clique.binary_search(&own).is_err() {
            // Those that all receive each other convene; this module would keep some of them out.
            context.pacing.clear_reason();
            context.set_shortfall(None);
            return;
        }
        let live = context.live_modules();
        let expected = context.target.expected_modules();
        let all_are_live = expected.is_some_and(|expected| live.len() >= expected as usize);
        if all_are_live && live.iter().all(|&module| is_in_no_epoch(module, context)) {
            context.pacing.end_listening(context.now);
        }
        // A module that was moved knows best where it stands, and one that refuses a roster why; neither waits for its turn.
        let is_own = match &reason {
            EpochReason::Displaced(displaced) => displaced.iter().any(|&(one, _)| one == own),
            EpochReason::RemovalsRefused(_) => true,
            _ => false,
        };
        let delay = (clique.iter().take_while(|&&module| module < own && !is_own))
            .fold(Duration::ZERO, |delay, _| {
                delay.saturating_add(context.parameters.convene)
            });
        let due = context.pacing.due(context.now, delay);
        let target = context.target.announcement().cloned();
        if context.now < due {
            if context.shortfall.is_some() && context.live_shortfall().is_none() {
                // Modules are back: the plan goes on, as long as no other epoch is opened.
                context.set_shortfall(None);
            }
            context.wake_at(due);
            return;
        }
        let shortfall = context.live_shortfall();
        context.set_shortfall(shortfall);
        if shortfall.is_none()
            && let Some(announcement) = target
        {
            self.remember_members();
            let gathering = Gathering::convene(&mut self.context, &announcement, reason);
            self.stage = Stage::Gathering(gathering);
            self.run_stage();
        }
    }
}

/// Whether a module's latest heartbeat shows that it is in no epoch; a run that goes on from an earlier one knows of epochs all the same.
fn is_in_no_epoch(module: ModuleId, context: &Context) -> bool {
    let heartbeat = context.peers.heartbeat(module);
    heartbeat.is_none_or(|heartbeat| heartbeat.phase == ModulePhase::Listening)
}

/// The modules whose bodies a roster lists and that are in the way no more: the body was removed, or a roster may say so, or its module
/// can take part.
fn bodies_gone(roster: &Roster, context: &mut Context) -> Vec<ModuleId> {
    let was_removed = |body: &BodyReport| body.whereabouts == Whereabouts::Removed;
    let listed = roster.bodies.iter().filter(|body| !was_removed(body));
    let clique = context.clique();
    let is_gone = |module: ModuleId| {
        let takes_part = context.peers.is_live(context.liveness(), module)
            && stands(module, context)
            && hears(module, roster.epoch, context)
            && !context.is_outdated(module)
            && clique.binary_search(&module).is_ok();
        takes_part || context.is_removable(module)
    };
    let gone = listed.filter(|body| is_gone(body.module));
    gone.map(|body| body.module).collect()
}

impl Stage {
    /// Why the present epoch does not lead, or no longer leads, to a formation of the target, if so.
    /// Enforces E3.
    fn doubt(&self, context: &mut Context) -> Option<EpochReason> {
        let roster = match self {
            Self::Gathering(gathering) => return gathering.doubt(context),
            _ => match self.roster() {
                Some(roster) => roster,
                None => return Some(EpochReason::NewTarget),
            },
        };
        let outside_since = match self {
            Self::Outsider(outsider) => Some(outsider.since),
            _ => None,
        };
        let judged = (
            roster.epoch,
            context.target.revision(),
            context.robot.service,
            context.bodies.version(),
        );
        let is_calm = outside_since.is_none() && context.peers.is_calm(context.now, judged);
        if !is_calm && let Err(verdict) = judge_members(roster, outside_since, context) {
            return verdict;
        }
        if let Self::Acting(acting) = self
            && let Some(reason) = acting.displaced(context)
        {
            return Some(reason);
        }
        let stuck = self.stuck_members(context);
        if stuck.contains(&context.module()) {
            // The others leave this module out; were it to convene, it would list itself again.
            return None;
        }
        let ahead = ahead_of(roster, stuck.iter().copied(), context);
        if !ahead.is_empty() {
            // They make progress, without this module. Were their channels taken for failed, it would lack them for a quorum.
            return Some(EpochReason::MembersAhead(ahead));
        }
        if !stuck.is_empty() {
            context.leave_out(&stuck);
            return Some(EpochReason::Stuck(stuck));
        }
        let has_mismatch = self.held_plan().is_some_and(|held| held.has_mismatch);
        if has_mismatch && context.session.mismatches <= 1 {
            return Some(EpochReason::DigestMismatch);
        }
        let votes: Vec<ModuleId> = context.removals.due_votes().collect();
        // Votes that nobody misses yet go with the next epoch.
        if !votes.is_empty() && outside_since.is_none() && context.depends_on_each_voter() {
            return Some(EpochReason::VotesRemoved(votes));
        }
        let held = self.held_plan();
        let is_to_fill = |spot: SpotId, context: &Context| {
            held.is_some_and(|held| held.is_to_fill(spot, context))
        };
        let is_in_the_way = |body: &BodyReport, context: &Context| {
            held.is_some_and(|held| held.has_in_the_way(body, self.steps_done(), context))
        };
        if let Some(reason) = context.doubt_bodies(roster, is_to_fill, is_in_the_way) {
            return Some(reason);
        }
        if held.is_some_and(|held| held.refusal().is_some()) {
            let gone = bodies_gone(roster, context);
            if !gone.is_empty() {
                return Some(EpochReason::BodiesGone(gone));
            }
        }
        if is_calm {
            if let Some(due) = context.replaces_at() {
                context.wake_at(due);
            }
            return None;
        }
        match wanted_newcomers(roster, context) {
            Ok(newcomers) => Some(EpochReason::Newcomers(newcomers)),
            Err(due) => {
                context.peers.note_calm(context.liveness(), judged, due);
                None
            }
        }
    }

    /// The members that keep the epoch from going on: considered failed, they are left out of the next one.
    /// Enforces M6.
    fn stuck_members(&self, context: &Context) -> Vec<ModuleId> {
        match self {
            Self::Planning(planning) => planning.stuck_claimant(context).into_iter().collect(),
            Self::Agreeing(agreeing) => agreeing.stuck_members(context),
            Self::Acting(acting) => acting.stuck_members(context),
            Self::Listening(_) | Self::Gathering(_) | Self::Outsider(_) => Vec::new(),
        }
    }
}

/// Judges whether the members can go on with their roster; otherwise returns the reason for another epoch, or `None` if
/// others have to decide.
/// Enforces E6.
fn judge_members(
    roster: &Roster,
    outside_since: Option<Duration>,
    context: &mut Context,
) -> Result<(), Option<EpochReason>> {
    if context.has_replaced(&roster.target) {
        return Err(Some(EpochReason::NewTarget));
    }
    if let Some(since) = outside_since {
        let due = since + context.parameters.stuck;
        context.wake_at(due);
        let leads =
            |run: ModuleRun| context.now < due || follows(run.module, roster.epoch, context);
        let members = others(roster, context).map(RosterMember::run);
        let in_charge = members.filter(|&run| is_in_charge(run, context));
        if in_charge.clone().any(leads) {
            // The members judge which modules are missing and which are wanted. A module that receives nothing from a
            // member, or that does not receive all of them, would halt them again and again.
            return Err(None);
        }
        let refusing: Vec<ModuleId> = in_charge.map(|run| run.module).collect();
        if !refusing.is_empty() {
            return Err(Some(EpochReason::Stuck(refusing)));
        }
    }
    // Members that have gone on without this module judge who is missing. Were it to convene for that, it would halt them again
    // and again where it does not receive all of them.
    let gone_on = |run: &ModuleRun| {
        // One that has not frozen in that epoch may never stand, and then opens no other (E4).
        let state = context.peers.state(run.module);
        let has_frozen = state.is_some_and(|state| state.epoch > Some(roster.epoch));
        has_frozen && is_in_charge(*run, context)
    };
    let have_gone_on = (others(roster, context).map(RosterMember::run)).any(|run| gone_on(&run));
    if outside_since.is_none() && have_gone_on {
        return Ok(());
    }
    judge_missing(roster, context)?;
    let apart = not_received(roster, context);
    if !apart.is_empty() {
        return Err(Some(EpochReason::NotReceived(apart)));
    }
    // This epoch is over once a member waits for a quorum in a later one. To this module it looks complete: all members are live.
    let members = roster.members.iter().map(|member| member.module.id);
    let mut ahead = ahead_of(roster, members, context);
    ahead.retain(|&module| waits_for_quorum(module, context));
    if !ahead.is_empty() {
        return Err(Some(EpochReason::MembersAhead(ahead)));
    }
    let leaving = leaving(roster, context);
    if leaving.is_empty() {
        return Ok(());
    }
    let live = context.live_modules();
    let some_is_active = live.iter().any(|&module| context.is_active(module));
    Err(some_is_active.then_some(EpochReason::OutOfService(leaving)))
}

/// Those of some members that show a later epoch than that of the roster.
/// Enforces E6.
fn ahead_of(
    roster: &Roster,
    members: impl Iterator<Item = ModuleId>,
    context: &Context,
) -> Vec<ModuleId> {
    let is_ahead = |module: &ModuleId| {
        let peer = context.peers.get(*module);
        peer.is_some_and(|peer| peer.is_ahead_of(roster.epoch))
    };
    members.filter(is_ahead).collect()
}

/// The members other than this module.
fn others<'a>(
    roster: &'a Roster,
    context: &Context,
) -> impl Iterator<Item = &'a RosterMember> + Clone {
    let own = context.module();
    let members = roster.members.iter();
    members.filter(move |member| member.module.id != own)
}

/// Whether a member is live, in the run that the roster lists, and within reach of a quorum.
/// Enforces E6.
fn is_in_charge(run: ModuleRun, context: &Context) -> bool {
    context.peers.is_live(context.liveness(), run.module)
        && context
            .peers
            .heartbeat(run.module)
            .is_some_and(|heartbeat| {
                heartbeat.incarnation == run.incarnation
                    && heartbeat.phase != ModulePhase::WaitingForQuorum
            })
}

/// The members that have restarted, or else those that are not live. Those that have left may come back at once with another run, so
/// that they count once a lease has passed.
/// Enforces M9.
fn judge_missing(roster: &Roster, context: &mut Context) -> Result<(), Option<EpochReason>> {
    let liveness = context.liveness();
    let (mut restarted, mut silent, mut left_at) = (Vec::new(), Vec::new(), Vec::new());
    let others = others(roster, context).map(|member| (member.module.id, member.incarnation));
    for (module, incarnation, peer) in context.peers.along(others) {
        if peer.is_some_and(|peer| peer.has_replaced(incarnation)) {
            restarted.push(module);
        }
        if !peer.is_some_and(|peer| liveness.includes(peer)) {
            silent.push(module);
            left_at.extend(peer.and_then(|peer| peer.left_at));
        }
    }
    if !restarted.is_empty() {
        return Err(Some(EpochReason::Restarted(restarted)));
    }
    if silent.is_empty() {
        return Ok(());
    }
    let last = left_at
        .iter()
        .max()
        .filter(|_| left_at.len() == silent.len());
    let Some(&last) = last else {
        return Err(Some(EpochReason::Silent(silent)));
    };
    let due = last + context.parameters.lease;
    if context.now < due {
        context.wake_at(due);
        return Err(None);
    }
    Err(Some(EpochReason::Left(silent)))
}

/// The members that another one does not receive.
/// Enforces E3.
fn not_received(roster: &Roster, context: &mut Context) -> Vec<ModuleId> {
    let is_member = |module| roster.member(module).is_some();
    let pairs = context.missed_pairs();
    let pairs = pairs.iter().copied();
    let pairs = pairs.filter(|&(one, other)| is_member(one) && is_member(other));
    let missed: BTreeSet<ModuleId> = pairs.map(|(_, missed)| missed).collect();
    missed.into_iter().collect()
}

/// The members that left service since the roster was made, or that were retired then and cannot move any more.
/// Enforces S3.
fn leaving(roster: &Roster, context: &Context) -> Vec<(ModuleId, Service)> {
    let members = roster.members.iter();
    let members = members.map(|member| (member.module.id, member));
    let members = context.peers.along(members);
    members
        .filter_map(|(module, member, peer)| {
            let service = context.service_shown(module, peer)?;
            let has_failed = service == Service::MotionFailed && service != member.service;
            let leaves = member.service == Service::Active && service != Service::Active;
            (has_failed || leaves).then_some((module, service))
        })
        .collect()
}

/// The modules of the best clique that the roster does not list as active and that are so now, if more spots can be filled with them, and
/// without those that the clique leaves out. If there are none, the time after which there may be some although no peer has changed.
/// Enforces E7.
fn wanted_newcomers(
    roster: &Roster,
    context: &mut Context,
) -> Result<Vec<ModuleId>, Option<Duration>> {
    let clique = context.clique();
    let planned = roster.members.iter();
    let planned = planned.filter(|member| member.service == Service::Active);
    let planned: BTreeSet<ModuleId> = planned.map(|member| member.module.id).collect();
    let in_clique: BTreeSet<ModuleId> = clique.iter().copied().collect();
    let newcomers = in_clique.difference(&planned).copied();
    let (newcomers, not_yet): (Vec<ModuleId>, Vec<ModuleId>) = newcomers
        .filter(|&module| context.is_active(module) && !context.is_outdated(module))
        .partition(|&module| stands(module, context) && hears(module, roster.epoch, context));
    let left_out = planned.difference(&in_clique).count();
    let fills_more =
        newcomers.len() > left_out && context.could_fill_more(roster, &clique, &newcomers);
    if left_out == 0 || !fills_more {
        context.forget_replacing();
    }
    let may_replace = fills_more && (left_out == 0 || context.may_replace(clique));
    if may_replace {
        return Ok(newcomers);
    }
    // That a module has come to rest counts as no change of a peer.
    let look_again = (!not_yet.is_empty()).then(|| context.now + context.parameters.heartbeat);
    Err(look_again.into_iter().chain(context.replaces_at()).min())
}

fn waits_for_quorum(module: ModuleId, context: &Context) -> bool {
    let heartbeat = context.peers.heartbeat(module);
    heartbeat.is_some_and(|heartbeat| heartbeat.phase == ModulePhase::WaitingForQuorum)
}

/// Whether a module is at rest, or known by no state. One that moves, such as one whose driver has fallen silent, would not freeze.
fn stands(module: ModuleId, context: &Context) -> bool {
    if module == context.module() {
        return context.robot.is_at_rest();
    }
    let state = context.peers.state(module);
    state.is_none_or(|state| state.drive == DriveState::Standing)
}

/// Whether a module would receive the call to an epoch: it knows who votes, and so lists whom it does not receive, or has come to this
/// epoch.
fn hears(module: ModuleId, epoch: Epoch, context: &Context) -> bool {
    let peer = context.peers.get(module);
    peer.is_some_and(Peer::knows_voters) || follows(module, epoch, context)
}

/// Whether a module knows this epoch. A module that receives the members' messages follows them to their epoch; one that does
/// not would not receive the call to the next epoch either.
fn follows(module: ModuleId, epoch: Epoch, context: &Context) -> bool {
    let heartbeat = context.peers.heartbeat(module);
    module == context.module() || heartbeat.is_some_and(|heartbeat| heartbeat.epoch >= Some(epoch))
}
