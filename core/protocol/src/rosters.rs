//! Handling what a convener publishes: calls to gather, and rosters.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use formation_model::{
    ClosedRoster, ModuleId, Roster, RosterMember, RosterMessage, Service, SourceId, digest,
};

use super::Agent;
use super::refusal::Refusal;
use super::session::{shortfall_of, votes_of};
use super::stage::{Gathering, Outsider, Planning, Stage, hash_roster};

/// The latest messages of at most this many conveners are kept, so that few strangers take the place of none.
const KEPT_MAX: usize = 16;

/// A message of a convener that is not known yet or whose former run still counts as live, or one that comes while this module
/// stands back. It comes only once, so it is kept until more is known.
#[derive(Clone, Debug)]
struct EarlyRoster {
    source: Option<SourceId>,
    message: RosterMessage,
}

/// The latest kept message of each convener.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct EarlyRosters(BTreeMap<ModuleId, EarlyRoster>);

impl EarlyRosters {
    /// Keeps a message, if need be in the place of the one of the earliest epoch.
    /// Enforces G7.
    fn keep(&mut self, kept: EarlyRoster) {
        let epoch = kept.message.epoch();
        let known = self.0.get(&epoch.convener);
        if known.is_some_and(|known| known.message.epoch() > epoch) {
            return;
        }
        self.0.insert(epoch.convener, kept);
        if self.0.len() > KEPT_MAX {
            let epochs = self.0.values().map(|kept| kept.message.epoch());
            let earliest = epochs.min().map(|epoch| epoch.convener);
            earliest.and_then(|convener| self.0.remove(&convener));
        }
    }
}

impl Hash for EarlyRoster {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.source, self.message.epoch()).hash(state);
        if let RosterMessage::Plan(roster) = &self.message {
            hash_roster(roster, state);
        }
    }
}

impl Agent {
    /// Enforces E1.
    pub(super) fn handle_roster(&mut self, source: Option<SourceId>, message: RosterMessage) {
        let epoch = message.epoch();
        if epoch.convener == self.context.module() {
            // An earlier run of this module may have convened; its epoch counts, its roster does not.
            self.context.note_epoch(epoch);
            return;
        }
        // To follow a call without freezing for it would have the others call again and again.
        let convener = self.context.peers.get(epoch.convener);
        let convener = convener.filter(|_| !self.succession.is_standing_back());
        let Some(convener) = convener else {
            return self.keep_roster(source, message);
        };
        if convener.has_other_voters {
            return self
                .context
                .refuse(Some(epoch.convener), Refusal::OtherVoters);
        }
        let run = epoch.convener.run(convener.incarnation);
        let convener = Some(epoch.convener);
        if let Err(refusal) = self.context.peers.check_source(run, source) {
            self.keep_roster(source, message);
            return self.context.refuse(convener, refusal);
        }
        if !self.context.is_plausible(epoch.number) {
            return self.context.refuse(convener, Refusal::ImplausibleEpoch);
        }
        let current = self.stage.epoch();
        let is_over = current.is_some_and(|current| epoch < current);
        if is_over {
            return self.context.refuse(convener, Refusal::StaleEpoch);
        }
        match message {
            RosterMessage::Gather { .. } if current == Some(epoch) => {}
            RosterMessage::Gather { target, .. } => {
                self.remember_members();
                let context = &mut self.context;
                let gathering = Gathering::join(context, epoch, run.incarnation, target);
                self.stage = Stage::Gathering(gathering);
            }
            RosterMessage::Plan(roster) => {
                if let Err(refusal) = self.follow(roster) {
                    self.context.refuse(convener, refusal);
                }
            }
        }
    }

    fn keep_roster(&mut self, source: Option<SourceId>, message: RosterMessage) {
        self.early_rosters.keep(EarlyRoster { source, message });
    }

    /// Handles the kept messages again, the latest epoch first, as this module knows more.
    /// Enforces G7.
    pub(super) fn handle_early_rosters(&mut self) {
        let kept = std::mem::take(&mut self.early_rosters.0).into_values();
        let mut kept: Vec<EarlyRoster> = kept.collect();
        kept.sort_by_key(|kept| Reverse(kept.message.epoch()));
        for EarlyRoster { source, message } in kept {
            self.handle_roster(source, message);
        }
    }

    /// Handles the kept message of a convener again, as that shows more.
    pub(super) fn handle_early_roster_of(&mut self, convener: ModuleId) {
        if let Some(EarlyRoster { source, message }) = self.early_rosters.0.remove(&convener) {
            self.handle_roster(source, message);
        }
    }

