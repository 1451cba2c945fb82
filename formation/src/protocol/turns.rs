//! Taking turns: each unit claims once, and every agent applies a claim only if it equals its own recomputation.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    Decision, Digest, Epoch, EvictionNotice, Message, ModuleId, Plan, PlanningProblem, Roster,
    SpotClaim, digest,
};
use crate::planner::{ClaimRefused, Planning};

use super::acting::Acting;
use super::io::{Event, Output, SourceId};
use super::mutation::{Mutation, Switch};
use super::refusal::Refusal;
use super::{Agent, Stage};

/// At most this many claims are kept that came before their turn.
const EARLY_CLAIMS_MAX: usize = 16_384;
/// At most this many spots, evictions and modules are named in all claims that are kept.
const EARLY_ENTRIES_MAX: usize = 1 << 17;
/// At most this many claims are kept for one turn; only one of them can be right.
const CLAIMS_PER_TURN_MAX: usize = 8;

/// Claims whose turn has not come.
#[derive(Clone, Debug, Default)]
pub(super) struct EarlyClaims {
    claims: BTreeMap<(Epoch, u32), Vec<Arc<SpotClaim>>>,
    count: usize,
    entries: usize,
}

fn entries_of(claim: &SpotClaim) -> usize {
    let decision = &claim.decision;
    decision.selections.len() + decision.evictions.len() + decision.detached.len()
}

impl EarlyClaims {
    fn keep(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        let entries = entries_of(&claim);
        if self.count >= EARLY_CLAIMS_MAX || self.entries + entries > EARLY_ENTRIES_MAX {
            return Err(Refusal::BufferFull);
        }
        let same_turn = self.claims.entry((claim.epoch, claim.turn)).or_default();
        if same_turn.contains(&claim) {
            return Ok(());
        }
        if same_turn.len() >= CLAIMS_PER_TURN_MAX {
            return Err(Refusal::BufferFull);
        }
        same_turn.push(claim);
        self.count += 1;
        self.entries += entries;
        Ok(())
    }

    fn take(&mut self, epoch: Epoch, turn: u32) -> Vec<Arc<SpotClaim>> {
        let claims = self.claims.remove(&(epoch, turn)).unwrap_or_default();
        self.count -= claims.len();
        self.entries -= claims.iter().map(|claim| entries_of(claim)).sum::<usize>();
        claims
    }

    pub fn forget_before(&mut self, epoch: Epoch) {
        self.claims = self.claims.split_off(&(epoch, 0));
        let kept = self.claims.values().flatten();
        self.count = kept.clone().count();
        self.entries = kept.map(|claim| entries_of(claim)).sum();
    }
}

/// The planning of one epoch, as far as it has come.
#[derive(Clone)]
pub(super) struct Turns {
    roster: Arc<Roster>,
    planning: Planning,
    decisions: Vec<(ModuleId, Decision)>,
    began: Duration,
    progress_at: Duration,
    switch: Switch,
}

impl Turns {
    /// `None` when the roster cannot be planned for.
    pub fn new(roster: Arc<Roster>, now: Duration, switch: Switch) -> Option<Self> {
        let mut problem = roster.problem().ok().flatten()?;
        if switch.is(Mutation::EvictConfigurationMember) {
            problem = without_links(&problem)?;
        }
        Some(Self {
            planning: Planning::new(Arc::new(problem)),
            roster,
            decisions: Vec::new(),
            began: now,
            progress_at: now,
            switch,
        })
    }

    pub fn roster(&self) -> &Arc<Roster> {
        &self.roster
    }

    /// When the last turn was applied, or the planning began.
    #[cfg(feature = "mutations")]
    pub fn progress_at(&self) -> Duration {
        self.progress_at
    }

    pub fn applied(&self) -> u32 {
        self.planning.applied_turns()
    }

    /// The module whose claim is overdue since more than `stuck`.
    pub fn stuck_claimant(&self, now: Duration, stuck: Duration) -> Option<ModuleId> {
        (now.saturating_sub(self.progress_at) > stuck)
            .then(|| self.planning.turn().map(|turn| turn.claimant))
            .flatten()
    }

    fn apply(
        &mut self,
        now: Duration,
        claimant: ModuleId,
        decision: &Decision,
    ) -> Result<(), Refusal> {
        match self.planning.apply(claimant, decision) {
            Ok(()) => {}
            Err(ClaimRefused::DifferentDecision { expected, .. })
                if self.switch.is(Mutation::AcceptWithoutRecomputation) =>
            {
                let _ = self.planning.apply(claimant, &expected);
            }
            Err(ClaimRefused::DifferentDecision { .. }) => return Err(Refusal::DifferentDecision),
            Err(_) => return Err(Refusal::WrongClaimant),
        }
        if !self.switch.is(Mutation::ApplyOutOfTurn) {
            self.decisions.push((claimant, decision.clone()));
        }
        self.progress_at = now;
        Ok(())
    }

    fn finished(&self) -> Option<(Plan, Digest)> {
        let plan = self.planning.finish()?;
        let mut digest = digest::of_plan(&self.roster, &self.decisions);
        if self.switch.is(Mutation::DifferentPlan) {
            digest.0 ^= 1;
        }
        Some((plan, digest))
    }
}

