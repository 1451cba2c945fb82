//! What is known of the other modules, and which of them live.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use crate::model::{Heartbeat, Incarnation, MODULES_MAX, ModuleId, ModuleState};

use super::io::SourceId;
use super::mutation::{Mutation, Switch};
use super::refusal::Refusal;

/// So many modules are known at least, and up to four times as many as are expected: more are taken for invented.
const PEERS_MIN: usize = 1_024;

/// By how much two clocks may drift apart: one part in this many. Quartz is a hundred times better.
const DRIFT_DIVISOR: u32 = 1_000;

/// After so many rosters in vain, the time for which a module is not wanted doubles no more.
const VAIN_DOUBLINGS_MAX: u32 = 5;

/// One other module, as heard.
#[derive(Clone, Debug)]
pub(super) struct Peer {
    pub incarnation: Incarnation,
    pub heartbeat: Option<Heartbeat>,
    pub state: Option<Arc<ModuleState>>,
    /// What a later run said of itself while this one still counted as living, and who sent it: a state comes only once.
    successor: Option<(Arc<ModuleState>, Option<SourceId>)>,
    source: Option<SourceId>,
    /// When its latest heartbeat was sent, by this module's clock.
    alive_at: Option<Duration>,
    /// When this incarnation was first heard.
    first_heard: Duration,
    /// The peer's start by this module's clock, as the least delayed heartbeat shows it; signed microseconds.
    clock_offset_us: Option<(i128, Duration)>,
    /// Until when it is taken for dead because it made no progress.
    excluded_until: Duration,
    /// In how many rosters it was listed since it last agreed to one.
    vain_rosters: u32,
    /// Until when no epoch is opened for its sake, because rosters with it came to nothing, and one without it agreed.
    unwanted_until: Duration,
}

impl Peer {
    fn new(incarnation: Incarnation, source: Option<SourceId>, now: Duration) -> Self {
        Self {
            incarnation,
            heartbeat: None,
            state: None,
            successor: None,
            source,
            alive_at: None,
            first_heard: now,
            clock_offset_us: None,
            excluded_until: Duration::ZERO,
            vain_rosters: 0,
            unwanted_until: Duration::ZERO,
        }
    }

    /// Who speaks for it, as far as the transport tells.
    pub fn source(&self) -> Option<SourceId> {
        self.source
    }

    /// How old the latest heartbeat is; `None` without one.
    pub fn age(&self, now: Duration) -> Option<Duration> {
        self.alive_at.map(|at| now.saturating_sub(at))
    }

    /// Estimates when a heartbeat was sent, by this module's clock.
    ///
    /// The least delayed heartbeat so far tells the offset between the clocks; it may creep, since clocks drift. A
    /// heartbeat that lay in a buffer while this process or the network stood still is thus seen to be old.
    fn sent_at(&mut self, now: Duration, uptime: Duration) -> Duration {
        let micros = |duration: Duration| i128::try_from(duration.as_micros()).unwrap_or(i128::MAX);
        let sample = micros(now) - micros(uptime).min(i128::MAX / 4);
        let offset = match self.clock_offset_us {
            None => sample,
            Some((offset, at)) => {
                sample.min(offset + micros(now.saturating_sub(at) / DRIFT_DIVISOR))
            }
        };
        self.clock_offset_us = Some((offset, now));
        let sent = (offset + micros(uptime).min(i128::MAX / 4)).clamp(0, micros(now));
        Duration::from_micros(u64::try_from(sent).unwrap_or(u64::MAX))
    }
}

/// What a heartbeat tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hearing {
    /// A later one is known already.
    Old,
    /// Nothing but that the module is still there; the one before was this old.
    StillHere { age: Duration },
    /// The module, or what it shows, is new.
    News,
}

/// All other modules that were heard.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    pub switch: Switch,
    peers: BTreeMap<ModuleId, Peer>,
    /// At most so many are kept.
    room: usize,
}

