//! Handling what a convener publishes: calls to gather, and rosters.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use formation_model::{
    ClosedRoster, ModuleId, Roster, RosterMember, RosterMessage, Service, SourceId, Voter, digest,
};

use super::memory::Memory;
use super::refusal::Refusal;
use super::stage::{Gathering, Outsider, Planning, Stage, hash_roster};
use super::{Agent, AgentParameters};

/// The latest messages of at most this many conveners are kept, so that few strangers take the place of none.
const KEPT_MAX: usize = 16;

/// A message of a convener that is not known yet or whose former run still counts as live, one that comes while this module
/// stands back, or a roster that lacks a majority. It comes only once, so it is kept until more is known.
#[derive(Clone, Debug)]
struct KeptRoster {
    source: Option<SourceId>,
    message: RosterMessage,
}

/// The latest kept message of each convener.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct KeptRosters(BTreeMap<ModuleId, KeptRoster>);

impl KeptRosters {
    /// Keeps a message, if need be in the place of the one of the earliest epoch.
    /// Enforces G7.
    fn keep(&mut self, kept: KeptRoster) {
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

impl Hash for KeptRoster {
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
                self.note_interruption(epoch.convener);
                self.remember_members();
                let context = &mut self.context;
                let gathering = Gathering::join(context, epoch, run.incarnation, target);
                self.stage = Stage::Gathering(gathering);
            }
            RosterMessage::Plan(roster) => match self.follow(Arc::clone(&roster)) {
                Ok(()) => self.handle_kept_rosters(),
                Err(refusal) => {
                    if refusal == Refusal::NoQuorum {
                        self.lack_quorum_for(roster, source);
                    }
                    self.context.refuse(convener, refusal);
                }
            },
        }
    }

    /// Leaves a member out that has left several rosters of this module in a row by opening an epoch: each lists a module of
    /// which the other one receives nothing, so that none would ever agree.
    /// Enforces M6.
    fn note_interruption(&mut self, convener: ModuleId) {
        let own = self.context.module();
        let is_left = self.stage.roster().is_some_and(|roster| {
            roster.epoch.convener == own && roster.member(convener).is_some()
        });
        let context = &mut self.context;
        if is_left && context.peers.note_interruption(convener) {
            // Until this module has closed its next roster.
            let AgentParameters {
                gather_limit,
                stuck,
                ..
            } = context.parameters;
            let until = context.now + (gather_limit + stuck) * 2;
            context.peers.exclude(convener, until);
        }
    }

    /// Keeps a roster that lacks a majority, as it is judged again when this module follows another or its convener shows
    /// more. A module that waits for a quorum, or stands aside for an earlier roster, shows the epoch that it could not
    /// follow, so that the members of that call it to the next one.
    /// Enforces E12.
    fn lack_quorum_for(&mut self, roster: Arc<ClosedRoster>, source: Option<SourceId>) {
        let epoch = roster.epoch;
        if self.context.shortfall.is_some() || matches!(self.stage, Stage::Outsider(_)) {
            self.leave_epoch();
            self.context.memory.note_epoch(epoch);
            self.stage = Stage::Listening(Some(epoch));
        } else {
            self.keep_roster(source, RosterMessage::Plan(roster));
        }
    }

    fn keep_roster(&mut self, source: Option<SourceId>, message: RosterMessage) {
        self.kept_rosters.keep(KeptRoster { source, message });
    }

    /// Handles the kept messages again, the latest epoch first, as this module knows more.
    /// Enforces G7.
    pub(super) fn handle_kept_rosters(&mut self) {
        let kept = std::mem::take(&mut self.kept_rosters.0).into_values();
        let mut kept: Vec<KeptRoster> = kept.collect();
        kept.sort_by_key(|kept| Reverse(kept.message.epoch()));
        for KeptRoster { source, message } in kept {
            self.handle_roster(source, message);
        }
    }

    /// Handles the kept message of a convener again, as that shows more.
    pub(super) fn handle_kept_roster_of(&mut self, convener: ModuleId) {
        if let Some(KeptRoster { source, message }) = self.kept_rosters.0.remove(&convener) {
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
        let memory = self.judge_quorum(&roster)?;
        // Members answer for what they learn. To a module that stands aside a stranger may show any roster of its own. What the
        // majorities of a roster are does not depend on the bodies in it: a member that refuses these counts as the others do when
        // it opens the next epoch.
        if mine.is_some() {
            self.context.memory = memory;
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

    /// What a member remembers with a roster that has every majority that it needs. A roster that lacks one teaches nothing, so
    /// that invented bases cannot keep the modules from forming.
    /// Enforces Q5.
    fn judge_quorum(&mut self, roster: &Roster) -> Result<Memory, Refusal> {
        let context = &mut self.context;
        let mut memory = context.memory.clone();
        let bases = &roster.quorum_bases;
        if bases.iter().any(|basis| basis.epoch >= roster.epoch)
            || memory.contradicts_founders(&roster.target)
        {
            return Err(Refusal::BadRoster);
        }
        memory.note_founders(&roster.target);
        memory.quorum.learn(bases);
        let voters: Vec<Voter> = roster.members.iter().map(RosterMember::voter).collect();
        let shortfall = context.shortfall_of(&memory, &voters, Some(&roster.target));
        match shortfall.or_else(|| memory.quorum.lacks_room_for(&roster.quorum_basis())) {
            None => Ok(memory),
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
