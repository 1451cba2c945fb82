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

/// So many cliques are kept: that of all live modules, and that of those that have frozen.
const FOUND_MAX: usize = 2;

/// What was last found of who receives whom.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reception {
    /// The modules that were last listed as not received.
    misses: Arc<[ModuleId]>,
    /// The live modules that another one misses, and the changes to peers until that was found.
    missed: (u64, BTreeSet<ModuleId>),
    /// The cliques that were last found while there were missed pairs, each with what it was found in.
    found: VecDeque<(Sight, Vec<ModuleId>)>,
    /// A clique that leaves out members of the roster in force, and since when it has been the best.
    replacing: Option<(Vec<ModuleId>, Duration)>,
}

impl Hash for Reception {
    /// What was found follows from the rest of the context.
    fn hash<H: Hasher>(&self, state: &mut H) {
        (&self.missed.1, &self.replacing).hash(state);
    }
}

/// What a clique depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Sight {
    candidates: Vec<Candidate>,
    missed: Vec<(ModuleId, ModuleId)>,
    votes: Vec<(ModuleId, bool)>,
    voters: u64,
    votes_removed: (usize, usize),
    votes_due: Vec<ModuleId>,
}

impl Context {
    /// The modules that this one knows of and does not receive: voters, members, and those whose bodies are known. It tells that once it
    /// has listened for `suspicion`.
    /// Enforces M6.
    pub fn misses(&mut self, roster: Option<&Roster>) -> Arc<[ModuleId]> {
        if !self.has_listened() {
            return Arc::default();
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
            let uptime = peer.heartbeat.as_ref().map(|heartbeat| heartbeat.uptime);
            let tells = uptime > Some(liveness.suspicion) && peer.knows_voters();
            // Most modules miss the same ones.
            if tells && last != Some(peer.misses()) {
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
    pub fn missed_pairs(&self) -> Vec<(ModuleId, ModuleId)> {
        self.peers.missed_pairs(self.liveness(), self.module())
    }

    /// Finds which live modules another one misses; returns whether they changed.
    /// Enforces B3.
    pub fn refresh_missed(&mut self) -> bool {
        let (version, _) = self.peers.version();
        if self.reception.missed.0 == version {
            return false;
        }
        let missed = self.missed_pairs().into_iter().map(|(_, missed)| missed);
        let missed: BTreeSet<ModuleId> = missed.collect();
        let changes = self.reception.missed.1 != missed;
        self.reception.missed = (version, missed);
        changes
    }

    /// Whether another module misses a live one.
    pub fn is_missed(&self, module: ModuleId) -> bool {
        self.reception.missed.1.contains(&module)
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

    /// The best clique of this module, all live ones, and voters that live ones receive; in ascending order.
    /// Enforces E4.
    pub fn clique(&mut self) -> Vec<ModuleId> {
        let mut missed = self.missed_pairs();
        let elsewhere = self.received_by_others();
        if missed.is_empty() && elsewhere.is_empty() {
            return self.live_modules();
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
        missed: Vec<(ModuleId, ModuleId)>,
    ) -> Vec<ModuleId> {
        let voters = self.session.voters();
        let candidates = votes.iter().map(|&(module, _)| Candidate {
            module,
            votes: voters.named.is_empty() || voters.counts(module),
            is_active: self
                .service_of(module)
                .is_none_or(|service| service == Service::Active),
        });
        let sight = Sight {
            candidates: candidates.collect(),
            missed,
            voters: self.session.voters_digest(),
            votes_removed: self.session.votes_removed(),
            votes_due: self.removals.due_votes().collect(),
            votes,
        };
        let mut found = self.reception.found.iter();
        if let Some((_, clique)) = found.find(|(known, _)| *known == sight) {
            return clique.clone();
        }
        let has_quorum = |members: &[ModuleId]| {
            let votes = sight.votes.iter().copied();
            let votes: Vec<_> = votes
                .filter(|(module, _)| members.binary_search(module).is_ok())
                .collect();
            self.shortfall_of(&votes).is_none()
        };
        let clique = cliques::best(&sight.candidates, &sight.missed, has_quorum);
        self.reception.found.push_front((sight, clique.clone()));
        self.reception.found.truncate(FOUND_MAX);
        clique
    }

    /// Whether a clique that leaves out members of the roster in force has been the best for long enough.
    /// Enforces E7.
    pub fn may_replace(&mut self, clique: Vec<ModuleId>) -> bool {
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
            self.peers.fail_channel(module, now, least);
        }
    }

    /// No clique leaves out members any more.
    pub fn forget_replacing(&mut self) {
        self.reception.replacing = None;
    }

    /// Whether a clique that leaves out members is yet to have been the best for long enough.
    pub fn may_replace_later(&self) -> bool {
        self.reception.replacing.is_some()
    }

    /// Whether the modules of a clique could fill more spots than the members of a roster, now that they can move. Of these newcomers
    /// there are more than members that it leaves out.
    pub fn could_fill_more(
        &self,
        roster: &Roster,
        clique: &[ModuleId],
        newcomers: &[ModuleId],
    ) -> bool {
        let Some(target) = &roster.target.target else {
            return false;
        };
        let filled = roster
            .open_part_by(&roster.bodies)
            .map_or(0, |part| part.room);
        if newcomers.is_empty() || filled >= target.spots().len() {
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
