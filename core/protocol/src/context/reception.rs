//! Whom this module does not receive, and who receives whom among all that it receives.

use std::collections::BTreeSet;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Epoch, ModuleId, ModulePhase, Roster, Service, Whereabouts};

use crate::cliques::{self, Candidate};
use crate::context::Context;

/// What was last found of who receives whom.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reception {
    /// The modules that were last listed as not received.
    misses: Arc<[ModuleId]>,
    /// The live modules that another one misses, as the last frozen state listed their bodies, and the changes to peers until then.
    missed: (u64, BTreeSet<ModuleId>),
    /// The clique that was last found while there were missed pairs, and in what.
    found: Option<(Sight, Vec<ModuleId>)>,
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
    votes_removed: (usize, usize),
    votes_due: usize,
}

impl Context {
    /// The modules that this one knows of and does not receive: voters, members, those whose bodies are known, and those that fell
    /// silent. It tells that once it has listened for `suspicion`.
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
        let peers = self.peers.ids();
        let mut missed: Vec<ModuleId> = self.peers.not_received(liveness, members).collect();
        missed.extend(self.peers.not_received(liveness, voters));
        missed.extend(self.peers.not_received(liveness, bodies));
        missed.extend(self.peers.not_received(liveness, peers));
        missed.sort_unstable();
        missed.dedup();
        missed.retain(|&module| module != self.module());
        if *missed != *self.reception.misses {
            self.reception.misses = missed.into();
        }
        Arc::clone(&self.reception.misses)
    }

    /// The number of modules that are known to run: this one, the live ones, and voters that live ones receive.
    pub fn running(&self) -> usize {
        let liveness = self.liveness();
        let voters = self.session.voters().named.iter().copied();
        let missed = self.peers.not_received(liveness, voters);
        let is_received = |module: &ModuleId| {
            let mut live = self.peers.live(liveness);
            live.any(|(_, peer)| peer.receives_voter(*module, liveness.suspicion))
        };
        let own = self.module();
        let elsewhere = missed.filter(|module| *module != own && is_received(module));
        elsewhere.count() + self.live_modules().len()
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
            let heartbeat = peer.heartbeat.as_ref();
            heartbeat.is_some_and(|heartbeat| {
                heartbeat.digest.is_some()
                    && heartbeat.epoch > epoch
                    && heartbeat.phase != ModulePhase::WaitingForQuorum
            })
        })
    }

    /// The best clique that this module sees; in ascending order.
    /// Enforces E4.
    pub fn clique(&mut self) -> Vec<ModuleId> {
        let missed = self.missed_pairs();
        if missed.is_empty() {
            return self.live_modules();
        }
        let votes = self.live_votes();
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
            votes_removed: self.session.votes_removed(),
            votes_due: self.removals.due_votes().count(),
            votes,
        };
        if let Some((known, clique)) = &self.reception.found
            && *known == sight
        {
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
        self.reception.found = Some((sight, clique.clone()));
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

    /// Whether these modules, which no roster lists, could fill more spots than its own members, now that they can move, if some of
    /// those are left out.
    pub fn could_fill_more(
        &self,
        roster: &Roster,
        newcomers: &[ModuleId],
        left_out: usize,
    ) -> bool {
        let Some(target) = &roster.target.target else {
            return false;
        };
        if newcomers.is_empty() {
            return false;
        }
        let filled = roster
            .open_part_by(&roster.bodies)
            .map_or(0, |part| part.room);
        if filled >= target.spots().len() {
            return false;
        }
        let mut known = self.bodies.outside(&roster.members);
        known.retain(|body| !newcomers.contains(&body.module) && !self.removals.is_due(body.run()));
        let with_them = roster.open_part_by(&known).map_or(0, |part| {
            (part.room + newcomers.len() - left_out).min(part.target.spots().len())
        });
        with_them > filled
    }
}
