//! Whether the clock of this process stood still, as that of a machine that was suspended.
//!
//! Heartbeats tell how long their senders have run. If those of one module suddenly come earlier than its clock and this one allow,
//! either its messages were late before, or this clock stood still; in both cases this process took old heartbeats for new ones, and
//! it halts. If those of at least half of the others do, its clock stood still; also if those of any do by more than `lease`: most of the
//! others may stand on the same machine. To the others each of its heartbeats is as old as that lasted, and none of them judges it by
//! another offset, because a clock that stood still and a queue look the same to them. So it begins a new run.

use std::time::Duration;

use formation_model::ModuleId;

use super::Agent;
use super::clock_offset::ClockDoubt;
use super::context::Context;
use super::event::Event;
use super::io::Output;
use super::parameters::AgentParameters;
use super::peer::Peer;

/// For how many periods of heartbeats a process compares its clock with those of others.
const PERIODS: u32 = 2;

impl Context {
    /// How much earlier than before the heartbeats of modules of other processes come since a time, the least first; of those that were
    /// heard for long enough to show the greatest of these gains.
    fn gains_since(&self, since: Duration) -> Vec<Duration> {
        let own = self.own.source;
        let is_other = |peer: &&Peer| own.is_none() || peer.source != own;
        let clocks = || self.peers.all().filter(is_other).flat_map(Peer::clocks);
        let greatest = clocks().map(|clock| clock.gain_since(since)).max();
        let greatest = greatest.unwrap_or_default();
        let period = self.parameters.heartbeat;
        let compared = clocks().filter(|clock| clock.is_compared_at(since, greatest, period));
        let gains = compared.map(|clock| clock.gain_since(since));
        let mut gains: Vec<Duration> = gains.collect();
        gains.sort_unstable();
        gains
    }
}

impl Agent {
    /// Doubts the clock if the latest heartbeat of a module came so much earlier that the clock may have stood still; returns whether it does
    /// so.
    /// Enforces M8.
    pub(super) fn doubt_clock(&mut self, module: ModuleId, gain: Duration) -> bool {
        // Without a plan nothing moves by the ages of heartbeats, and these are often late while many processes start.
        let holds_plan = self.digest().is_some();
        let context = &mut self.context;
        let AgentParameters {
            heartbeat, lease, ..
        } = context.parameters;
        let limit = if holds_plan { heartbeat } else { lease };
        let since = context.now;
        if gain <= limit || context.clock_doubt.is_some() {
            return false;
        }
        context.clock_doubt = Some(ClockDoubt { since, limit });
        context.stand_still();
        context.emit(Event::ClockInDoubt { module, gain });
        true
    }

    /// Judges a clock in doubt once the others have sent heartbeats.
    /// Enforces M8.
    pub(super) fn check_clock(&mut self) {
        let Some(ClockDoubt { since, limit }) = self.context.clock_doubt else {
            return;
        };
        let until = since + self.context.parameters.heartbeat * PERIODS;
        if self.context.now < until {
            return self.context.wake_at(until);
        }
        self.context.clock_doubt = None;
        let mut gains = self.context.gains_since(since);
        let compared = gains.len();
        gains.retain(|&gain| gain > limit);
        // The others may have been suspended on the same machine. A link that was so late before seldom becomes fast at once.
        let lease = self.context.parameters.lease;
        let longest = gains.last().filter(|&&gain| gain > lease);
        let is_half = gains.len() * 2 >= compared.max(1);
        let median = gains.get(gains.len() / 2).filter(|_| is_half);
        if let Some(&stood_still) = longest.or(median) {
            self.context.emit(Event::ClockStoodStill(stood_still));
            self.context.outbox.push(Output::BeginRun { stood_still });
        }
    }
}
