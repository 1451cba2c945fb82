//! The observer: takes in messages and gives verdicts.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::breach::Breach;
use super::parameters::ObserverParameters;
use super::received::Received;
use super::verdict::Verdict;
use crate::Violation;
use formation_model::{Epoch, Message, TargetAnnouncement};

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
    /// The violations that were found in it.
    pub(super) breach: Option<Breach>,
    /// Since when an end state that was judged is no longer reached.
    broken_since: Option<Duration>,
    /// The time from which the time limit counts.
    pub(super) limit_from: Duration,
    /// Since when the members are to stand still.
    pub(super) stopped_since: Option<Duration>,
    /// Whether verdicts are reviewed, so that none need be given in haste.
    pub(super) is_reviewed: bool,
    /// Whether a target with other content was announced since the verdict.
    has_new_target: bool,
    /// The violations that verdicts on former targets reported.
    pub(super) reported: BTreeSet<Violation>,
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
            breach: None,
            broken_since: None,
            limit_from: Duration::ZERO,
            stopped_since: None,
            is_reviewed: false,
            has_new_target: false,
            reported: BTreeSet::new(),
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
        let due = |since: Duration| match self.breach {
            Some(breach) => breach.reported_at(&self.parameters),
            None => since.saturating_add(self.parameters.grace),
        };
        Some(
            self.reached_since
                .map_or(limit, |since| limit.min(due(since))),
        )
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

    /// The verdict if the time were up now: FAILED with whatever is missing.
    pub fn final_verdict(&mut self, now: Duration) -> Verdict {
        self.settle_bodies(now, Duration::ZERO);
        let verdict = self.judge_at(now, true);
        verdict.unwrap_or_else(|| self.report(now, self.missing(now), None))
    }

    /// Reviews a verdict; `None` while it still holds, and while no target is in force.
    ///
    /// A formation that was done and of which a member is silent is FAILED until it is done again. While a new plan is under way,
    /// the verdict on the plan before it holds, until the time limit has passed since then. After the announcement of a target
    /// with other content there is no verdict, the time limit restarts, and what was reported of the formation before is no
    /// violation of the next.
    pub fn review(&mut self, now: Duration) -> Option<&Verdict> {
        self.is_reviewed = true;
        // A roster carries the target, also where its publisher has ended.
        let has_target = match self.target() {
            Some(target) => target.target.is_some(),
            None => self.received.current().is_some(),
        };
        let has_new_target = std::mem::take(&mut self.has_new_target);
        let known = self.verdict.take();
        if !has_target || has_new_target {
            self.broken_since = None;
            self.received.bodies.unjudged.clear();
            self.reported
                .extend(known.into_iter().flat_map(|known| known.violations));
            self.forget_reported();
            return if has_target { self.verdict(now) } else { None };
        }
        let Some(known) = known else {
            return self.verdict(now);
        };
        self.note_stop(now);
        let is_late = self.broken_since.is_some() && now >= self.time_limit();
        let fresh = self.judge_at(now, is_late);
        let is_reached = self.reached_since.is_some();
        let fresh = fresh.or_else(|| {
            // Done with violations can still be resolved.
            let since = (!is_reached).then(|| self.broken_since(now))?;
            let is_broken = now >= since.saturating_add(RETRACTION_DELAY)
                && self.current_epoch() == known.epoch
                && self.has_silent_member(now);
            is_broken.then(|| self.report(now, self.missing(now), None))
        });
        if is_reached {
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

    /// Since when the end state that was judged is no longer reached. The time limit counts from then.
    fn broken_since(&mut self, now: Duration) -> Duration {
        *self.broken_since.get_or_insert_with(|| {
            self.limit_from = now;
            now
        })
    }

    /// Keeps only what would be reported again.
    fn forget_reported(&mut self) {
        if !self.reported.is_empty() {
            let again = self.received.violations();
            self.reported.retain(|violation| again.contains(violation));
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
