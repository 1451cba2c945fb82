//! Opening epochs: who convenes, when and why.

mod gathering;

use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    Epoch, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, Roster, RosterMessage, Service,
    digest,
};

pub(in crate::protocol) use gathering::Gathering;

use super::io::{EpochReason, Event, Output, SourceId};
use super::mutation::Mutation;
use super::quorum::Shortfall;
use super::{Agent, Stage};

/// An epoch further ahead of every known one than this is not believed.
const EPOCH_STEP_MAX: u64 = 1 << 20;

/// What a module remembers about opening epochs.
#[derive(Clone, Debug)]
pub(in crate::protocol) struct Convening {
    /// Nobody convenes before having listened so long, unless all expected modules were heard.
    listening_until: Duration,
    /// Since when there has been a reason for a new epoch.
    reason_since: Option<Duration>,
    /// When the latest epoch was opened, by anyone.
    last_opened: Option<Duration>,
    /// The least time between epochs at present.
    interval: Duration,
    highest: Option<Epoch>,
    /// Whether all expected modules were gathered once: who is absent later may be gone for good.
    number_was_met: bool,
    lacks_quorum: bool,
    told_shortfall: Option<(usize, usize)>,
    /// In how many epochs since the last agreement members were seen to hold different plans.
    pub mismatches: u32,
    /// A roster whose convener was never heard yet, kept until it is.
    early_roster: Option<(Option<SourceId>, RosterMessage)>,
}

impl Convening {
    pub fn new(listening_until: Duration, interval: Duration) -> Self {
        Self {
            listening_until,
            reason_since: None,
            last_opened: None,
            interval,
            highest: None,
            number_was_met: false,
            lacks_quorum: false,
            told_shortfall: None,
            mismatches: 0,
            early_roster: None,
        }
    }

    /// Notes an epoch that was heard of, unless it is too far ahead to be true.
    pub fn note_epoch(&mut self, epoch: Epoch) {
        if self.is_plausible(epoch) {
            self.highest = self.highest.max(Some(epoch));
        }
    }

    pub fn is_plausible(&self, epoch: Epoch) -> bool {
        let known = self.highest.map_or(0, |highest| highest.number);
        epoch.number <= known.saturating_add(EPOCH_STEP_MAX)
    }

    pub fn lacks_quorum(&self) -> bool {
        self.lacks_quorum
    }

    /// An epoch was agreed on: the next one need not wait longer than the least interval.
    pub fn relax(&mut self, interval: Duration) {
        self.interval = interval;
    }

    fn opened(&mut self, now: Duration, limit: Duration) {
        if self.last_opened.is_some() {
            self.interval = (self.interval * 2).min(limit);
        }
        self.last_opened = Some(now);
        self.reason_since = None;
    }
}

impl Agent {
    fn expected(&self) -> Option<u32> {
        self.announcement.as_ref()?.expected_modules
    }

    /// This module and all that live, in ascending order.
    fn living(&self) -> Vec<ModuleId> {
        let mut living = self.peers.live(self.now, self.parameters.suspicion);
        living.insert(self.module);
        living.into_iter().collect()
    }

    /// The latest roster, whether or not it lists this module.
    pub(in crate::protocol) fn roster(&self) -> Option<&Arc<Roster>> {
        match &self.stage {
            Stage::Planning(turns) => Some(turns.roster()),
            Stage::Acting(acting) => Some(acting.roster()),
            Stage::Outsider(roster) => Some(roster),
            Stage::Idle | Stage::Gathering(_) => None,
        }
    }

    /// Notes that some member showed a digest for the present roster, which may thus have agreed unseen.
    pub(in crate::protocol) fn note_shown(&mut self) {
        if let (Some(epoch), Some(roster)) = (self.epoch, self.roster()) {
            let basis = roster.quorum_basis();
            self.quorum.note_shown(epoch, &basis);
        }
    }

