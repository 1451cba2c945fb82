//! Gathering the members of an epoch: halting, collecting those that froze, and publishing and judging their roster.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    Digest, Epoch, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, ModuleState,
    PlanningModule, Roster, RosterMember, RosterMessage, Service, TargetAnnouncement, digest,
};

use super::super::io::{EpochReason, Event, Output, SourceId};
use super::super::mutation::Mutation;
use super::super::refusal::Refusal;
use super::super::turns::Turns;
use super::super::{Agent, Stage, pins};

/// An epoch whose members are being gathered.
#[derive(Clone, Debug)]
pub(in crate::protocol) struct Gathering {
    convener: ModuleId,
    convener_incarnation: Incarnation,
    since: Duration,
    /// The revision of the target that will be planned for.
    target_revision: u64,
    /// Present when this module is the convener.
    collection: Option<Collection>,
}

/// What a convener remembers while it collects.
#[derive(Clone, Debug)]
struct Collection {
    /// The target that the members were told of: their pins are for this one.
    target: Digest,
    frozen: usize,
    last_new: Duration,
    told_missing: bool,
    told_limit: bool,
}

impl Gathering {
    /// The revision of the target that will be planned for, unless another is announced meanwhile.
    pub(in crate::protocol) fn target_revision(&self) -> u64 {
        self.target_revision
    }

    /// Whether this module is the one that collects the members.
    pub(super) fn is_collected_here(&self) -> bool {
        self.collection.is_some()
    }
}

impl Agent {
    /// Whether this module may say that it has frozen: it stands, no port works, and it knows for which target, since only
    /// then can it tell whether it stands on its spot already. It does not wait long, as the target may never reach it
    /// but in the roster.
    pub(in crate::protocol) fn may_tell_frozen(&mut self) -> bool {
        let Stage::Gathering(gathering) = &self.stage else {
            return true;
        };
        let known = self.announcement.as_ref().map(|known| known.revision);
        let patience_ends = gathering.since + self.parameters.gather / 2;
        if known < Some(gathering.target_revision) && self.now < patience_ends {
            self.wake_at(patience_ends);
            return false;
        }
        self.body.is_at_rest()
    }

    pub(super) fn gathering_reason(&self, gathering: &Gathering) -> Option<EpochReason> {
        let convener = gathering.convener;
        let alive = self
            .peers
            .is_live(self.now, self.parameters.suspicion, convener)
            && self
                .peers
                .get(convener)
                .is_some_and(|peer| peer.incarnation == gathering.convener_incarnation);
        let patience = self.parameters.gather_limit + self.parameters.stuck;
        let overdue = self.now > gathering.since + patience
            && !self.peers.get(convener).is_some_and(|peer| {
                // One that has left for another epoch, or has planned without us, will never end this gathering for us.
                peer.heartbeat.is_some_and(|heartbeat| {
                    heartbeat.phase == ModulePhase::WaitingForQuorum
                        && heartbeat.epoch == self.epoch
                        && heartbeat.digest.is_none()
                })
            });
        (!alive || overdue).then_some(EpochReason::ConvenerSilent(convener))
    }

    /// Halts and freezes for an epoch.
    pub(super) fn enter_gathering(
        &mut self,
        epoch: Epoch,
        convener_incarnation: Incarnation,
        target_revision: u64,
    ) {
        self.stand_still();
        self.epoch = Some(epoch);
        self.convening.note_epoch(epoch);
        self.convening
            .opened(self.now, self.parameters.epoch_interval_limit);
        self.set_lacks_quorum(None);
        self.early_claims.forget_before(epoch);
        self.stage = Stage::Gathering(Gathering {
            convener: epoch.convener,
            convener_incarnation,
            since: self.now,
            target_revision,
            collection: self
                .announcement
                .as_ref()
                .filter(|_| epoch.convener == self.module)
                .map(|announcement| Collection {
                    target: digest::of_target(announcement),
                    frozen: 0,
                    last_new: self.now,
                    told_missing: false,
                    told_limit: false,
                }),
        });
        self.voice.state_changed = true;
        self.emit(Event::Gathered(epoch));
    }

