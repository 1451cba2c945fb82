//! Planning: each unit claims once, and every agent applies the claims in turn, each only if it equals its own recomputation.
//!
//! A claim shows what its claimant decides after the turns before it, which it has computed itself. So it does not wait for
//! the claims of those turns, and the messages of all turns travel at the same time.

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    ClosedRoster, Decision, Epoch, EvictionNotice, Message, ModuleId, ModulePhase, SpotClaim,
};
use crate::motion::PlannedMotion;
use crate::planner::{ClaimRefused, PlannedTurns};

use super::super::context::Context;
use super::super::event::Event;
use super::super::mutation::Bugs;
use super::super::plans::{ComputedPlan, PlanJob, obstacles};
use super::super::refusal::Refusal;
use super::claims::EarlyClaims;
use super::{Agreeing, HeldPlan, Stage, Step, hash_roster};

/// The turns of one epoch.
#[derive(Clone)]
pub(in crate::protocol) struct Planning {
    pub roster: Arc<ClosedRoster>,
    job: PlanJob,
    /// Every turn as this replica decides it; `None` until the plan is computed.
    planned: Option<Arc<ComputedPlan>>,
    /// The number of turns that have been applied.
    applied: u32,
    /// The decisions that were applied, where a bug lets them differ from the plan.
    deviating: Vec<(ModuleId, Decision)>,
    claims: EarlyClaims,
    began: Duration,
    /// When the last turn was applied, the plan was computed, or the claimant was last seen to compute its own.
    progress_at: Duration,
    reported_overdue: bool,
}

impl Hash for Planning {
    /// The decisions follow from the roster and the number of turns.
    fn hash<H: Hasher>(&self, state: &mut H) {
        hash_roster(&self.roster, state);
        let progress = (self.planned.is_some(), self.applied, self.progress_at);
        (progress, &self.claims).hash(state);
    }
}

impl Planning {
    /// Begins with the turns of a roster; refuses a roster that contradicts itself.
    pub fn begin(roster: Arc<ClosedRoster>, context: &mut Context) -> Option<Self> {
        let members = roster.members.len();
        let epoch = roster.epoch;
        let listed = roster.members.iter().map(|member| member.module.id);
        context.peers.note_listed(listed);
        let expected = roster.target.expected_modules;
        context.memory.number_was_met |=
            expected.is_some_and(|expected| members >= expected as usize);
        let problem = roster.problem().ok().flatten();
        let Some(problem) = problem.and_then(|problem| context.bugs.planned(problem)) else {
            context.refuse(Some(epoch.convener), Refusal::BadRoster);
            return None;
        };
        context.emit(Event::PlanningBegun { epoch, members });
        Some(Self {
            job: PlanJob::plan(problem, obstacles(&roster)),
            planned: None,
            applied: 0,
            roster,
            deviating: Vec::new(),
            claims: EarlyClaims::default(),
            began: context.now,
            progress_at: context.now,
            reported_overdue: false,
        })
    }

    /// The same turns, with claims that came before the roster.
    pub fn with_claims(mut self, claims: EarlyClaims) -> Self {
        self.claims = claims;
        self
    }

    pub fn applied(&self) -> u32 {
        self.applied
    }

    pub fn phase(&self) -> ModulePhase {
        if self.planned.is_some() {
            ModulePhase::Planning
        } else {
            ModulePhase::Computing
        }
    }

    /// The module whose claim has been due for longer than `stuck`.
    pub fn stuck_claimant(&self, context: &Context) -> Option<ModuleId> {
        let (claimant, _) = self.planned.as_ref()?.turns().turn(self.applied)?;
        let waited = context.now.saturating_sub(self.progress_at);
        (waited > context.parameters.stuck).then_some(claimant)
    }

    /// Keeps a claim of a member for its turn.
    pub fn keep_claim(&mut self, claim: Arc<SpotClaim>, context: &Context) -> Result<(), Refusal> {
        let member = self.roster.member(claim.claimant);
        if member.is_none_or(|member| member.incarnation != claim.incarnation) {
            return Err(Refusal::UnknownModule);
        }
        if claim.turn < self.applied {
            return Err(Refusal::StaleEpoch);
        }
        if context.bugs.record_claims_out_of_turn() {
            let decision = claim.decision.clone();
            self.deviating.push((claim.claimant, decision));
        }
        self.claims.keep(claim)
    }

    /// Publishes this module's claims once the plan is computed, and applies all claims in turn, as far as they are known.
    pub fn step(mut self: Box<Self>, context: &mut Context) -> Step {
        let Some(planned) = self.planned(context) else {
            return Step::Stay(Stage::Planning(self));
        };
        while let Some((claimant, decision)) = planned.turns().turn(self.applied) {
            if claimant == context.module() {
                self.apply(claimant, decision, context);
            } else if !self.apply_claims(planned.turns(), context) {
                let waited = context.now.saturating_sub(self.began);
                let computes = context.peers.computes(claimant, self.roster.epoch);
                if computes && waited <= context.parameters.plan_limit {
                    self.progress_at = context.now;
                }
                return Step::Stay(Stage::Planning(self));
            }
        }
        Step::Enter(self.finish(&planned, context))
    }

