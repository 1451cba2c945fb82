//! Whom this module does not receive, and who receives whom among all that it receives.

use std::collections::{BTreeSet, VecDeque};
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Epoch, MODULES_MAX, ModuleId, ModulePhase, Roster, RosterMember, Service, Whereabouts,
};

use crate::cliques::{self, Candidate};
use crate::context::Context;
use crate::peers::ShownChanges;

/// So many cliques are kept: that of all live modules, and that of those that have frozen.
const FOUND_MAX: usize = 2;

/// What was last found of who receives whom.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reception {
    /// The modules that were last listed as not received.
    misses: Arc<[ModuleId]>,
    /// The live modules that another one misses.
    missed: BTreeSet<ModuleId>,
    /// Who misses whom, as it was last found.
    links: Option<Links>,
    /// The cliques that were last found while there were missed pairs, each with what it was found in.
    found: VecDeque<(Sight, Arc<[ModuleId]>)>,
    /// A clique that leaves out members of the roster in force, and since when it has been the best.
    replacing: Option<(Arc<[ModuleId]>, Duration)>,
    /// Whether newcomers could fill more spots, as it was last found, and what that was found from.
    filling: Option<(Filling, bool)>,
}

impl Hash for Reception {
    /// What was found follows from the rest of the context.
    fn hash<H: Hasher>(&self, state: &mut H) {
        (&self.misses, &self.missed, &self.replacing).hash(state);
    }
}

/// Who misses whom among the live modules, and the best clique of them. It holds until a peer changes, or a time has come.
#[derive(Clone, Debug)]
struct Links {
    /// The version of the peers.
    peers: (u64, ShownChanges),
    until: Duration,
    missed: Arc<[(ModuleId, ModuleId)]>,
    /// From what the modules were last found that this one misses.
    named: Option<Named>,
    /// The best clique, once it is asked for.
    clique: Option<(Standing, Arc<[ModuleId]>)>,
}

/// What names those whom this module may miss: the epoch of a roster, the voters, and the version of the known bodies.
type Named = (Option<Epoch>, u64, u64);

/// What the clique depends on apart from the peers: who votes, and what this module shows.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Standing {
    target: Option<u64>,
    voters: u64,
    votes_removed: (usize, usize),
    votes_due: Vec<ModuleId>,
    knows: bool,
    service: Service,
    is_planned: bool,
}

/// What a clique depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Sight {
    candidates: Vec<Candidate>,
    missed: Vec<(ModuleId, ModuleId)>,
    votes: Vec<(ModuleId, bool)>,
    standing: Standing,
}

/// What depends on it whether newcomers could fill more spots: the epoch and the version of the known bodies, the clique and the
/// newcomers.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Filling {
    epoch: Epoch,
    bodies: u64,
    clique: Vec<ModuleId>,
    newcomers: Vec<ModuleId>,
}

impl Context {
    /// The modules that this one knows of and does not receive: voters, members, and those whose bodies are known. It tells that once it
    /// has listened for `suspicion`.
    /// Enforces M6.
    pub fn misses(&mut self, roster: Option<&Roster>) -> Arc<[ModuleId]> {
        if !self.has_listened() {
            return Arc::default();
        }
        let named: Named = (
            roster.map(|roster| roster.epoch),
            self.session.voters_digest(),
            self.bodies.version(),
        );
        if self.links().named.replace(named) == Some(named) {
            return Arc::clone(&self.reception.misses);
        }
        let liveness = self.liveness();
        let members = roster.into_iter().flat_map(|roster| &roster.members);
        let members = members.map(|member| member.module.id);
        let voters = self.session.voters().named.iter().copied();
        let bodies = self.bodies.of_this_session();
        let bodies = bodies.filter(|body| body.whereabouts != Whereabouts::Removed);
        let bodies = bodies.map(|body| body.module);
        let mut missed: Vec<ModuleId> = self.peers.not_received(liveness, members).collect();
        missed.extend(self.peers.not_received(liveness, voters));
        missed.extend(self.peers.not_received(liveness, bodies));
        missed.sort_unstable();
        missed.dedup();
        missed.retain(|&module| module != self.module());
        missed.truncate(MODULES_MAX);
        if *missed != *self.reception.misses {
            self.reception.misses = missed.into();
        }
        Arc::clone(&self.reception.misses)
    }

    /// Whether the latest heartbeat lists a module as missed.
    pub fn lists_as_missed(&self, module: ModuleId) -> bool {
        self.reception.misses.binary_search(&module).is_ok()
    }

    /// Whether a module is live that the latest heartbeat lists as missed.
    pub fn is_back(&self, module: ModuleId) -> bool {
        self.lists_as_missed(module) && self.peers.is_live(self.liveness(), module)
    }