    pub(in crate::protocol) fn hear_roster(
        &mut self,
        source: Option<SourceId>,
        message: RosterMessage,
    ) {
        let epoch = message.epoch();
        if epoch.convener == self.module {
            // An earlier run of this module may have convened; its epoch counts, its roster does not.
            self.convening.note_epoch(epoch);
            return;
        }
        let Some(convener) = self.peers.get(epoch.convener) else {
            return self.keep_early_roster(source, message);
        };
        let incarnation = convener.incarnation;
        if let Err(refusal) = self.peers.check_source(epoch.convener, incarnation, source) {
            self.keep_early_roster(source, message);
            return self.refuse(Some(epoch.convener), refusal);
        }
        if !self.convening.is_plausible(epoch) {
            return self.refuse(Some(epoch.convener), Refusal::ImplausibleEpoch);
        }
        let is_over = self.epoch.is_some_and(|current| epoch < current);
        if is_over && !self.switch.is(Mutation::AcceptStaleEpoch) {
            return self.refuse(Some(epoch.convener), Refusal::StaleEpoch);
        }
        match message {
            RosterMessage::Gather { .. } if self.epoch == Some(epoch) => {}
            RosterMessage::Gather {
                target_revision, ..
            } => self.enter_gathering(epoch, incarnation, target_revision),
            RosterMessage::Plan(roster) => self.hear_plan(roster),
        }
    }

    /// A roster may arrive before the first heartbeat of its convener, or while the run before that one still counts as
    /// living. It comes only once.
    fn keep_early_roster(&mut self, source: Option<SourceId>, message: RosterMessage) {
        let known = self.convening.early_roster.as_ref();
        if known.is_none_or(|(_, known)| known.epoch() <= message.epoch()) {
            self.convening.early_roster = Some((source, message));
        }
    }

    /// Looks again at a roster that came before its convener was known.
    pub(in crate::protocol) fn hear_early_roster(&mut self, convener: ModuleId) {
        let early = self
            .convening
            .early_roster
            .take_if(|(_, message)| message.epoch().convener == convener);
        if let Some((source, message)) = early {
            self.hear_roster(source, message);
        }
    }

    fn hear_plan(&mut self, roster: Arc<Roster>) {
        let epoch = roster.epoch;
        let frozen = self.epoch == Some(epoch) && matches!(self.stage, Stage::Gathering(_));
        if self.epoch == Some(epoch) && !frozen {
            return;
        }
        let mine = roster
            .members
            .iter()
            .find(|member| member.module.id == self.module);
        if let Some(mine) = mine {
            let mut announced = self.as_member(&roster.target);
            if self.switch.is(Mutation::DropIncarnationCheck)
                && mine.incarnation != self.incarnation
            {
                return self.adopt(roster);
            }
            // The convener may drop a pin, where two modules claim one spot, but may not invent one.
            if mine.module.pin.is_none() || self.switch.is(Mutation::PinForAnyTarget) {
                announced.module.pin = mine.module.pin;
            }
            // It may have been retired since it froze; that calls for another epoch, not for a quarrel about this one.
            announced.service = mine.service;
            if self.service != Service::Active {
                announced.module.pin = mine.module.pin;
            }
            if mine.incarnation > self.incarnation {
                // The others have let a later run of this module take its place.
                self.succeeded_by = self.succeeded_by.max(Some(mine.incarnation));
                self.stand_back();
                return self.refuse(Some(epoch.convener), Refusal::DuplicateModule);
            }
            if mine.incarnation < self.incarnation {
                // It lists an earlier run of this module; the others will notice that it started anew.
                return self.refuse(Some(epoch.convener), Refusal::StaleIncarnation);
            }
            if !frozen || *mine != announced {
                return self.refuse(Some(epoch.convener), Refusal::BadRoster);
            }
        }
        if let Some(known) = &self.announcement {
            let contradicts = known.revision == roster.target.revision
                && digest::of_target(known) != digest::of_target(&roster.target);
            let withdrawn = known.revision > roster.target.revision && known.target.is_none();
            if contradicts || withdrawn {
                return self.refuse(Some(epoch.convener), Refusal::BadRoster);
            }
        }
        self.quorum.learn(&roster.quorum_bases);
        let runs: Vec<ModuleRun> = roster.members.iter().map(RosterMember::run).collect();
        if self
            .shortfall(&runs, roster.target.expected_modules)
            .is_some()
        {
            return self.refuse(Some(epoch.convener), Refusal::NoQuorum);
        }
        let listed = mine.is_some();
        if self
            .announcement
            .as_ref()
            .is_none_or(|known| known.revision < roster.target.revision)
        {
            self.know_target(Arc::new(roster.target.clone()));
        }
        if listed {
            self.begin_turns(roster);
        } else {
            self.stand_still();
            self.epoch = Some(epoch);
            self.convening.note_epoch(epoch);
            self.convening
                .opened(self.now, self.parameters.epoch_interval_limit);
            self.stage = Stage::Outsider(roster);
            self.voice.state_changed = true;
        }
    }

