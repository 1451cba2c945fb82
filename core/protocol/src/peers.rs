//! The other modules, and which of them are live.

mod table;

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Epoch, Heartbeat, ModuleId, ModulePhase, ModuleRun, ModuleState, Service, SourceId, Stop,
};

pub(super) use table::PeerTable;

use super::peer::Peer;
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
    /// Nothing but that the module is still live, and how many steps it has done if it has `advanced`; the heartbeat before was this old.
    StillLive { age: Duration, advanced: bool },
    /// The module, or what it shows, is new.
    New,
}

/// What a state changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StateNews {
    /// Nothing: it, or a later one, is known already.
    Old,
    /// Only the module's pose, or how many steps it has done.
    OnTheWay,
    /// What the module shows.
    OfModule,
    /// What is known of its run as well: it is the first state of that, or shows a plan unlike the last one.
    OfRun,
}

/// A heartbeat as it was received.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard {
    pub run: ModuleRun,
    pub epoch: Option<Epoch>,
    pub stop: Stop,
    pub holds_plan: bool,
    pub news: Result<HeartbeatNews, Refusal>,
    /// How much earlier than before it came.
    pub gain: Duration,
}

/// A state as it was received.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    pub state: Arc<ModuleState>,
    pub news: Result<StateNews, Refusal>,
}

impl Heard {
    /// A heartbeat as it is received for the first time.
    pub fn of(heartbeat: &Heartbeat) -> Self {
        Self {
            run: heartbeat.module.run(heartbeat.incarnation),
            epoch: heartbeat.epoch,
            stop: heartbeat.stop,
            holds_plan: heartbeat.digest.is_some(),
            news: Ok(HeartbeatNews::New),
            gain: Duration::ZERO,
        }
    }
}

impl Seen {
    /// A state as it is received for the first time.
    pub fn of(state: &Arc<ModuleState>) -> Self {
        Self {
            state: Arc::clone(state),
            news: Ok(StateNews::OfRun),
        }
    }
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

/// All other modules that sent a message, as one module sees them. It shares what is known of them with the other modules of its process,
/// and is no peer of itself.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    own: ModuleId,
    table: Box<PeerTable>,
    /// Whether the table belongs to another module of the process at present.
    is_lent: bool,
    /// The last judgement without a reason. Between changes it saves a look at every peer at every message.
    calm: Option<Calm>,
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
        self.others().for_each(|peer| peer.hash(state));
        self.table().room.hash(state);
    }
}

impl Peers {
    /// What a module knows of others at its start: nothing.
    pub fn of(own: ModuleId) -> Self {
        Self {
            own,
            table: Box::default(),
            is_lent: false,
            calm: None,
        }
    }

    fn table(&self) -> &PeerTable {
        debug_assert!(!self.is_lent, "another module of the process has the table");
        &self.table
    }

    /// What this module shares with the others of its process.
    pub fn table_mut(&mut self) -> &mut PeerTable {
        debug_assert!(!self.is_lent, "another module of the process has the table");
        &mut self.table
    }

    /// Takes the table of the process, or gives it back.
    pub fn exchange(&mut self, table: &mut Box<PeerTable>) {
        self.is_lent = !self.is_lent;
        std::mem::swap(&mut self.table, table);
    }

    /// The other modules, in ascending order.
    fn others(&self) -> impl Iterator<Item = (&ModuleId, &Peer)> {
        let peers = self.table().peers.iter();
        peers.filter(|&(&module, _)| module != self.own)
    }

    pub fn get(&self, module: ModuleId) -> Option<&Peer> {
        let table = (module != self.own).then(|| self.table());
        table?.get(module)
    }

    /// The latest heartbeat of a module.
    pub fn heartbeat(&self, module: ModuleId) -> Option<&Heartbeat> {
        self.get(module)?.heartbeat.as_ref()
    }

    /// Counts the changes of what heartbeats show.
    pub fn shown(&self) -> ShownChanges {
        self.table().shown()
    }

    /// Changes whenever a peer becomes known, restarts, leaves, or shows another epoch, digest or service, or that it misses or knows
    /// others; time changes only ages.
    pub fn version(&self) -> (u64, ShownChanges) {
        self.table().version()
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
        self.others().map(|(_, peer)| peer)
    }

    /// The latest state of a module.
    pub fn state(&self, module: ModuleId) -> Option<&Arc<ModuleState>> {
        self.get(module)?.state.as_ref()
    }

    /// The latest states of all modules.
    pub fn states(&self) -> impl Iterator<Item = &Arc<ModuleState>> {
        self.all().filter_map(|peer| peer.state.as_ref())
    }

    /// Checks that a message of a run comes from the process that sends for its module, where that is known.
    pub fn check_source(&self, run: ModuleRun, source: Option<SourceId>) -> Result<(), Refusal> {
        self.table().check_source(run, source)
    }

    /// Whether a module's latest heartbeat is younger than `suspicion` and its channel counts as up.
    /// Enforces M1.
    pub fn is_live(&self, liveness: Liveness, module: ModuleId) -> bool {
        self.get(module).is_some_and(|peer| liveness.includes(peer))
    }

    /// The live peers in ascending order.
    pub fn live(&self, liveness: Liveness) -> impl Iterator<Item = (ModuleId, &Peer)> {
        let live = self.table().live(liveness);
        live.filter(|&(module, _)| module != self.own)
    }

    /// The pairs of live modules, or of this one and a live one, of which the first does not receive the second. One that misses many is
    /// paired with itself.
    pub fn missed_pairs(&self, liveness: Liveness) -> Vec<(ModuleId, ModuleId)> {
        let is_here = |module: ModuleId| module == self.own || self.is_live(liveness, module);
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
        let mut peers = self.others().peekable();
        modules.map(move |(module, value)| {
            while peers.next_if(|&(&id, _)| id < module).is_some() {}
            let peer = peers.next_if(|&(&id, _)| id == module);
            (module, value, peer.map(|(_, peer)| peer))
        })
    }

    /// No peer gives a reason for an epoch, until one changes or a time has come.
    pub fn note_calm(&mut self, liveness: Liveness, judged: Judged, due: Option<Duration>) {
        let until = self.table_mut().unchanged_until(liveness);
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
