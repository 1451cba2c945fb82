//! The other modules, and which of them are live.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Epoch, Heartbeat, Incarnation, MODULES_MAX, ModuleId, ModulePhase, ModuleRun, ModuleState,
    Service, SourceId,
};

use super::peer::{Peer, state_of, without_proofs};
use super::refusal::Refusal;

/// At least this many modules are kept, and up to four times as many as are expected: more are taken for invented.
const PEERS_MIN: usize = 1_024;

/// A run that has been silent for this many times `suspicion` no longer keeps an earlier run of its module out.
pub(super) const SILENCES_REMEMBERED: u32 = 4;

/// A module that misses more live ones than this is left out as it is: so many pairs are those of a cut.
const MISSES_MAX: usize = 64;

/// When, and by which limit, modules are judged to be live.
#[derive(Clone, Copy, Debug)]
pub(super) struct Liveness {
    /// The greatest incarnation that can be true.
    pub latest_stamp: u64,
    /// The time between two heartbeats of a module.
    pub period: Duration,
    pub now: Duration,
    pub suspicion: Duration,
}

impl Liveness {
    /// Whether a peer is live: its latest heartbeat is younger than `suspicion`, and its channel counts as up.
    pub fn includes(self, peer: &Peer) -> bool {
        let is_recent = |age: Duration| age <= self.suspicion;
        peer.channel.is_up(self.now) && peer.age(self.now).is_some_and(is_recent)
    }
}

/// What a heartbeat changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HeartbeatNews {
    /// Nothing: a later one is known already.
    Old,
    /// Nothing but that the module is still live; the heartbeat before was this old.
    StillLive { age: Duration },
    /// The module, or what it shows, is new.
    New,
}

/// What a judgement of all peers depends on, apart from them: the epoch, the revision of the target, the module's own
/// service, and the version of the known bodies.
pub(super) type Judged = (Epoch, Option<u64>, Service, u64);

/// A judgement of all peers that gave no reason for an epoch.
#[derive(Clone, Copy, Debug)]
struct Calm {
    judged: Judged,
    /// The version of the peers at that time.
    version: (u64, ShownChanges),
    /// When time alone may change the judgement.
    until: Duration,
}

/// All other modules that sent a message.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    peers: BTreeMap<ModuleId, Peer>,
    /// The greatest number of peers that are kept.
    room: usize,
    /// Counts the changes to peers that may give a reason for an epoch.
    changes: u64,
    /// The last judgement without a reason. Between changes it saves a look at every peer at every message.
    calm: Option<Calm>,
    shown: ShownChanges,
}

/// How often a heartbeat showed another epoch or digest than the one before it, and of which module the last of these was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ShownChanges {
    count: u64,
    last: Option<ModuleId>,
}

impl ShownChanges {
    /// The only module of which this changed since `earlier`, if there is just one.
    pub fn only_since(self, earlier: Self) -> Option<ModuleId> {
        self.last.filter(|_| self.count == earlier.count + 1)
    }
}

impl Hash for Peers {
    /// The judgement follows from the peers, and the count only saves work.
    fn hash<H: Hasher>(&self, state: &mut H) {
        (&self.peers, self.room).hash(state);
    }
}

impl Default for Peers {
    fn default() -> Self {
        Self {
            peers: BTreeMap::new(),
            room: MODULES_MAX,
            changes: 0,
            calm: None,
            shown: ShownChanges::default(),
        }
    }
}

impl Peers {
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

    pub fn get_mut(&mut self, module: ModuleId) -> Option<&mut Peer> {
        self.peers.get_mut(&module)
    }

    pub fn get(&self, module: ModuleId) -> Option<&Peer> {
        self.peers.get(&module)
    }

    /// The latest heartbeat of a module.
    pub fn heartbeat(&self, module: ModuleId) -> Option<&Heartbeat> {
        self.peers.get(&module)?.heartbeat.as_ref()
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

    /// Whether a module's latest heartbeat shows that it computes a plan in this epoch.
    pub fn computes(&self, module: ModuleId, epoch: Epoch) -> bool {
        let heartbeat = self.heartbeat(module);
        heartbeat.is_some_and(|heartbeat| {
            heartbeat.epoch == Some(epoch) && heartbeat.phase == ModulePhase::Computing
        })
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &Peer> {
        self.peers.values()
    }

    /// The latest state of a module.
    pub fn state(&self, module: ModuleId) -> Option<&Arc<ModuleState>> {
        self.peers.get(&module)?.state.as_ref()
    }

    /// The latest states of all modules.
    pub fn states(&self) -> impl Iterator<Item = &Arc<ModuleState>> {
        self.peers.values().filter_map(|peer| peer.state.as_ref())
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
        let is_new = differ(|one, other| {
            (one.phase, one.steps_done, one.stop) != (other.phase, other.steps_done, other.stop)
        });
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
                HeartbeatNews::StillLive { age }
            }
            _ => HeartbeatNews::New,
        })
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

