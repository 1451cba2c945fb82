//! What a process knows of its peers; all modules that it hosts share it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Heartbeat, Incarnation, MODULES_MAX, ModuleId, ModuleRun, ModuleState, SourceId,
};

use super::{HeartbeatNews, Liveness, PEERS_MIN, SILENCES_REMEMBERED, ShownChanges, StateNews};
use crate::peer::{Peer, state_of, without_proofs};
use crate::refusal::Refusal;

/// All modules that sent a message; a module that shares its process with others is one of them.
#[derive(Clone, Debug)]
pub(crate) struct PeerTable {
    pub(super) peers: BTreeMap<ModuleId, Peer>,
    /// The greatest number of peers that are kept.
    pub(super) room: usize,
    /// Counts the changes to peers that may give a reason for an epoch.
    changes: u64,
    shown: ShownChanges,
    /// When time alone changes who is live, found at this version.
    unchanged_until: Option<((u64, ShownChanges), Duration)>,
}

impl Default for PeerTable {
    fn default() -> Self {
        Self {
            peers: BTreeMap::new(),
            room: MODULES_MAX,
            changes: 0,
            shown: ShownChanges::default(),
            unchanged_until: None,
        }
    }
}

impl PeerTable {
    /// Adapts the greatest number of peers to the number of modules that are expected, if it is known.
    pub fn expect(&mut self, expected: Option<u32>) {
        let expected = expected.and_then(|count| usize::try_from(count).ok());
        self.room = expected.map_or(MODULES_MAX, |count| {
            PEERS_MIN.max(count.saturating_mul(4)).min(MODULES_MAX)
        });
    }

    /// Whether there is room for one more, if need be in the place of one that has long been silent.
    /// Enforces C3.
    fn make_room(&mut self, liveness: Liveness) -> bool {
        if self.peers.len() < self.room {
            return true;
        }
        let quietest = self.peers.iter().min_by_key(|(_, peer)| peer.last_seen());
        let gone = quietest
            .filter(|(_, peer)| liveness.now.saturating_sub(peer.last_seen()) > liveness.suspicion)
            .map(|(&module, _)| module);
        gone.is_some_and(|module| self.peers.remove(&module).is_some())
    }

    pub fn get(&self, module: ModuleId) -> Option<&Peer> {
        self.peers.get(&module)
    }

    /// The live modules in ascending order.
    pub fn live(&self, liveness: Liveness) -> impl Iterator<Item = (ModuleId, &Peer)> {
        let peers = self.peers.iter();
        let live = peers.filter(move |(_, peer)| liveness.includes(peer));
        live.map(|(&module, peer)| (module, peer))
    }

    /// Counts the changes of what heartbeats show.
    pub fn shown(&self) -> ShownChanges {
        self.shown
    }

    /// Changes whenever a peer becomes known, restarts, leaves, or shows another epoch, digest or service, or that it misses or knows
    /// others; time changes only ages.
    pub fn version(&self) -> (u64, ShownChanges) {
        (self.changes, self.shown)
    }

    /// Checks that a message of a run comes from the process that sends for its module, where that is known.
    /// Enforces M2.
    pub fn check_source(&self, run: ModuleRun, source: Option<SourceId>) -> Result<(), Refusal> {
        let Some(peer) = self.peers.get(&run.module) else {
            return Ok(());
        };
        if run.incarnation < peer.incarnation {
            return Err(Refusal::StaleIncarnation);
        }
        match (peer.source, source) {
            (Some(known), Some(given)) if known != given && peer.incarnation == run.incarnation => {
                Err(Refusal::WrongSource)
            }
            _ => Ok(()),
        }
    }

    /// Forgets a run that has long been silent when an earlier one sends, and returns it: what a silent run claimed keeps no
    /// other out.
    fn forget_silent(&mut self, liveness: Liveness, run: ModuleRun) -> Option<Peer> {
        let is_gone = |peer: &Peer| {
            let silence = liveness.now.saturating_sub(peer.last_seen());
            run.incarnation < peer.incarnation && silence > liveness.suspicion * SILENCES_REMEMBERED
        };
        if !self.get(run.module).is_some_and(is_gone) {
            return None;
        }
        self.changes += 1;
        self.peers.remove(&run.module)
    }

    /// Judges a sender that is not known as such, and makes room for it. Returns the run that it replaces although that is later.
    fn judge_sender(
        &mut self,
        liveness: Liveness,
        run: ModuleRun,
        source: Option<SourceId>,
    ) -> Result<Option<Peer>, Refusal> {
        let forgotten = self.forget_silent(liveness, run);
        self.check_source(run, source)?;
        if self.peers.contains_key(&run.module) || self.make_room(liveness) {
            Ok(forgotten)
        } else {
            Err(Refusal::TooManyModules)
        }
    }