    /// Opens an epoch when there has been a reason for long enough and it is this module's turn to do so.
    pub(in crate::protocol) fn consider_new_epoch(&mut self) {
        if let Stage::Gathering(gathering) = &self.stage
            && gathering.is_collected_here()
        {
            return;
        }
        let Some(reason) = self.epoch_reason() else {
            self.convening.reason_since = None;
            self.set_lacks_quorum(None);
            return;
        };
        let living = self.living();
        let in_no_epoch = |id: &ModuleId| {
            let heartbeat = self.peers.get(*id).and_then(|peer| peer.heartbeat);
            heartbeat.is_none_or(|heartbeat| heartbeat.epoch.is_none())
        };
        let all_there = self
            .expected()
            .is_some_and(|expected| living.len() >= expected as usize);
        if all_there && living.iter().all(in_no_epoch) {
            // Nobody is left to listen for.
            self.convening.listening_until = self.convening.listening_until.min(self.now);
        }
        let since = *self.convening.reason_since.get_or_insert(self.now);
        let rank = living.binary_search(&self.module).unwrap_or(0);
        let rank = u32::try_from(rank).unwrap_or(u32::MAX);
        let due = since
            .max(self.convening.listening_until)
            .max(
                self.convening
                    .last_opened
                    .map_or(Duration::ZERO, |last| last + self.convening.interval),
            )
            .saturating_add(self.parameters.convene.saturating_mul(rank));
        if self.now < due {
            self.wake_at(due);
            return;
        }
        let present: Vec<ModuleRun> = living.iter().filter_map(|&id| self.run_of(id)).collect();
        let shortfall = self.shortfall(&present, self.expected());
        self.set_lacks_quorum(shortfall.map(|shortfall| (shortfall.present, shortfall.basis)));
        if shortfall.is_none() {
            self.open_epoch(reason);
        }
    }