    /// Handles a module's state; `Ok(false)` when the same or a later one is known already.
    pub fn handle_state(
        &mut self,
        liveness: Liveness,
        state: Arc<ModuleState>,
        source: Option<SourceId>,
    ) -> Result<bool, Refusal> {
        let run = state.module.run(state.incarnation);
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
            return Ok(false);
        }
        let service = known.map(|known| known.service);
        let changes = service != Some(state.service);
        peer.state = Some(without_proofs(state));
        self.changes += u64::from(changes);
        Ok(true)
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

    /// Whether a module's latest heartbeat is younger than `suspicion` and its channel counts as up.
    /// Enforces M1.
    pub fn is_live(&self, liveness: Liveness, module: ModuleId) -> bool {
        self.get(module).is_some_and(|peer| liveness.includes(peer))
    }

    /// The live peers in ascending order.
    pub fn live(&self, liveness: Liveness) -> impl Iterator<Item = (ModuleId, &Peer)> {
        self.peers
            .iter()
            .filter(move |(_, peer)| liveness.includes(peer))
            .map(|(&module, peer)| (module, peer))
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

    /// The pairs of live modules, or of this one and a live one, of which the first does not receive the second. One that misses many is
    /// paired with itself.
    pub fn missed_pairs(&self, liveness: Liveness, own: ModuleId) -> Vec<(ModuleId, ModuleId)> {
        let is_here = |module: ModuleId| module == own || self.is_live(liveness, module);
        let mut pairs = Vec::new();
        // Most modules miss the same ones, which are gone.
        let mut last: (&[ModuleId], Vec<ModuleId>) = (&[], Vec::new());
        for (module, peer) in self.live(liveness) {
            let misses = peer.misses();
            if last.0 != misses {
                let here = misses.iter().copied().filter(|&missed| is_here(missed));
                last = (misses, here.take(MISSES_MAX + 1).collect());
            }
            if last.1.len() > MISSES_MAX {
                pairs.push((module, module));
            } else {
                pairs.extend(last.1.iter().map(|&missed| (module, missed)));
            }
        }
        pairs
    }

    /// Those of some modules, which ascend, that are not live.
    pub fn not_received(
        &self,
        liveness: Liveness,
        named: impl Iterator<Item = ModuleId>,
    ) -> impl Iterator<Item = ModuleId> {
        let named = self.along(named.map(|module| (module, ())));
        let named =
            named.filter(move |(_, (), peer)| !peer.is_some_and(|peer| liveness.includes(peer)));
        named.map(|(module, ..)| module)
    }

    /// Each of these modules, which ascend, with its peer, if that is known: one walk along all peers in place of a search for
    /// each.
    pub fn along<T>(
        &self,
        modules: impl Iterator<Item = (ModuleId, T)>,
    ) -> impl Iterator<Item = (ModuleId, T, Option<&Peer>)> {
        let mut peers = self.peers.iter().peekable();
        modules.map(move |(module, value)| {
            while peers.next_if(|&(&id, _)| id < module).is_some() {}
            let peer = peers.next_if(|&(&id, _)| id == module);
            (module, value, peer.map(|(_, peer)| peer))
        })
    }

    /// When the first peer falls silent or comes up again, if none changes.
    pub fn unchanged_until(&self, liveness: Liveness) -> Duration {
        let times = self.peers.values().flat_map(|peer| {
            let age = peer
                .age(liveness.now)
                .filter(|&age| age <= liveness.suspicion);
            let silent_at = age.map(|age| liveness.now + (liveness.suspicion - age));
            let up_at = Some(peer.channel.down_until()).filter(|&at| at > liveness.now);
            silent_at.into_iter().chain(up_at)
        });
        times.min().unwrap_or(Duration::MAX)
    }

    /// No peer gives a reason for an epoch, until one changes or a time has come.
    pub fn note_calm(&mut self, liveness: Liveness, judged: Judged, due: Option<Duration>) {
        let until = self.unchanged_until(liveness);
        self.calm = Some(Calm {
            judged,
            version: self.version(),
            until: due.map_or(until, |due| until.min(due)),
        });
    }

    /// Whether no peer gave a reason for an epoch, and none has changed since.
    pub fn is_calm(&self, now: Duration, judged: Judged) -> bool {
        self.calm.is_some_and(|calm| {
            calm.judged == judged && calm.version == self.version() && now < calm.until
        })
    }
}

#[cfg(test)]
mod tests;