impl Default for Peers {
    fn default() -> Self {
        Self {
            switch: Switch::default(),
            peers: BTreeMap::new(),
            room: MODULES_MAX,
        }
    }
}

impl Peers {
    /// So many modules are expected, where that is known.
    pub fn expect(&mut self, expected: Option<u32>) {
        let expected = expected.and_then(|count| usize::try_from(count).ok());
        self.room = expected.map_or(MODULES_MAX, |count| {
            PEERS_MIN.max(count.saturating_mul(4)).min(MODULES_MAX)
        });
    }

    /// Whether there is room for one more, if need be in the place of one that has long been silent.
    fn make_room(&mut self, now: Duration, suspicion: Duration) -> bool {
        if self.peers.len() < self.room {
            return true;
        }
        let last_heard = |peer: &Peer| peer.alive_at.unwrap_or(peer.first_heard);
        let quietest = self.peers.iter().min_by_key(|(_, peer)| last_heard(peer));
        let gone = quietest
            .filter(|(_, peer)| now.saturating_sub(last_heard(peer)) > suspicion)
            .map(|(&module, _)| module);
        gone.is_some_and(|module| self.peers.remove(&module).is_some())
    }

    pub fn get(&self, module: ModuleId) -> Option<&Peer> {
        self.peers.get(&module)
    }

    pub fn iter(&self) -> impl Iterator<Item = (ModuleId, &Peer)> {
        self.peers.iter().map(|(&module, peer)| (module, peer))
    }

    /// Whether a message of `module` comes from the process that speaks for it, as far as is known.
    pub fn check_source(
        &self,
        module: ModuleId,
        incarnation: Incarnation,
        source: Option<SourceId>,
    ) -> Result<(), Refusal> {
        let Some(peer) = self.peers.get(&module) else {
            return Ok(());
        };
        if incarnation < peer.incarnation {
            return Err(Refusal::StaleIncarnation);
        }
        match (peer.source, source) {
            (Some(known), Some(given)) if known != given && peer.incarnation == incarnation => {
                Err(Refusal::WrongSource)
            }
            _ => Ok(()),
        }
    }

    /// The entry of the module that speaks, made or replaced where the rules of incarnations allow it.
    fn admit(
        &mut self,
        now: Duration,
        suspicion: Duration,
        module: ModuleId,
        incarnation: Incarnation,
        source: Option<SourceId>,
    ) -> Result<&mut Peer, Refusal> {
        self.check_source(module, incarnation, source)?;
        if !self.peers.contains_key(&module) && !self.make_room(now, suspicion) {
            return Err(Refusal::TooManyModules);
        }
        let peer = self
            .peers
            .entry(module)
            .or_insert_with(|| Peer::new(incarnation, source, now));
        if incarnation > peer.incarnation {
            let last = peer.alive_at.unwrap_or(peer.first_heard);
            let waits = !self.switch.is(Mutation::DropIncarnationCheck);
            if waits && now.saturating_sub(last) <= suspicion {
                return Err(Refusal::DuplicateModule);
            }
            let held = peer.successor.take();
            *peer = Peer::new(incarnation, source, now);
            peer.state = held
                .filter(|(state, sender)| state.incarnation == incarnation && *sender == source)
                .map(|(state, _)| state);
        }
        peer.source = peer.source.or(source);
        Ok(peer)
    }