    /// Every turn as this replica decides it; `None` until the plan is computed.
    fn planned(&mut self, context: &mut Context) -> Option<Arc<ComputedPlan>> {
        if self.planned.is_none() {
            self.planned = context.plan(self.job.clone());
            if let Some(planned) = &self.planned {
                self.publish_claims(planned.turns(), context);
                self.progress_at = context.now;
            } else {
                self.report_overdue(context);
            }
        }
        self.planned.clone()
    }

    /// Reports once that the plan takes longer than the other members wait for it.
    fn report_overdue(&mut self, context: &mut Context) {
        let limit = context.parameters.plan_limit;
        let is_overdue = context.now.saturating_sub(self.began) > limit;
        if is_overdue && !std::mem::replace(&mut self.reported_overdue, true) {
            context.emit(Event::PlanOverdue(self.roster.epoch));
        }
    }

    /// Publishes the decisions of the units that this module leads.
    fn publish_claims(&self, planned: &PlannedTurns, context: &mut Context) {
        let epoch = self.roster.epoch;
        let claimant = context.module();
        let own = planned.turns().filter(|&(_, leader, _)| leader == claimant);
        for (turn, _, decision) in own {
            context.publish(Message::Claim(Arc::new(SpotClaim {
                epoch,
                turn,
                claimant,
                incarnation: context.own.run.incarnation,
                decision: decision.clone(),
            })));
            for &eviction in &decision.evictions {
                context.publish(Message::Eviction(EvictionNotice {
                    epoch,
                    turn,
                    eviction,
                }));
            }
        }
    }

    /// Applies the first right claim for the present turn, and refuses the wrong ones before it. Those after it are left for the
    /// next turn, which passes over them.
    fn apply_claims(&mut self, planned: &PlannedTurns, context: &mut Context) -> bool {
        while let Some(claim) = self.claims.take(self.applied) {
            if claim.turn < self.applied {
                continue;
            }
            match self.check(planned, &claim, context.bugs) {
                Ok(()) => {
                    self.apply(claim.claimant, &claim.decision, context);
                    report_own_eviction(&claim.decision, context);
                    return true;
                }
                Err(refusal) => context.refuse(Some(claim.claimant), refusal),
            }
        }
        false
    }

    fn check(&self, planned: &PlannedTurns, claim: &SpotClaim, bugs: Bugs) -> Result<(), Refusal> {
        match planned.check(self.applied, claim.claimant, &claim.decision) {
            Ok(()) => Ok(()),
            Err(ClaimRefused::DifferentDecision { .. }) if bugs.accept_any_decision() => Ok(()),
            Err(ClaimRefused::DifferentDecision { .. }) => Err(Refusal::DifferentDecision),
            Err(_) => Err(Refusal::WrongClaimant),
        }
    }

    /// Applies the decision of the present turn.
    fn apply(&mut self, claimant: ModuleId, decision: &Decision, context: &Context) {
        self.applied += 1;
        if context.bugs.accept_any_decision() {
            self.deviating.push((claimant, decision.clone()));
        }
        self.progress_at = context.now;
    }

    fn finish(self, planned: &ComputedPlan, context: &mut Context) -> Stage {
        let epoch = self.roster.epoch;
        let roster_plan = planned.for_roster(&self.roster);
        let bugs = context.bugs;
        let may_deviate = bugs.accept_any_decision() || bugs.record_claims_out_of_turn();
        let digest = bugs.shown(if may_deviate {
            planned.digest_of(&self.roster, &self.deviating)
        } else {
            roster_plan.digest
        });
        let turns = self.applied;
        context.emit(Event::Planned {
            epoch,
            digest,
            turns,
            elapsed: context.now.saturating_sub(self.began),
        });
        for &warning in &planned.plan().assembly.warnings {
            context.emit(Event::AssemblyWarning(warning));
        }
        report_motion(planned.motion(), epoch, context);
        let basis = self.roster.quorum_basis();
        context.memory.quorum.note_shown(epoch, &basis);
        context.mark_state_changed();
        let own = context.module();
        let held = HeldPlan::new(own, self.roster, planned, roster_plan, digest, turns);
        Stage::Agreeing(Box::new(Agreeing::new(held, context.now)))
    }
}

/// Reports, as the convener, why modules do not move along paths.
fn report_motion(motion: &PlannedMotion, epoch: Epoch, context: &mut Context) {
    if epoch.convener != context.module() {
        return;
    }
    match motion {
        PlannedMotion::Paths(_) | PlannedMotion::Straight(None) => {}
        PlannedMotion::Straight(Some(error)) => context.emit(Event::NoPaths(error.clone())),
        PlannedMotion::Refused(error) => context.emit(Event::NotMoving(error.clone())),
    }
}

fn report_own_eviction(decision: &Decision, context: &mut Context) {
    let mut evictions = decision.evictions.iter();
    if let Some(eviction) = evictions.find(|eviction| eviction.evicted == context.module()) {
        context.emit(Event::Evicted {
            by: eviction.by,
            from: eviction.from,
        });
    }
}