impl Agent {
    pub(super) fn hear_claim(&mut self, source: Option<SourceId>, claim: Arc<SpotClaim>) {
        let claimant = claim.claimant;
        if let Err(refusal) = self.peers.check_source(claimant, claim.incarnation, source) {
            return self.refuse(Some(claimant), refusal);
        }
        if claimant == self.module {
            return self.refuse(Some(claimant), Refusal::WrongSource);
        }
        if self.epoch.is_some_and(|current| claim.epoch < current) {
            return self.refuse(Some(claimant), Refusal::StaleEpoch);
        }
        if self.epoch != Some(claim.epoch) {
            // Nobody can claim before the roster, and the roster lists only who has halted for its epoch: in this one
            // this module has no part.
            if !self.convening.is_plausible(claim.epoch) {
                self.refuse(Some(claimant), Refusal::ImplausibleEpoch);
            }
            return;
        }
        match &self.stage {
            Stage::Planning(turns) => {
                let member = turns
                    .roster
                    .members
                    .iter()
                    .find(|member| member.module.id == claimant);
                if member.is_none_or(|member| member.incarnation != claim.incarnation) {
                    return self.refuse(Some(claimant), Refusal::UnknownModule);
                }
                if claim.turn < turns.applied() {
                    return self.refuse(Some(claimant), Refusal::StaleEpoch);
                }
            }
            Stage::Gathering(_) => {}
            Stage::Acting(_) | Stage::Outsider(_) | Stage::Idle => {
                return self.refuse(Some(claimant), Refusal::StaleEpoch);
            }
        }
        if self.switch.is(Mutation::ApplyOutOfTurn)
            && let Stage::Planning(turns) = &mut self.stage
        {
            turns.decisions.push((claimant, claim.decision.clone()));
        }
        if let Err(refusal) = self.early_claims.keep(claim) {
            self.refuse(Some(claimant), refusal);
        }
    }

    /// Takes this module's turns and applies the others' claims, as far as they are there.
    pub(super) fn advance_turns(&mut self) {
        while let (Some(epoch), Stage::Planning(turns)) = (self.epoch, &mut self.stage) {
            let Some(turn) = turns.planning.turn() else {
                self.finish_turns(epoch);
                return;
            };
            let number = turns.applied();
            if turn.claimant == self.module {
                let Some(decision) = turns.planning.decide() else {
                    return;
                };
                if let Err(refusal) = turns.apply(self.now, self.module, &decision) {
                    return self.refuse(Some(self.module), refusal);
                }
                self.publish_claim(epoch, number, decision);
                continue;
            }
            let mut refusals = Vec::new();
            let mut applied = None;
            for claim in self.early_claims.take(epoch, number) {
                if applied.is_some() {
                    break;
                }
                match turns.apply(self.now, claim.claimant, &claim.decision) {
                    Ok(()) => applied = Some(claim),
                    Err(refusal) => refusals.push((claim.claimant, refusal)),
                }
            }
            for (claimant, refusal) in refusals {
                self.refuse(Some(claimant), refusal);
            }
            let Some(claim) = applied else {
                return;
            };
            self.note_own_evictions(&claim.decision);
        }
    }

    fn publish_claim(&mut self, epoch: Epoch, turn: u32, decision: Decision) {
        for &eviction in &decision.evictions {
            self.outputs
                .push_back(Output::Publish(Message::Eviction(EvictionNotice {
                    epoch,
                    turn,
                    eviction,
                })));
        }
        let claim = SpotClaim {
            epoch,
            turn,
            claimant: self.module,
            incarnation: self.incarnation,
            decision,
        };
        self.outputs
            .push_back(Output::Publish(Message::Claim(Arc::new(claim))));
    }

    fn note_own_evictions(&mut self, decision: &Decision) {
        let own = decision
            .evictions
            .iter()
            .find(|eviction| eviction.evicted == self.module);
        if let Some(eviction) = own {
            self.emit(Event::Evicted {
                by: eviction.by,
                from: eviction.from,
            });
        }
    }

    fn finish_turns(&mut self, epoch: Epoch) {
        let Stage::Planning(turns) = std::mem::replace(&mut self.stage, Stage::Idle) else {
            return;
        };
        let Some((plan, digest)) = turns.finished() else {
            self.stage = Stage::Planning(turns);
            return;
        };
        self.emit(Event::Planned {
            epoch,
            digest,
            turns: turns.applied(),
            elapsed: self.now.saturating_sub(turns.began),
        });
        for warning in plan.assembly.warnings.iter().copied() {
            self.emit(Event::AssemblyWarning(warning));
        }
        let applied = turns.applied();
        self.stage = Stage::Acting(Box::new(Acting::new(
            self.module,
            turns.roster,
            plan,
            digest,
            applied,
            self.now,
        )));
        self.note_shown();
        self.voice.state_changed = true;
    }
}

/// The same modules, docked to nobody, as only a mutation has them.
fn without_links(problem: &PlanningProblem) -> Option<PlanningProblem> {
    let mut modules = problem.modules().to_vec();
    for module in &mut modules {
        module.links.clear();
    }
    PlanningProblem::new(Arc::clone(problem.target()), *problem.parameters(), modules).ok()
}
