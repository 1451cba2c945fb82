//! When the first motion of a plan may begin.
//!
//! Whoever the roster left out may move by an earlier plan until the lease of the last heartbeat that shows that plan has passed. Nobody
//! can where every founder is a member and none has shown a plan before: each roster holds a founder, and without its heartbeats no
//! member of that roster moves. What a founder showed before it started again has lapsed once its run is old enough.

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
    /// Whether no member knows of an earlier roster, and all founders are members.
    pub(super) fn is_first(&self, context: &Context) -> bool {
        let founders = &context.memory.founders;
        let members = &self.roster_plan.members;
        let are_members = founders.iter().all(|founder| members.contains_key(founder));
        let knows_others = !context.memory.quorum.knows_only(self.epoch());
        !founders.is_empty() && are_members && !knows_others && self.roster.quorum_bases.is_empty()
    }
}

impl Acting {
    /// When this module may set off: one lease after agreement, or sooner where nobody can be in motion by another plan; and not before
    /// the others can have heard of the plan.
    /// Enforces A2.
    pub(super) fn first_motion(&self, context: &Context) -> Duration {
        let has_shown = context.outbox.heartbeats.show_plan_of(self.held.epoch());
        let shown_at = if has_shown {
            context.now
        } else {
            context.now + PROMPT
        };
        self.end_of_wait(context).max(shown_at)
    }

    fn end_of_wait(&self, context: &Context) -> Duration {
        let by_lease = self.agreed_at + context.parameters.lease;
        if !self.is_first || context.now >= by_lease {
            return by_lease;
        }
        let idle = self.founders_are_old_at(context);
        idle.map_or(by_lease, |at| by_lease.min(at.max(self.agreed_at)))
    }

    /// When the run of every founder, and of the convener, is so old that what its former run showed counts for nobody any more: a lease,
    /// and what clocks and delays may add to that. `None` while one of these runs was not heard.
    fn founders_are_old_at(&self, context: &Context) -> Option<Duration> {
        let age = context.parameters.lease + context.parameters.heartbeat;
        let old_at = |&founder| {
            if founder == context.module() {
                return Some(context.own.started + age);
            }
            let peer = context.peers.get(founder)?;
            let is_member = self.held.roster_plan.members.get(&founder) == Some(&peer.incarnation);
            peer.clock().filter(|_| is_member)?.old_at(age)
        };
        // It may have opened this epoch before, in an earlier run.
        let convener = self.held.epoch().convener;
        let founders = context.memory.founders.iter();
        let mut times = founders.chain([&convener]).map(old_at);
        times.try_fold(Duration::ZERO, |latest, at| Some(latest.max(at?)))
    }

    /// Says how long the members wait, if that is long.
    pub(super) fn report_wait(&self, context: &mut Context) {
        let wait = self.end_of_wait(context).saturating_sub(context.now);
        if wait > SHORT && self.held.epoch().convener == context.module() {
            context.emit(Event::WaitingForLease(wait));
        }
    }
}
