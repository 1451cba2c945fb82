//! Planning: each unit claims once, and every agent applies the turns in order, each only once it has been claimed by its unit
//! and the claim equals the agent's own recomputation.
//!
//! A claim shows what its claimant decides after the turns before it, which it has computed itself. So it does not wait for
//! the claims of those turns, and the messages of all turns travel at the same time.

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ClosedRoster, Decision, Epoch, EvictionNotice, Message, ModuleId, ModulePhase, SpotClaim,
};
use formation_motion::PlannedMotion;
use formation_planner::{ClaimRefused, PlannedTurns};

use super::super::context::Context;
use super::super::event::Event;
use super::super::plans::{ComputedPlan, PlanJob};
use super::super::refusal::Refusal;
use super::claims::EarlyClaims;
use super::{Agreeing, HeldPlan, Stage, Transition, hash_roster};

/// The turns of one epoch.
#[derive(Clone)]
pub(crate) struct Planning {
    pub roster: Arc<ClosedRoster>,
    job: PlanJob,
    /// Every turn as this replica decides it; `None` until the plan is computed.
    planned: Option<Arc<ComputedPlan>>,
    /// The number of turns that have been applied.
    applied: u32,
    /// By turn, whether a right claim has come; empty until the plan is computed.
    is_claimed: Vec<bool>,
    early_claims: EarlyClaims,
    began: Duration,
    /// When the last turn was applied, the plan was computed, or the claimant was last seen to compute its own.
    progress_at: Duration,
    reported_overdue: bool,
}

impl Hash for Planning {
    /// The decisions follow from the roster and the number of turns.
    fn hash<H: Hasher>(&self, state: &mut H) {
        hash_roster(&self.roster, state);
        let progress = (self.applied, self.progress_at);
        (progress, &self.is_claimed, &self.early_claims).hash(state);
    }
}

impl Planning {
    /// Begins with the turns of a roster; refuses a roster that contradicts itself.
    pub fn begin(roster: Arc<ClosedRoster>, context: &mut Context) -> Option<Self> {
        let members = roster.members.len();
        let epoch = roster.epoch;
        let expected = roster.target.expected_modules;
        context.session.number_was_met |=
            expected.is_some_and(|expected| members >= expected as usize);
        let problem = roster.problem().ok().flatten();
        let Some(problem) = problem else {
            context.refuse(Some(epoch.convener), Refusal::BadRoster);
            return None;
        };
        context.emit(Event::PlanningBegun { epoch, members });
        Some(Self {
            job: PlanJob::plan(problem),
            planned: None,
            applied: 0,
            roster,
            is_claimed: Vec::new(),
            early_claims: EarlyClaims::default(),
            began: context.now,
            progress_at: context.now,
            reported_overdue: false,
        })
    }