    /// Takes part in an epoch that lists an earlier run of this module, as only a mutation does.
    fn adopt(&mut self, roster: Arc<Roster>) {
        self.epoch = Some(roster.epoch);
        self.announcement = Some(Arc::new(roster.target.clone()));
        self.begin_turns(roster);
    }

    /// This module as it announced itself when it froze for a plan for this target.
    fn as_member(&self, target: &TargetAnnouncement) -> RosterMember {
        RosterMember {
            incarnation: self.incarnation,
            service: self.service,
            module: PlanningModule {
                id: self.module,
                pose: self.body.pose,
                links: self.body.links.clone(),
                configuration: self.identity.configuration,
                leader: self.identity.leader,
                pin: self.pin_for(target),
            },
        }
    }

    /// As the convener: publishes the roster once all are there, or the time is up.
    pub(in crate::protocol) fn advance_gathering(&mut self) {
        let (Some(epoch), Stage::Gathering(gathering)) = (self.epoch, &self.stage) else {
            return;
        };
        if gathering.collection.is_none() {
            return;
        }
        let since = gathering.since;
        let frozen: Vec<Arc<ModuleState>> = self
            .peers
            .iter()
            .filter(|(id, _)| self.peers.is_live(self.now, self.parameters.suspicion, *id))
            .filter_map(|(_, peer)| peer.state.clone())
            .filter(|state| state.epoch == Some(epoch) && state.phase == ModulePhase::Gathered)
            .collect();
        let count = frozen.len() + usize::from(self.body.is_at_rest());
        let living = self.living();
        let waits_for_number = !self.convening.number_was_met && !self.quorum.has_agreed();
        let expected = self.expected();
        let Stage::Gathering(Gathering {
            collection: Some(collection),
            ..
        }) = &mut self.stage
        else {
            return;
        };
        if count != collection.frozen {
            collection.frozen = count;
            collection.last_new = self.now;
        }
        let quiet_at = collection.last_new + self.parameters.gather;
        let limit_at = since + self.parameters.gather_limit;
        let everyone = match expected {
            // Only the first roster waits for a number; later ones replace members that may be gone for good.
            Some(expected) if waits_for_number => count >= expected as usize,
            _ => count >= living.len() || self.now >= quiet_at,
        };
        let time_is_up = self.now >= limit_at;
        let tells_limit = time_is_up && !everyone && !collection.told_limit;
        collection.told_limit |= tells_limit;
        if !everyone && !time_is_up {
            let told = collection.told_missing;
            collection.told_missing |= self.now >= quiet_at;
            if !told && self.now >= quiet_at {
                self.tell_missing(&frozen);
            }
            self.wake_at(quiet_at);
            self.wake_at(limit_at);
            return;
        }
        if !self.body.is_at_rest() {
            return;
        }
        for state in &frozen {
            self.quorum.learn(&state.quorum_bases);
        }
        if tells_limit {
            self.tell_missing(&frozen);
        }
        self.close_gathering(epoch, &frozen);
    }