    fn run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        let incarnation = if module == self.module {
            self.incarnation
        } else {
            self.peers.get(module)?.incarnation
        };
        Some(ModuleRun {
            module,
            incarnation,
        })
    }

    fn shortfall(&self, present: &[ModuleRun], expected: Option<u32>) -> Option<Shortfall> {
        if self.switch.is(Mutation::IgnoreQuorum) {
            return None;
        }
        if self.switch.is(Mutation::CountForgetful) {
            let runs = present.iter().flat_map(|run| {
                let earlier = (0..=run.incarnation.0).map(Incarnation);
                earlier.map(|incarnation| ModuleRun {
                    incarnation,
                    ..*run
                })
            });
            return self.quorum.shortfall(&runs.collect::<Vec<_>>(), expected);
        }
        self.quorum.shortfall(present, expected)
    }

    fn set_lacks_quorum(&mut self, shortfall: Option<(usize, usize)>) {
        let lacks = shortfall.is_some();
        if lacks != self.convening.lacks_quorum {
            self.convening.lacks_quorum = lacks;
            self.voice.state_changed = true;
        }
        if shortfall != self.convening.told_shortfall {
            self.convening.told_shortfall = shortfall;
            if let Some((present, basis)) = shortfall {
                self.emit(Event::WaitingForQuorum { present, basis });
            }
        }
    }

    /// Why the present epoch will not do, if so.
    fn epoch_reason(&mut self) -> Option<EpochReason> {
        let announcement = self.announcement.as_ref()?;
        if let Stage::Gathering(gathering) = &self.stage {
            return self.gathering_reason(gathering);
        }
        let Some(roster) = self.roster() else {
            return Some(EpochReason::NewTarget);
        };
        if announcement.revision > roster.target.revision
            && digest::of_target(announcement) != digest::of_target(&roster.target)
        {
            return Some(EpochReason::NewTarget);
        }
        let others = || {
            roster
                .members
                .iter()
                .filter(|member| member.module.id != self.module)
        };
        let is_in_charge = |run: ModuleRun| {
            let heartbeat = self.peers.get(run.module).and_then(|peer| peer.heartbeat);
            self.peers
                .is_live(self.now, self.parameters.suspicion, run.module)
                && heartbeat.is_some_and(|heartbeat| {
                    heartbeat.incarnation == run.incarnation
                        && heartbeat.phase != ModulePhase::WaitingForQuorum
                })
        };
        let is_outsider = matches!(self.stage, Stage::Outsider(_));
        if is_outsider && others().any(|member| is_in_charge(member.run())) {
            // The members judge whom they miss and whom they want. One of whom they hear nothing, or that does not hear
            // all of them, would halt them again and again.
            return None;
        }
        let restarted: Vec<ModuleId> = others()
            .filter(|member| {
                self.peers
                    .get(member.module.id)
                    .is_some_and(|peer| peer.incarnation > member.incarnation)
            })
            .map(|member| member.module.id)
            .collect();
        if !restarted.is_empty() && !self.switch.is(Mutation::DropIncarnationCheck) {
            return Some(EpochReason::Restarted(restarted));
        }
        let silent: Vec<ModuleId> = others()
            .map(|member| member.module.id)
            .filter(|&id| !self.peers.is_live(self.now, self.parameters.suspicion, id))
            .collect();
        if !silent.is_empty() {
            return Some(EpochReason::Silent(silent));
        }
        let leaving = self.leaving(roster);
        if !leaving.is_empty() {
            return self
                .someone_is_active()
                .then_some(EpochReason::OutOfService(leaving));
        }
        let stuck = self.stuck_modules();
        if stuck.contains(&self.module) {
            // The others leave this module out; were it to convene, it would list itself again.
            return None;
        }
        if !stuck.is_empty() {
            let until = self.now + self.parameters.stuck * 2;
            for &module in &stuck {
                self.peers.exclude(module, until);
            }
            return Some(EpochReason::Stuck(stuck));
        }
        if let Stage::Acting(acting) = &self.stage
            && acting.holds_mismatch()
            && self.convening.mismatches <= 1
        {
            return Some(EpochReason::DigestMismatch);
        }
        let newcomers = self.wanted_newcomers();
        (!newcomers.is_empty()).then_some(EpochReason::Newcomers(newcomers))
    }

    /// The living modules that the roster does not list, if it leaves spots open.
    fn wanted_newcomers(&self) -> Vec<ModuleId> {
        if self.switch.is(Mutation::IgnoreNewcomers) {
            return Vec::new();
        }
        let Some(roster) = self.roster() else {
            return Vec::new();
        };
        let spots = roster
            .target
            .target
            .as_ref()
            .map_or(0, |target| target.spots().len());
        let active = roster
            .members
            .iter()
            .filter(|member| member.service == Service::Active);
        if active.clone().count() >= spots {
            return Vec::new();
        }
        let is_planned = |id: ModuleId| active.clone().any(|member| member.module.id == id);
        // Whoever hears the members follows them to their epoch. One that does not would not hear itself be called either.
        let follows = |id: ModuleId| {
            let heartbeat = self.peers.get(id).and_then(|peer| peer.heartbeat);
            id == self.module || heartbeat.is_some_and(|heartbeat| heartbeat.epoch >= self.epoch)
        };
        self.living()
            .into_iter()
            .filter(|&id| !is_planned(id) && self.service_of(id) == Some(Service::Active))
            .filter(|&id| follows(id) && self.peers.is_wanted(self.now, id))
            .collect()
    }

    pub(super) fn open_epoch(&mut self, reason: EpochReason) {
        let Some(announcement) = self.announcement.clone() else {
            return;
        };
        let number = self.convening.highest.map_or(0, |highest| highest.number) + 1;
        let epoch = Epoch {
            number,
            convener: self.module,
        };
        self.emit(Event::Convened(epoch, reason));
        self.outputs
            .push_back(Output::Publish(Message::Roster(RosterMessage::Gather {
                epoch,
                target_revision: announcement.revision,
            })));
        self.enter_gathering(epoch, self.incarnation, announcement.revision);
        self.advance_gathering();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_doubles_up_to_its_limit_until_an_epoch_agrees() {
        let (least, limit) = (Duration::from_secs(1), Duration::from_secs(16));
        let mut convening = Convening::new(Duration::ZERO, least);
        let mut intervals = Vec::new();
        for opened in 0..7 {
            convening.opened(Duration::from_secs(100 * opened), limit);
            intervals.push(convening.interval.as_secs());
        }
        assert_eq!(intervals, [1, 2, 4, 8, 16, 16, 16]);
        convening.relax(least);
        assert_eq!(convening.interval, least);
    }
}
