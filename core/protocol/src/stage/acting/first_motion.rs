//! When the first motion of a plan may begin.
//!
//! Whoever the roster left out may move by an earlier plan until the lease of the last heartbeat that shows that plan has passed. Each
//! roster holds a majority of the voters, so one of them is in this one and showed that plan; it has frozen before this roster was
//! closed. A lease later, and what clocks and delays may add to that, nobody moves by the earlier plan any more. That wait is left out
//! where all voters are members, and they can have shown no plan within the lease but one whose members have all frozen.

use std::time::Duration;

use super::Acting;
use crate::context::Context;
use crate::event::Event;
use crate::stage::HeldPlan;

/// Between two looks whether a heartbeat has gone out.
const PROMPT: Duration = Duration::from_millis(10);

/// Less is not worth a word.
const SHORT: Duration = Duration::from_millis(100);

impl HeldPlan {
    /// When nobody can be in motion by an earlier plan any more.
    /// Enforces A2.
    pub(super) fn idle_at(&self, context: &Context) -> Duration {
        let voters = &self.roster.voters;
        let is_idle = |module| {
            let member = self.roster.member(module);
            member.is_some_and(|member| member.is_idle)
        };
        let are_idle = !voters.named.is_empty()
            && !voters.has_removals()
            && voters.named.iter().copied().all(is_idle);
        if are_idle {
            self.closed_at
        } else {
            self.closed_at + context.parameters.idle_age()
        }
    }
}

impl Acting {
    /// When this module may set off: once nobody can be in motion by another plan, and not before the others can have heard of this one.
    /// Enforces A2.
    pub(super) fn first_motion(&self, context: &Context) -> Duration {
        let has_shown = context.outbox.heartbeats.show_plan_of(self.held.epoch());
        let shown_at = if has_shown {
            context.now
        } else {
            context.now + PROMPT
        };
        self.idle_at.max(shown_at)
    }

    /// Says how long the members wait, if that is long.
    pub(super) fn report_wait(&self, context: &mut Context) {
        let wait = self.idle_at.saturating_sub(context.now);
        if wait > SHORT && self.held.epoch().convener == context.module() {
            context.emit(Event::WaitingForLease(wait));
        }
    }
}