    fn tell_missing(&mut self, frozen: &[Arc<ModuleState>]) {
        let present: BTreeSet<ModuleId> = frozen.iter().map(|state| state.module).collect();
        let named = frozen
            .iter()
            .flat_map(|state| state.links.iter().copied())
            .chain(self.body.links.iter().copied())
            .chain(self.living());
        let absent: BTreeSet<ModuleId> = named
            .filter(|id| *id != self.module && !present.contains(id))
            .collect();
        self.emit(Event::Missing {
            expected: self.expected(),
            gathered: present.len() + 1,
            absent: absent.into_iter().collect(),
        });
    }

    fn close_gathering(&mut self, epoch: Epoch, frozen: &[Arc<ModuleState>]) {
        let Some(announcement) = self.announcement.clone() else {
            return;
        };
        let mut members: Vec<RosterMember> = frozen.iter().map(|state| member_of(state)).collect();
        members.push(self.as_member(&announcement));
        members.sort_by_key(|member| member.module.id);
        if members
            .iter()
            .all(|member| member.service != Service::Active)
        {
            // There is nothing to plan until one of them takes part again.
            return;
        }
        if let Some(target) = &announcement.target {
            pins::settle(&mut members, target, announcement.parameters);
        }
        let runs: Vec<ModuleRun> = members.iter().map(RosterMember::run).collect();
        let shortfall = self.shortfall(&runs, announcement.expected_modules);
        self.set_lacks_quorum(shortfall.map(|shortfall| (shortfall.present, shortfall.basis)));
        if shortfall.is_some() {
            // The frozen wait; when more are within reach, the gathering goes on where it stood.
            return;
        }
        let gathered_for = match &self.stage {
            Stage::Gathering(gathering) => gathering.collection.as_ref().map(|one| one.target),
            _ => None,
        };
        if gathered_for != Some(digest::of_target(&announcement))
            && !self.switch.is(Mutation::PinForAnyTarget)
        {
            // Another target was announced since. The members froze with pins for the former; they have to say again
            // where they stand in this one.
            return self.open_epoch(EpochReason::NewTarget);
        }
        let roster = Arc::new(Roster {
            epoch,
            target: (*announcement).clone(),
            members,
            quorum_bases: self.quorum.bases(),
        });
        self.outputs
            .push_back(Output::Publish(Message::Roster(RosterMessage::Plan(
                Arc::clone(&roster),
            ))));
        self.begin_turns(roster);
    }

    pub(in crate::protocol) fn begin_turns(&mut self, roster: Arc<Roster>) {
        let members = roster.members.len();
        let epoch = roster.epoch;
        self.peers
            .listed(roster.members.iter().map(|member| member.module.id));
        let expected = roster.target.expected_modules;
        self.convening.number_was_met |=
            expected.is_some_and(|expected| members >= expected as usize);
        match Turns::new(roster, self.now, self.switch) {
            Some(turns) => {
                self.stage = Stage::Planning(Box::new(turns));
                self.voice.state_changed = true;
                self.emit(Event::PlanningBegun { epoch, members });
                self.advance_turns();
                self.advance_acting();
            }
            None => self.refuse(Some(epoch.convener), Refusal::BadRoster),
        }
    }
}

fn member_of(state: &ModuleState) -> RosterMember {
    RosterMember {
        incarnation: state.incarnation,
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