    /// The voters that live modules receive, and this one does not: those have listened, know who votes, and do not miss them.
    fn received_by_others(&self) -> Vec<ModuleId> {
        let liveness = self.liveness();
        let voters = self.session.voters().named.iter().copied();
        let missed = self.peers.not_received(liveness, voters);
        let missed: Vec<ModuleId> = missed.filter(|&module| module != self.module()).collect();
        let mut missed_by_all = missed.clone();
        let mut last: Option<&[ModuleId]> = None;
        for (_, peer) in self.peers.live(liveness) {
            if missed_by_all.is_empty() {
                break;
            }
            // Most modules miss the same ones.
            if peer.tells_misses(liveness.suspicion) && last != Some(peer.misses()) {
                missed_by_all.retain(|voter| peer.misses().binary_search(voter).is_ok());
                last = Some(peer.misses());
            }
        }
        let is_received = |voter: &ModuleId| missed_by_all.binary_search(voter).is_err();
        missed.into_iter().filter(is_received).collect()
    }

    /// The number of modules that are known to run: this one, the live ones, and voters that live ones receive.
    pub fn running(&self) -> usize {
        self.received_by_others().len() + self.live_modules().len()
    }

    /// The pairs of this module and all live ones of which the first does not receive the second.
    pub fn missed_pairs(&mut self) -> Arc<[(ModuleId, ModuleId)]> {
        Arc::clone(&self.links().missed)
    }

    /// The best clique of this module, all live ones, and voters that live ones receive; in ascending order.
    /// Enforces E4.
    pub fn clique(&mut self) -> Arc<[ModuleId]> {
        let standing = self.standing();
        let Links { missed, clique, .. } = self.links();
        if let Some((known, clique)) = clique
            && *known == standing
        {
            return Arc::clone(clique);
        }
        let missed = missed.to_vec();
        let clique = self.find_clique(missed);
        self.links().clique = Some((standing, Arc::clone(&clique)));
        clique
    }

    fn links(&mut self) -> &mut Links {
        let (now, peers) = (self.now, self.peers.version());
        let links = self.reception.links.take();
        let links = links.filter(|links| links.peers == peers && now < links.until);
        let links = links.unwrap_or_else(|| {
            let liveness = self.liveness();
            Links {
                peers,
                until: self.peers.table_mut().unchanged_until(liveness),
                missed: self.peers.missed_pairs(liveness).into(),
                named: None,
                clique: None,
            }
        });
        self.reception.links.insert(links)
    }

    /// Whether a module's latest heartbeat shows the digest of a plan.
    fn shows_plan(&self, module: ModuleId) -> bool {
        if module == self.module() {
            return self.outbox.heartbeats.show_plan();
        }
        let heartbeat = self.peers.heartbeat(module);
        heartbeat.is_some_and(|heartbeat| heartbeat.digest.is_some())
    }

    fn standing(&self) -> Standing {
        Standing {
            target: self.target.revision(),
            voters: self.session.voters_digest(),
            votes_removed: self.session.votes_removed(),
            votes_due: self.removals.due_votes().collect(),
            knows: self.session.knows(),
            service: self.robot.service,
            is_planned: self.shows_plan(self.module()),
        }
    }

    /// Finds which live modules another one misses; returns whether they changed.
    /// Enforces B3.
    pub fn refresh_missed(&mut self) -> bool {
        let missed = self.missed_pairs();
        if missed.is_empty() && self.reception.missed.is_empty() {
            return false;
        }
        let missed: BTreeSet<ModuleId> = missed.iter().map(|&(_, missed)| missed).collect();
        let changes = self.reception.missed != missed;
        self.reception.missed = missed;
        changes
    }

    /// Whether another module misses a live one.
    pub fn is_missed(&self, module: ModuleId) -> bool {
        self.reception.missed.contains(&module)
    }

    /// Whether a live module holds a plan in a later epoch than this one. Its members judge who is missing, and who is wanted.
    /// Enforces E6.
    pub fn is_led(&self, epoch: Option<Epoch>) -> bool {
        let mut live = self.peers.live(self.liveness());
        live.any(|(_, peer)| {
            // One whose drive failed may never convene (E4).
            let has_failed =
                (peer.state.as_ref()).is_some_and(|state| state.service == Service::MotionFailed);
            let heartbeat = peer.heartbeat.as_ref().filter(|_| !has_failed);
            heartbeat.is_some_and(|heartbeat| {
                heartbeat.digest.is_some()
                    && heartbeat.epoch > epoch
                    && heartbeat.phase != ModulePhase::WaitingForQuorum
            })
        })
    }

    fn find_clique(&mut self, mut missed: Vec<(ModuleId, ModuleId)>) -> Arc<[ModuleId]> {
        let elsewhere = self.received_by_others();
        if missed.is_empty() && elsewhere.is_empty() {
            return self.live_modules().into();
        }
        let own = self.module();
        missed.extend(elsewhere.iter().map(|&module| (own, module)));
        let mut votes = self.live_votes();
        votes.extend(elsewhere.into_iter().map(|module| (module, true)));
        votes.sort_unstable();
        self.clique_of(votes, missed)
    }