    /// The entry of the run that sends, made or replaced where the rules of incarnations allow it.
    /// Enforces M3.
    fn admit(
        &mut self,
        liveness: Liveness,
        run: ModuleRun,
        source: Option<SourceId>,
    ) -> Result<&mut Peer, Refusal> {
        if run.incarnation.0 > liveness.latest_stamp {
            return Err(Refusal::ImplausibleIncarnation);
        }
        let known = self.peers.get(&run.module);
        let is_known =
            known.is_some_and(|peer| peer.incarnation == run.incarnation && peer.source == source);
        let forgotten = if is_known {
            None
        } else {
            self.judge_sender(liveness, run, source)?
        };
        let now = liveness.now;
        let changes = &mut self.changes;
        let peer = self.peers.entry(run.module).or_insert_with(|| {
            *changes += 1;
            Peer::new(run.incarnation, source, now)
        });
        if run.incarnation > peer.incarnation {
            let silence = now.saturating_sub(peer.last_seen());
            // A process that goes on under a later number is no second one.
            let goes_on = source.is_some() && source == peer.source;
            let is_free = goes_on || peer.left_at.is_some() || silence > liveness.suspicion;
            if !is_free {
                return Err(Refusal::DuplicateModule);
            }
            self.changes += 1;
            let (kept, replaces) = (peer.kept.take(), peer.replaces);
            let former = std::mem::replace(peer, Peer::new(run.incarnation, source, now));
            peer.follow(&former);
            peer.replaces = replaces;
            peer.state = state_of(kept, run, source);
        } else if let Some(Peer {
            incarnation, kept, ..
        }) = forgotten
        {
            peer.replaces = Some(incarnation);
            peer.state = state_of(kept, run, source);
        }
        peer.source = peer.source.or(source);
        Ok(peer)
    }

    /// Handles a heartbeat.
    pub fn handle_heartbeat(
        &mut self,
        liveness: Liveness,
        heartbeat: Heartbeat,
        source: Option<SourceId>,
    ) -> Result<HeartbeatNews, Refusal> {
        let run = heartbeat.module.run(heartbeat.incarnation);
        let now = liveness.now;
        let peer = match self.admit(liveness, run, source) {
            Ok(peer) => peer,
            Err(refusal) => {
                if refusal == Refusal::DuplicateModule
                    && let Some(peer) = self.peers.get_mut(&run.module)
                {
                    let (uptime, period) = (heartbeat.uptime, liveness.period);
                    peer.compare_later((run.incarnation, source), now, uptime, period);
                }
                return Err(refusal);
            }
        };
        let sequence = |known: &Heartbeat| known.sequence;
        if peer.heartbeat.as_ref().map(sequence) >= Some(heartbeat.sequence) {
            return Ok(HeartbeatNews::Old);
        }
        let known = peer.heartbeat.take();
        let age = peer.age(now);
        let sent_at = peer.sent_at(now, heartbeat.uptime, liveness.period);
        let was_live = age.is_some_and(|age| age <= liveness.suspicion);
        // What lay in a buffer shows no gap.
        let last_seen = peer.last_seen();
        if known.is_some() && sent_at.saturating_sub(last_seen) > liveness.suspicion {
            peer.channel.note_gap(last_seen, now, liveness.suspicion);
        }
        let differ = |differs: fn(&Heartbeat, &Heartbeat) -> bool| {
            known
                .as_ref()
                .is_none_or(|known| differs(known, &heartbeat))
        };
        let shows_other =
            differ(|one, other| (one.epoch, one.digest) != (other.epoch, other.digest));
        let misses_others = differ(|one, other| one.misses != other.misses);
        let is_new = differ(|one, other| (one.phase, one.stop) != (other.phase, other.stop));
        let advanced = differ(|one, other| one.steps_done != other.steps_done);
        let is_of_note = differ(|one, other| {
            (one.epoch, one.knows, one.voters) != (other.epoch, other.knows, other.voters)
        });
        let told_misses = known.is_some_and(|known| known.uptime > liveness.suspicion);
        let tells_misses = heartbeat.uptime > liveness.suspicion;
        let changes = !was_live || misses_others || is_of_note || told_misses != tells_misses;
        peer.note_heartbeat(heartbeat, sent_at);
        self.changes += u64::from(changes);
        if shows_other {
            self.shown.count += 1;
            self.shown.last = Some(run.module);
        }
        Ok(match age {
            Some(age) if !shows_other && !misses_others && !is_new => {
                HeartbeatNews::StillLive { age, advanced }
            }
            _ => HeartbeatNews::New,
        })
    }