    /// Plans on a roster, or stands aside if it does not list this module.
    fn follow(&mut self, roster: Arc<ClosedRoster>) -> Result<(), Refusal> {
        let epoch = Some(roster.epoch);
        let is_frozen = self.stage.epoch() == epoch && matches!(self.stage, Stage::Gathering(_));
        if self.stage.epoch() == epoch && !is_frozen {
            return Ok(());
        }
        let own = self.context.module();
        let mine = roster.member(own);
        if let Some(mine) = mine {
            self.check_own_entry(&roster, mine, is_frozen)?;
        }
        self.check_target(&roster)?;
        self.judge_quorum(&roster)?;
        if mine.is_some() {
            self.context.session.note_voters(&roster.voters.named);
            self.context.check_removals(&roster)?;
            self.context.check_bodies(&roster)?;
        }
        if self.context.target.revision() < Some(roster.target.revision) {
            self.context.target.set(Arc::new(roster.target.clone()));
        }
        if mine.is_some() {
            self.begin_turns(roster);
        } else {
            self.remember_members();
            self.context.learn_roster_bodies(&roster);
            self.context.stand_still();
            self.context.note_opened(roster.epoch);
            self.context.mark_state_changed();
            let since = self.context.now;
            let listed = Arc::clone(&roster);
            self.stage = Stage::Outsider(Outsider { roster, since });
            self.note_run_named_in(&listed.bodies);
        }
        Ok(())
    }

    /// Checks that a roster lists this run as it announced itself.
    /// Enforces G3.
    fn check_own_entry(
        &mut self,
        roster: &ClosedRoster,
        mine: &RosterMember,
        is_frozen: bool,
    ) -> Result<(), Refusal> {
        let own = self.context.own.run.incarnation;
        if mine.incarnation > own {
            // The others have let a later run of this module take its place.
            self.note_named_run(mine.incarnation);
            self.succession.note_successor(mine.incarnation);
            self.stand_back();
            return Err(Refusal::DuplicateModule);
        }
        if mine.incarnation < own {
            // It lists an earlier run of this module; the others will notice the restart.
            return Err(Refusal::StaleIncarnation);
        }
        let mut announced = self.context.as_member(|| roster.target_digest());
        // The convener may release a pin but not invent one. After a retirement since freezing, there is no pin to
        // compare, and the service differs; that calls for another epoch, not for a refusal of this one.
        let may_differ = mine.module.pin.is_none() || self.context.robot.service != Service::Active;
        if may_differ {
            announced.module.pin = mine.module.pin;
        }
        announced.service = mine.service;
        announced.is_idle |=
            mine.is_idle && self.context.session.shown.are_over_in(&roster.members);
        let moved = mine.module.pose.distance_to(&announced.module.pose);
        if is_frozen && moved.0 > 0 {
            self.context.robot.moved_in = Some((roster.epoch, moved));
        }
        if is_frozen && *mine == announced {
            Ok(())
        } else {
            Err(Refusal::BadRoster)
        }
    }

    /// Checks that a roster holds a majority of the voters of this session, and lists the votes that were removed.
    /// Enforces Q1, Q3, Q4.
    fn judge_quorum(&self, roster: &Roster) -> Result<(), Refusal> {
        let session = &self.context.session;
        let voters = &roster.voters;
        if session.contradicts(&voters.named) || session.contradicts(&roster.target.voters) {
            return Err(Refusal::OtherVoters);
        }
        if !session.covers(voters) {
            return Err(Refusal::UnlistedVotes);
        }
        match shortfall_of(voters, votes_of(&roster.members), Some(&roster.target)) {
            None => Ok(()),
            Some(_) => Err(Refusal::NoQuorum),
        }
    }

    /// Checks that a roster does not contradict the announced target.
    /// Enforces E11, G4.
    fn check_target(&self, roster: &ClosedRoster) -> Result<(), Refusal> {
        if roster.timing != self.context.parameters.timing() {
            return Err(Refusal::DifferentTiming);
        }
        if !self.is_plausible_revision(roster.target.revision) {
            return Err(Refusal::ImplausibleRevision);
        }
        let Some(known) = self.context.target.announcement() else {
            return Ok(());
        };
        let contradicts = known.revision == roster.target.revision
            && **known != roster.target
            && digest::of_target(known) != roster.target_digest();
        let is_withdrawn = known.revision > roster.target.revision && known.target.is_none();
        if contradicts || is_withdrawn {
            Err(Refusal::BadRoster)
        } else {
            Ok(())
        }
    }

    /// Begins with the turns of a roster.
    fn begin_turns(&mut self, roster: Arc<ClosedRoster>) {
        let Some(mut planning) = Planning::begin(roster, &mut self.context) else {
            return;
        };
        if let Stage::Gathering(gathering) = &mut self.stage {
            planning = planning.with_claims(std::mem::take(&mut gathering.claims));
        }
        self.stage = Stage::Planning(Box::new(planning));
    }
}