    /// Takes a heartbeat.
    pub fn hear_heartbeat(
        &mut self,
        now: Duration,
        suspicion: Duration,
        heartbeat: Heartbeat,
        source: Option<SourceId>,
    ) -> Result<Hearing, Refusal> {
        let (module, incarnation) = (heartbeat.module, heartbeat.incarnation);
        let trusts = self.switch.is(Mutation::TrustBufferedHeartbeats);
        let peer = self.admit(now, suspicion, module, incarnation, source)?;
        let known = peer.heartbeat;
        if known.is_some_and(|known| known.sequence >= heartbeat.sequence) {
            return Ok(Hearing::Old);
        }
        let age = peer.age(now);
        let sent_at = if trusts {
            now
        } else {
            peer.sent_at(now, heartbeat.uptime)
        };
        peer.alive_at = Some(peer.alive_at.map_or(sent_at, |at| at.max(sent_at)));
        peer.heartbeat = Some(heartbeat);
        let shows = |heartbeat: Heartbeat| (heartbeat.epoch, heartbeat.digest, heartbeat.phase);
        Ok(match (known, age) {
            (Some(known), Some(age)) if shows(known) == shows(heartbeat) => {
                Hearing::StillHere { age }
            }
            _ => Hearing::News,
        })
    }

    /// Takes a module's state; `Ok(false)` when the same or a later one is known already.
    pub fn hear_state(
        &mut self,
        now: Duration,
        suspicion: Duration,
        state: Arc<ModuleState>,
        source: Option<SourceId>,
    ) -> Result<bool, Refusal> {
        let (module, incarnation) = (state.module, state.incarnation);
        let peer = match self.admit(now, suspicion, module, incarnation, source) {
            Ok(peer) => peer,
            Err(refusal) => {
                self.keep_for_later(refusal, state, source);
                return Err(refusal);
            }
        };
        if peer
            .state
            .as_ref()
            .is_some_and(|known| known.sequence >= state.sequence)
        {
            return Ok(false);
        }
        peer.state = Some(without_proofs(state));
        Ok(true)
    }

    /// Keeps the latest state of a run that may yet take the place of the one that is known.
    fn keep_for_later(
        &mut self,
        refusal: Refusal,
        state: Arc<ModuleState>,
        source: Option<SourceId>,
    ) {
        if refusal != Refusal::DuplicateModule {
            return;
        }
        let Some(peer) = self.peers.get_mut(&state.module) else {
            return;
        };
        let order = |state: &ModuleState| (state.incarnation, state.sequence);
        let held = peer.successor.as_ref().map(|(held, _)| order(held));
        if held < Some(order(&state)) {
            peer.successor = Some((without_proofs(state), source));
        }
    }

    /// Whether a module's latest heartbeat is younger than `suspicion` and it is not excluded for want of progress.
    pub fn is_live(&self, now: Duration, suspicion: Duration, module: ModuleId) -> bool {
        self.peers.get(&module).is_some_and(|peer| {
            self.switch.is(Mutation::CountDeadAsAlive)
                || (peer.excluded_until <= now && peer.age(now).is_some_and(|age| age <= suspicion))
        })
    }

    /// The modules that live.
    pub fn live(&self, now: Duration, suspicion: Duration) -> BTreeSet<ModuleId> {
        self.peers
            .keys()
            .copied()
            .filter(|&module| self.is_live(now, suspicion, module))
            .collect()
    }

    /// Takes a module for dead until a time, because it makes no progress.
    pub fn exclude(&mut self, module: ModuleId, until: Duration) {
        if let Some(peer) = self.peers.get_mut(&module) {
            peer.excluded_until = peer.excluded_until.max(until);
        }
    }

    /// A roster lists these modules; whether they will agree to it is open.
    pub fn listed(&mut self, members: impl Iterator<Item = ModuleId>) {
        for module in members {
            if let Some(peer) = self.peers.get_mut(&module) {
                peer.vain_rosters = (peer.vain_rosters + 1).min(VAIN_DOUBLINGS_MAX);
            }
        }
    }

    /// The members of a roster have agreed, and want none of those for a while with whom rosters came to nothing: twice as
    /// long each time, lest one that hears only some of the others halts them all again and again.
    pub fn agreed(&mut self, now: Duration, least: Duration, is_member: impl Fn(ModuleId) -> bool) {
        for (&module, peer) in &mut self.peers {
            if is_member(module) {
                peer.vain_rosters = 0;
                peer.unwanted_until = Duration::ZERO;
            } else if peer.vain_rosters > 0 {
                peer.unwanted_until = now + least * (1 << (peer.vain_rosters - 1));
            }
        }
    }

