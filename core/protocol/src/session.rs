//! What outlives every stage: who votes, what this module knows of the session, and the epochs that were seen.

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    Epoch, ModuleId, ModuleState, Roster, RosterMember, TargetAnnouncement, Voters, digest,
};

use super::quorum::{self, Shortfall};
use super::shown_plans::ShownPlans;

/// What a module knows of the session.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Session {
    voters: Voters,
    /// Identifies the named voters in heartbeats.
    voters_digest: u64,
    /// Whether no run of this module took part before this one.
    pub is_first_run: bool,
    /// Whether a run whose memory this one has forgot nothing, or this one was in a roster that was in force.
    pub was_in_force: bool,
    /// Which plans runs of this module showed.
    pub shown: ShownPlans,
    /// Whether a module was seen to show the digest of a plan: expected modules that are absent later may be gone for good.
    pub has_seen_plan: bool,
    highest_epoch: Option<Epoch>,
    /// Whether a roster ever listed all expected modules.
    pub number_was_met: bool,
    /// In how many epochs since the last agreement members were seen to hold different plans.
    pub mismatches: u32,
}

impl Session {
    /// Nothing is known yet, of a module for which this is the first run in the session or may not be.
    pub fn new(is_first_run: bool, shown: ShownPlans) -> Self {
        Self {
            is_first_run,
            shown,
            ..Self::default()
        }
    }

    pub fn voters(&self) -> &Voters {
        &self.voters
    }

    /// Identifies the named voters; 0 while none are.
    pub fn voters_digest(&self) -> u64 {
        self.voters_digest
    }

    /// Whether this run has forgotten nothing that its module agreed on.
    /// Enforces Q2.
    pub fn knows(&self) -> bool {
        self.is_first_run || self.was_in_force
    }

    /// Whether somebody names other voters than are known.
    pub fn contradicts(&self, named: &[ModuleId]) -> bool {
        !named.is_empty() && !self.voters.named.is_empty() && *named != self.voters.named
    }

    /// Whether the voters that this digest identifies are others than are known.
    pub fn has_others(&self, digest: u64) -> bool {
        digest != 0 && self.voters_digest != 0 && digest != self.voters_digest
    }

    /// Takes over the voters that somebody names, unless they are known.
    /// Enforces Q4.
    pub fn note_voters(&mut self, named: &[ModuleId]) {
        if self.voters.named.is_empty() && !named.is_empty() {
            self.voters.named = named.to_vec();
            self.voters_digest = digest::of_voters(named);
        }
    }

    /// Takes over what a store has of removed votes.
    pub fn restore_voters(&mut self, stored: &Voters) {
        self.note_voters(&stored.named);
        self.voters.learn(&stored.removed, &stored.listed);
    }

    /// Whether a module has no vote, or a roster that may be in force took it.
    pub fn lacks_vote(&self, module: ModuleId) -> bool {
        let Voters {
            removed, listed, ..
        } = &self.voters;
        removed.contains(&module) || listed.contains(&module)
    }

    /// How many votes were removed, and how many rosters list as removed.
    pub fn votes_removed(&self) -> (usize, usize) {
        (self.voters.removed.len(), self.voters.listed.len())
    }

    /// The voters for a roster of these frozen modules, whose convener this is, and which takes these votes as well.
    pub fn voters_for(
        &self,
        frozen: &[Arc<ModuleState>],
        taken: impl Iterator<Item = ModuleId>,
    ) -> Voters {
        let mut voters = self.voters.clone();
        for state in frozen {
            voters.learn(&state.removed_voters, &state.listed_voters);
        }
        let taken = taken.filter(|module| !voters.removed.contains(module));
        let taken: BTreeSet<ModuleId> = taken.collect();
        voters.listed.extend(taken);
        voters
    }

    /// Whether the voters of a roster are those of the session, with all removals that this module knows.
    pub fn covers(&self, voters: &Voters) -> bool {
        let Voters {
            removed, listed, ..
        } = &self.voters;
        let is_known =
            |module: &ModuleId| voters.removed.contains(module) || voters.listed.contains(module);
        !self.contradicts(&voters.named)
            && (self.voters.named.is_empty() || !voters.named.is_empty())
            && removed.is_subset(&voters.removed)
            && listed.iter().all(is_known)
    }

    /// This module shows the digest of a plan for a roster, which may be in force from then on.
    pub fn note_shown(&mut self, roster: &Roster) {
        self.note_voters(&roster.voters.named);
        self.voters
            .learn(&roster.voters.removed, &roster.voters.listed);
        self.has_seen_plan = true;
    }

    /// All members of a roster show the digest of one plan.
    pub fn note_in_force(&mut self, roster: &Roster) {
        self.note_shown(roster);
        self.voters.settle();
        self.was_in_force = true;
        self.mismatches = 0;
    }

    fn highest_number(&self) -> u64 {
        self.highest_epoch.map_or(0, |highest| highest.number)
    }

    pub fn highest_epoch(&self) -> Option<Epoch> {
        self.highest_epoch
    }

    /// Records an epoch that exists.
    pub fn note_epoch(&mut self, epoch: Epoch) {
        self.highest_epoch = self.highest_epoch.max(Some(epoch));
    }

    /// An epoch that is higher than every known one.
    pub fn next_epoch(&self, convener: ModuleId) -> Epoch {
        Epoch {
            number: self.highest_number() + 1,
            convener,
        }
    }
}

/// The majority that a roster for these members would lack.
pub(super) fn shortfall_of(
    voters: &Voters,
    present: impl Iterator<Item = (ModuleId, bool)>,
    target: Option<&TargetAnnouncement>,
) -> Option<Shortfall> {
    let expected = target.and_then(|target| target.expected_modules);
    quorum::shortfall(voters, expected, present)
}

/// The members of a roster as they count.
pub(super) fn votes_of(members: &[RosterMember]) -> impl Iterator<Item = (ModuleId, bool)> {
    members
        .iter()
        .map(|member| (member.module.id, member.knows))
}
