//! Agreeing: a complete plan is in force only when the latest heartbeat of every member shows its digest.

use std::time::Duration;

use formation_model::ModuleId;

use super::super::context::Context;
use super::super::event::Event;
use super::{Acting, HeldPlan, Stage, Transition};

/// A complete plan on which not all members agree so far.
#[derive(Clone, Hash)]
pub(crate) struct Agreeing {
    pub held: HeldPlan,
    since: Duration,
    /// Since when members are missing that do not compute their plan.
    missing_since: Duration,
    /// The members that were last reported as missing.
    reported: Vec<ModuleId>,
    reported_sides: bool,
}

impl Agreeing {
    pub fn new(held: HeldPlan, now: Duration) -> Self {
        Self {
            held,
            since: now,
            missing_since: now,
            reported: Vec::new(),
            reported_sides: false,
        }
    }

    /// The members whose agreement has been missing for longer than `stuck`.
    pub fn stuck_members(&self, context: &Context) -> Vec<ModuleId> {
        let waited = context.now.saturating_sub(self.missing_since);
        if self.held.has_mismatch || waited <= context.parameters.stuck {
            return Vec::new();
        }
        self.held.not_agreeing(context)
    }

    /// Begins to act when all members show the digest, and reports what is missing otherwise.
    pub fn step(mut self: Box<Self>, context: &mut Context) -> Transition {
        if self.held.note_mismatch(context) {
            return Transition::Stay(Stage::Agreeing(self));
        }
        let lease = context.parameters.lease;
        let is_report_due = self.held.has_mismatch || context.now > self.since + lease;
        if !is_report_due && self.held.still_lags(context) {
            return Transition::Stay(Stage::Agreeing(self));
        }
        let lagging = self.held.lagging(context);
        self.held.waits_for = lagging.first().copied();
        if lagging.is_empty() && context.outbox.may_show_plan_of(self.held.epoch()) {
            let acting = Acting::begin(self.held, context);
            return Transition::Enter(Stage::Acting(Box::new(acting)));
        }
        let computes = |&module: &ModuleId| context.peers.computes(module, self.held.epoch());
        let waited = context.now.saturating_sub(self.since);
        if waited <= context.parameters.plan_limit && lagging.iter().any(computes) {
            self.missing_since = context.now;
        }
        self.report_sides(context);
        if self.reported != lagging && context.now > self.since + lease {
            self.reported.clone_from(&lagging);
            context.emit(Event::WaitingForAgreement(lagging));
        }
        Transition::Stay(Stage::Agreeing(self))
    }

    /// Reports which members hold which plan, when another epoch has not helped and no further epoch is opened for it.
    /// Enforces A6.
    fn report_sides(&mut self, context: &mut Context) {
        let persists = context.session.mismatches > 1;
        if !persists || !self.held.has_mismatch || self.reported_sides {
            return;
        }
        let report_at = self.since + context.parameters.lease;
        if context.now < report_at {
            context.wake_at(report_at);
            return;
        }
        self.reported_sides = true;
        let sides = self.held.sides(context);
        context.emit(Event::PlansDiffer(sides.into_iter().collect()));
    }
}