    /// Whether an epoch may be opened for a module's sake.
    pub fn is_wanted(&self, now: Duration, module: ModuleId) -> bool {
        let peer = self.peers.get(&module);
        peer.is_none_or(|peer| peer.unwanted_until <= now)
    }
}

/// What a state waited for is for observers; to keep it would let anyone fill this module's memory.
fn without_proofs(state: Arc<ModuleState>) -> Arc<ModuleState> {
    if state.waited_for.is_empty() && state.agreed_on.is_empty() {
        return state;
    }
    let mut state = ModuleState::clone(&state);
    state.waited_for = Vec::new();
    state.agreed_on = Vec::new();
    Arc::new(state)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ModulePhase;

    const SUSPICION: Duration = Duration::from_secs(5);

    fn heartbeat(incarnation: u64, sequence: u64, uptime_s: u64) -> Heartbeat {
        Heartbeat {
            module: ModuleId(1),
            incarnation: Incarnation(incarnation),
            sequence,
            uptime: Duration::from_secs(uptime_s),
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            phase: ModulePhase::Listening,
        }
    }

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn a_buffered_heartbeat_is_not_fresh() {
        let mut peers = Peers::default();
        peers
            .hear_heartbeat(at(10), SUSPICION, heartbeat(1, 1, 1), None)
            .unwrap();
        assert!(peers.is_live(at(14), SUSPICION, ModuleId(1)));
        // This process slept for 20 s; the heartbeat that was sent one second after the first reaches it only now.
        peers
            .hear_heartbeat(at(30), SUSPICION, heartbeat(1, 2, 2), None)
            .unwrap();
        assert!(!peers.is_live(at(30), SUSPICION, ModuleId(1)));
        peers
            .hear_heartbeat(at(30), SUSPICION, heartbeat(1, 3, 21), None)
            .unwrap();
        assert!(peers.is_live(at(30), SUSPICION, ModuleId(1)));
    }

    #[test]
    fn invented_modules_take_no_more_room_than_there_is() {
        let mut peers = Peers::default();
        peers.expect(Some(8));
        let mut hear = |now, module| {
            let mut heartbeat = heartbeat(1, now, now);
            heartbeat.module = ModuleId(module);
            peers
                .hear_heartbeat(at(now), SUSPICION, heartbeat, None)
                .map(|_| ())
        };
        for module in 0..1_024 {
            assert_eq!(hear(1, module), Ok(()));
        }
        assert_eq!(hear(2, 5_000), Err(Refusal::TooManyModules));
        assert_eq!(hear(3, 7), Ok(()), "who is known stays known");
        assert_eq!(hear(7, 5_000), Ok(()), "the silent make room");
        assert!(peers.get(ModuleId(7)).is_some());
    }

    #[test]
    fn a_second_process_is_refused_until_the_first_is_silent() {
        let mut peers = Peers::default();
        let (first, second) = (Some(SourceId(1)), Some(SourceId(2)));
        peers
            .hear_heartbeat(at(1), SUSPICION, heartbeat(1, 1, 1), first)
            .unwrap();
        assert_eq!(
            peers.hear_heartbeat(at(2), SUSPICION, heartbeat(2, 1, 0), second),
            Err(Refusal::DuplicateModule)
        );
        assert_eq!(
            peers.hear_heartbeat(at(2), SUSPICION, heartbeat(1, 2, 2), second),
            Err(Refusal::WrongSource)
        );
        assert_eq!(
            peers.hear_heartbeat(at(9), SUSPICION, heartbeat(2, 2, 7), second),
            Ok(Hearing::News)
        );
        assert_eq!(
            peers.hear_heartbeat(at(9), SUSPICION, heartbeat(1, 3, 8), first),
            Err(Refusal::StaleIncarnation)
        );
    }
}