    /// The best clique among some modules, each with whether it knows.
    pub fn clique_of(
        &mut self,
        votes: Vec<(ModuleId, bool)>,
        mut missed: Vec<(ModuleId, ModuleId)>,
    ) -> Arc<[ModuleId]> {
        // It is all the same which of the two misses the other.
        let pairs = missed.iter_mut();
        pairs.for_each(|pair| *pair = (pair.0.min(pair.1), pair.0.max(pair.1)));
        missed.sort_unstable();
        missed.dedup();
        let voters = self.session.voters();
        let candidates = votes.iter().map(|&(module, _)| Candidate {
            module,
            votes: voters.named.is_empty() || voters.counts(module),
            is_active: self
                .service_of(module)
                .is_none_or(|service| service == Service::Active),
            is_planned: self.shows_plan(module),
        });
        let sight = Sight {
            candidates: candidates.collect(),
            missed,
            votes,
            standing: self.standing(),
        };
        let mut found = self.reception.found.iter();
        if let Some((_, clique)) = found.find(|(known, _)| *known == sight) {
            return Arc::clone(clique);
        }
        let has_quorum = |members: &[ModuleId]| {
            let votes = sight.votes.iter().copied();
            let votes: Vec<_> = votes
                .filter(|(module, _)| members.binary_search(module).is_ok())
                .collect();
            self.shortfall_of(&votes).is_none()
        };
        let clique: Arc<[ModuleId]> =
            cliques::best(&sight.candidates, &sight.missed, has_quorum).into();
        let found = &mut self.reception.found;
        found.push_front((sight, Arc::clone(&clique)));
        found.truncate(FOUND_MAX);
        clique
    }

    /// Whether a clique that leaves out members of the roster in force has been the best for long enough.
    /// Enforces E7.
    pub fn may_replace(&mut self, clique: Arc<[ModuleId]>) -> bool {
        let replacing = self.reception.replacing.take();
        let replacing = replacing.filter(|(known, _)| *known == clique);
        let (clique, since) = replacing.unwrap_or((clique, self.now));
        self.reception.replacing = Some((clique, since));
        let due = since + self.parameters.stuck;
        self.wake_at(due);
        self.now >= due
    }

    /// Leaves out members without progress for a while. Where they are needed for a quorum, the next epoch calls them again.
    /// Enforces M6.
    pub fn leave_out(&mut self, stuck: &[ModuleId]) {
        if !self.has_quorum_without(stuck) {
            return;
        }
        let (now, least) = (self.now, self.parameters.stuck * 2);
        for &module in stuck {
            (self.peers.table_mut()).fail_channel(module, now, least);
        }
    }

    /// No clique leaves out members any more.
    pub fn forget_replacing(&mut self) {
        self.reception.replacing = None;
    }

    /// When a clique that leaves out members will have been the best for long enough, if one is.
    pub fn replaces_at(&self) -> Option<Duration> {
        let (_, since) = self.reception.replacing.as_ref()?;
        Some(*since + self.parameters.stuck)
    }

    /// Whether the modules of a clique could fill more spots than the members of a roster, now that they can move. Of these newcomers
    /// there are more than members that it leaves out.
    pub fn could_fill_more(
        &mut self,
        roster: &Roster,
        clique: &[ModuleId],
        newcomers: &[ModuleId],
    ) -> bool {
        if newcomers.is_empty() {
            return false;
        }
        let filling = Filling {
            epoch: roster.epoch,
            bodies: self.bodies.version(),
            clique: clique.to_vec(),
            newcomers: newcomers.to_vec(),
        };
        if let Some((known, fills_more)) = &self.reception.filling
            && *known == filling
        {
            return *fills_more;
        }
        let fills_more = self.fills_more(roster, clique, newcomers);
        self.reception.filling = Some((filling, fills_more));
        fills_more
    }

    fn fills_more(&self, roster: &Roster, clique: &[ModuleId], newcomers: &[ModuleId]) -> bool {
        let Some(target) = &roster.target.target else {
            return false;
        };
        let filled = roster
            .open_part_by(&roster.bodies)
            .map_or(0, |part| part.room);
        if filled >= target.spots().len() {
            return false;
        }
        let stays = |member: &&RosterMember| clique.binary_search(&member.module.id).is_ok();
        let staying: Vec<RosterMember> = roster.members.iter().filter(stays).cloned().collect();
        let left_out = roster.members.len() - staying.len();
        let mut known = self.bodies.outside(&staying);
        known.retain(|body| !newcomers.contains(&body.module) && !self.removals.is_due(body.run()));
        let with_them = roster.open_part_by(&known).map_or(0, |part| {
            let room = (part.room + newcomers.len()).saturating_sub(left_out);
            room.min(part.target.spots().len())
        });
        with_them > filled
    }
}