    /// How much earlier than before the latest heartbeat of a module came.
    pub fn gain_of(&self, module: ModuleId, now: Duration) -> Duration {
        let clocks = self.peers.get(&module).into_iter().flat_map(Peer::clocks);
        let gain = clocks.map(|clock| clock.gain_since(now)).max();
        gain.unwrap_or(Duration::ZERO)
    }

    /// A module belongs to a session with other voters.
    pub fn note_other_voters(&mut self, module: ModuleId) {
        if let Some(peer) = self.peers.get_mut(&module) {
            peer.has_other_voters = true;
        }
    }

    /// A participant has left the graph: the modules for which it sends are silent from now on. Returns whether there are any.
    /// Enforces M9.
    pub fn depart(&mut self, now: Duration, source: SourceId) -> bool {
        let mut is_any = false;
        let sent_for = self.peers.values_mut();
        for peer in sent_for.filter(|peer| peer.source == Some(source)) {
            is_any |= peer.left_at.is_none();
            peer.left_at = Some(now);
        }
        self.changes += u64::from(is_any);
        is_any
    }

    /// Handles a module's state.
    pub fn handle_state(
        &mut self,
        liveness: Liveness,
        state: Arc<ModuleState>,
        source: Option<SourceId>,
    ) -> Result<StateNews, Refusal> {
        let run = state.module.run(state.incarnation);
        let known = self.peers.get(&run.module).map(|peer| peer.incarnation);
        let is_known = known == Some(run.incarnation);
        let peer = match self.admit(liveness, run, source) {
            Ok(peer) => peer,
            Err(refusal) => {
                if matches!(
                    refusal,
                    Refusal::DuplicateModule | Refusal::StaleIncarnation
                ) {
                    self.keep_for_later(state, source);
                }
                return Err(refusal);
            }
        };
        let known = peer.state.as_ref();
        if known.is_some_and(|known| known.sequence >= state.sequence) {
            return Ok(StateNews::Old);
        }
        let service = known.map(|known| known.service);
        let changes = service != Some(state.service);
        let shown = known.map(|known| known.digest.is_some());
        let news = if !is_known || shown != Some(state.digest.is_some()) {
            StateNews::OfRun
        } else if known.is_some_and(|known| state.goes_on_from(known)) {
            StateNews::OnTheWay
        } else {
            StateNews::OfModule
        };
        peer.state = Some(without_proofs(state));
        self.changes += u64::from(changes);
        Ok(news)
    }

    /// Keeps the latest state of a run that may yet take the place of the one that is known.
    fn keep_for_later(&mut self, state: Arc<ModuleState>, source: Option<SourceId>) {
        let Some(peer) = self.peers.get_mut(&state.module) else {
            return;
        };
        let order = |state: &ModuleState| (state.incarnation, state.sequence);
        let kept = peer.kept.as_ref().map(|(kept, _)| order(kept));
        if kept < Some(order(&state)) {
            peer.kept = Some((without_proofs(state), source));
        }
    }

    /// Takes the channel from a module for failed, because that makes no progress.
    /// Enforces M6.
    pub fn fail_channel(&mut self, module: ModuleId, now: Duration, least: Duration) {
        if let Some(peer) = self.peers.get_mut(&module) {
            peer.channel.fail(now, least);
            self.changes += 1;
        }
    }

    /// These members show the same plan as this module.
    pub fn note_same_plan(&mut self, now: Duration, members: &BTreeMap<ModuleId, Incarnation>) {
        self.changes += 1;
        let is_member = |(module, _): &(&ModuleId, &mut Peer)| members.contains_key(module);
        let members = self.peers.iter_mut().filter(is_member);
        members.for_each(|(_, peer)| peer.channel.recover(now));
    }

    /// When the first peer falls silent or comes up again, if none changes; later heartbeats only put it off.
    pub fn unchanged_until(&mut self, liveness: Liveness) -> Duration {
        let version = self.version();
        if let Some((known, until)) = self.unchanged_until
            && known == version
            && liveness.now < until
        {
            return until;
        }
        let times = self.peers.values().flat_map(|peer| {
            let age = peer
                .age(liveness.now)
                .filter(|&age| age <= liveness.suspicion);
            let silent_at = age.map(|age| liveness.now + (liveness.suspicion - age));
            let up_at = Some(peer.channel.down_until()).filter(|&at| at > liveness.now);
            silent_at.into_iter().chain(up_at)
        });
        let until = times.min().unwrap_or(Duration::MAX);
        self.unchanged_until = Some((version, until));
        until
    }
}