    /// The same turns, with claims that came before the roster.
    pub fn with_claims(mut self, claims: EarlyClaims) -> Self {
        self.early_claims = claims;
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

    /// Judges a claim of a member, or keeps it until the plan is computed.
    /// Enforces T3.
    pub fn take_claim(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        let member = self.roster.member(claim.claimant);
        if member.is_none_or(|member| member.incarnation != claim.incarnation) {
            return Err(Refusal::UnknownModule);
        }
        if claim.turn < self.applied {
            return Err(Refusal::StaleEpoch);
        }
        let Some(planned) = &self.planned else {
            return self.early_claims.keep(claim);
        };
        judge(planned.turns(), &claim)?;
        self.note_claimed(&claim);
        Ok(())
    }

    /// Publishes this module's claims once the plan is computed, and applies the turns in order, as far as they are claimed.
    /// Enforces T2.
    pub fn step(mut self: Box<Self>, context: &mut Context) -> Transition {
        let Some(planned) = self.planned(context) else {
            return Transition::Stay(Stage::Planning(self));
        };
        while let Some((claimant, decision)) = planned.turns().turn(self.applied) {
            let is_own = claimant == context.module();
            if is_own || self.is_claimed[self.applied as usize] {
                self.apply(claimant, decision, context);
            } else {
                let waited = context.now.saturating_sub(self.began);
                let computes = context.peers.computes(claimant, self.roster.epoch);
                if computes && waited <= context.parameters.plan_limit {
                    self.progress_at = context.now;
                }
                return Transition::Stay(Stage::Planning(self));
            }
        }
        Transition::Enter(self.finish(&planned, context))
    }

    /// Every turn as this replica decides it; `None` until the plan is computed.
    fn planned(&mut self, context: &mut Context) -> Option<Arc<ComputedPlan>> {
        if self.planned.is_none() {
            self.planned = context.plan(self.job.clone());
            if let Some(planned) = self.planned.clone() {
                self.publish_claims(planned.turns(), context);
                self.judge_early_claims(&planned, context);
                self.progress_at = context.now;
            } else {
                self.report_overdue(context);
            }
        }
        self.planned.clone()
    }

    fn judge_early_claims(&mut self, planned: &ComputedPlan, context: &mut Context) {
        self.is_claimed = vec![false; planned.turns().decisions().len()];
        for claim in std::mem::take(&mut self.early_claims).in_turn() {
            match judge(planned.turns(), &claim) {
                Ok(()) => self.note_claimed(&claim),
                Err(refusal) => context.refuse(Some(claim.claimant), refusal),
            }
        }
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
    /// Enforces T1.
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

    /// Records a right claim. Its decision needs no place, as the plan contains it.
    fn note_claimed(&mut self, claim: &SpotClaim) {
        self.is_claimed[claim.turn as usize] = true;
    }

    /// Applies the decision of the present turn.
    fn apply(&mut self, claimant: ModuleId, decision: &Decision, context: &mut Context) {
        if claimant != context.module() {
            report_own_eviction(decision, context);
        }
        self.applied += 1;
        self.progress_at = context.now;
    }

    fn finish(self, planned: &ComputedPlan, context: &mut Context) -> Stage {
        let epoch = self.roster.epoch;
        let roster_plan = planned.for_roster(&self.roster);
        let digest = roster_plan.digest;
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
        report_motion(planned.motion().planned(), epoch, context);
        context.session.note_shown(&self.roster);
        let until = context.now + context.parameters.idle_age();
        let shown = &mut context.session.shown;
        shown.note(digest, &self.roster, until);
        context.mark_state_changed();
        let own = context.module();
        let mut held = HeldPlan::new(own, self.roster, planned, roster_plan, digest, turns);
        held.closed_at = self.began;
        Stage::Agreeing(Box::new(Agreeing::new(held, context.now)))
    }
}

/// Judges a claim: it must come from the module whose turn it is, and equal this replica's own recomputation.
/// Enforces T2.
fn judge(planned: &PlannedTurns, claim: &SpotClaim) -> Result<(), Refusal> {
    match planned.check(claim.turn, claim.claimant, &claim.decision) {
        Ok(()) => Ok(()),
        Err(ClaimRefused::DifferentDecision { .. }) => Err(Refusal::DifferentDecision),
        Err(_) => Err(Refusal::WrongClaimant),
    }
}

/// Reports, as the convener, why modules do not move.
fn report_motion(motion: &PlannedMotion, epoch: Epoch, context: &mut Context) {
    if epoch.convener != context.module() {
        return;
    }
    match motion {
        PlannedMotion::Paths(_) => {}
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

#[cfg(test)]
mod tests {

    use super::*;
    use crate::plans::tests::{problem, roster};
    use crate::{AgentParameters, Identity};
    use formation_model::Incarnation;

    /// The claims of all units but that of this module, each once as it should be and once with another decision.
    fn claims_of_others(
        roster: &ClosedRoster,
        own: ModuleId,
    ) -> (Vec<Arc<SpotClaim>>, Vec<Arc<SpotClaim>>) {
        let problem = roster.problem().unwrap().unwrap();
        let planned = PlannedTurns::of(problem);
        let others = planned.turns().filter(|&(_, leader, _)| leader != own);
        let right = others.map(|(turn, claimant, decision)| SpotClaim {
            epoch: roster.epoch,
            turn,
            claimant,
            incarnation: Incarnation(1),
            decision: decision.clone(),
        });
        let right: Vec<SpotClaim> = right.collect();
        let wrong = right.iter().cloned().map(|mut claim| {
            claim.decision.selections.clear();
            Arc::new(claim)
        });
        let wrong = wrong.collect();
        (right.into_iter().map(Arc::new).collect(), wrong)
    }

    /// Shows T2.
    #[test]
    fn claims_are_judged_as_they_come_and_turns_applied_in_order() {
        let problem = problem(6);
        let own = problem.modules()[0].id;
        let roster = Arc::new(ClosedRoster::from(roster(&problem)));
        let identity = Identity::single(own.run(Incarnation(1)), problem.modules()[0].pose);
        let mut context = Context::new(identity, AgentParameters::default(), Duration::ZERO);
        let (right, wrong) = claims_of_others(&roster, own);
        let (early, late) = (&right[..1], &right[1..]);
        assert!(!late.is_empty());

        let mut claims = EarlyClaims::default();
        for claim in [&wrong[0], &early[0]] {
            claims.keep(Arc::clone(claim)).unwrap();
        }
        let planning = Planning::begin(Arc::clone(&roster), &mut context).unwrap();
        let planning = Box::new(planning.with_claims(claims));
        let Transition::Stay(Stage::Planning(mut planning)) = planning.step(&mut context) else {
            panic!("the claims of the other units are missing");
        };
        assert_eq!(context.outbox.refusals.total(), 1, "the early wrong one");

        for claim in &wrong[1..] {
            let refusal = planning.take_claim(Arc::clone(claim));
            assert_eq!(refusal, Err(Refusal::DifferentDecision));
        }
        let applied = planning.applied();
        for claim in late[1..].iter().rev() {
            assert_eq!(planning.take_claim(Arc::clone(claim)), Ok(()));
        }
        let Transition::Stay(Stage::Planning(mut planning)) = planning.step(&mut context) else {
            panic!("one claim is missing");
        };
        assert_eq!(
            planning.applied(),
            applied,
            "it waits for the turn of {:?}",
            late[0]
        );
        assert_eq!(planning.take_claim(Arc::clone(&late[0])), Ok(()));
        let Transition::Enter(Stage::Agreeing(agreeing)) = planning.step(&mut context) else {
            panic!("each turn is claimed");
        };
        let turns = roster.problem().unwrap().unwrap();
        let turns = PlannedTurns::of(turns).decisions().len();
        assert_eq!(agreeing.held.turns as usize, turns);
    }
}
