//! The observer: takes in messages and gives verdicts.

use std::sync::Arc;
use std::time::Duration;

use super::parameters::ObserverParameters;
use super::received::Received;
use super::verdict::Verdict;
use crate::model::{Epoch, Message, TargetAnnouncement};

/// Judges a formation by its messages.
///
/// Call [`Self::handle`] for each message. Call [`Self::verdict`] when [`Self::poll_timeout`] is due, and at any other time.
/// A verdict stands, unless [`Self::review`] is called.
#[derive(Clone, Debug)]
pub struct Observer {
    pub(super) parameters: ObserverParameters,
    pub(super) received: Received,
    /// Since when the end state has been reached without a break.
    pub(super) reached_since: Option<Duration>,
    /// Since when an end state that was judged is no longer reached.
    broken_since: Option<Duration>,
    /// The time from which the time limit counts.
    pub(super) limit_from: Duration,
    /// Since when the members are to stand still.
    pub(super) stopped_since: Option<Duration>,
    /// Whether a target with other content was announced since the verdict.
    has_new_target: bool,
    verdict: Option<Verdict>,
}

/// The time for which an end state must be broken before its verdict is taken back: a second process with a living module's
/// identifier can hide that module until its next heartbeat.
const RETRACTION_DELAY: Duration = Duration::from_secs(1);

impl Observer {
    /// Starts at time zero.
    pub fn new(parameters: ObserverParameters) -> Self {
        Self {
            received: Received::new(&parameters),
            parameters,
            reached_since: None,
            broken_since: None,
            limit_from: Duration::ZERO,
            stopped_since: None,
            has_new_target: false,
            verdict: None,
        }
    }

    /// Handles a message received at `now`, the time since the observer's start.
    pub fn handle(&mut self, now: Duration, message: &Message) {
        let has_new_content = self.received.handle(now, message);
        if has_new_content {
            self.has_new_target = self.verdict.is_some();
            // The time before a target is announced does not count.
            self.limit_from = now;
        }
    }

    /// The time at which [`Self::verdict`] can change without a message; `None` once there is a verdict.
    pub fn poll_timeout(&self) -> Option<Duration> {
        if self.verdict.is_some() {
            return None;
        }
        let limit = self.time_limit();
        Some(self.reached_since.map_or(limit, |since| {
            limit.min(since.saturating_add(self.parameters.grace))
        }))
    }

    pub(super) fn time_limit(&self) -> Duration {
        self.limit_from.saturating_add(self.parameters.time_limit)
    }

    /// The verdict, once there is one.
    pub fn verdict(&mut self, now: Duration) -> Option<&Verdict> {
        if self.verdict.is_none() {
            self.verdict = self.judge(now);
        }
        self.verdict.as_ref()
    }

    /// Reviews a verdict; `None` while it still holds.
    ///
    /// A formation that was done and is not done any more, because a member is silent or a new plan is under way, is FAILED
    /// until it is done again. After the announcement of a target with other content there is no verdict, and the time limit
    /// restarts.
    pub fn review(&mut self, now: Duration) -> Option<&Verdict> {
        let known = self
            .verdict
            .take()
            .filter(|_| !std::mem::take(&mut self.has_new_target));
        let Some(known) = known else {
            self.broken_since = None;
            return self.verdict(now);
        };
        let fresh = match self.judge(now) {
            Some(verdict) => Some(verdict),
            // Done with violations, which can still be resolved.
            None if self.reached_since.is_some() => None,
            None => {
                let since = *self.broken_since.get_or_insert(now);
                (now >= since.saturating_add(RETRACTION_DELAY))
                    .then(|| self.report(now, self.missing(now), None))
            }
        };
        if self.reached_since.is_some() {
            self.broken_since = None;
        }
        match fresh.filter(|fresh| !fresh.says_the_same_as(&known)) {
            Some(fresh) => Some(self.verdict.insert(fresh)),
            None => {
                self.verdict = Some(known);
                None
            }
        }
    }

    /// The announcement with the highest revision: a target or its withdrawal.
    pub fn target(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.received.target.as_ref()
    }

    /// The newest epoch with a roster, if it plans for the target in force.
    pub fn current_epoch(&self) -> Option<Epoch> {
        self.received.current().map(|planned| planned.epoch)
    }
}
