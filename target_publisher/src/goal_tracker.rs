//! Tracks the goals of the action `FormConfiguration`, one at a time: a newer goal replaces the one before it, as a newer
//! target does. This module knows no DDS.

use std::time::Duration;

use formation_model::{Message, TargetAnnouncement};
use formation_msgs::{FormConfigurationFeedback, FormConfigurationResult, Verdict, bounds};
use formation_verify::Progress;
use ros_runtime::goals::Goals;
use ros2_client::action::{CancelGoalResponse, GoalId, GoalInfo, GoalStatusEnum};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::builtin_interfaces::Time;

use crate::formation_status::FormationStatus;
use crate::parameters::PublisherParameters;

/// The least time between two feedback messages.
const FEEDBACK_INTERVAL: Duration = Duration::from_millis(100);
/// After this time the same feedback is published again: feedback is volatile, so a client that was matched only after
/// the first one would wait until the progress changes.
const FEEDBACK_REPEAT_INTERVAL: Duration = Duration::from_secs(1);

/// The goal that is pursued.
struct Pursuit {
    goal: GoalId,
    /// When it was accepted, by the wall clock and by the process' own.
    stamp: Time,
    began: Duration,
    /// The revision under which its target was announced.
    revision: u64,
    /// Since when it is being cancelled.
    cancelled: Option<Duration>,
    /// The progress in the latest feedback, and when that is published again.
    published: Option<(Progress, Duration)>,
    /// When new progress may be published.
    feedback_due: Duration,
}

/// How a goal ended.
type End = (GoalStatusEnum, FormConfigurationResult);

/// The answer for a client that waited for the result of a goal.
pub(crate) type Answer<Q> = (Q, GoalStatusEnum, FormConfigurationResult);

/// The goals, and what is announced for them; a `Q` stands for a client that waits for a result.
pub(crate) struct GoalTracker<Q> {
    /// What is announced, and the progress with it.
    pub status: FormationStatus,
    goals: Goals<FormConfigurationResult, Q>,
    pursuit: Option<Pursuit>,
    answers: Vec<Answer<Q>>,
    goal_states_are_new: bool,
    progress_may_be_new: bool,
}

impl<Q> Default for GoalTracker<Q> {
    fn default() -> Self {
        Self {
            status: FormationStatus::default(),
            goals: Goals::default(),
            pursuit: None,
            answers: Vec::new(),
            goal_states_are_new: false,
            progress_may_be_new: false,
        }
    }
}

impl<Q> GoalTracker<Q> {
    /// Takes in a message of a module or publisher.
    pub(crate) fn handle_message(&mut self, now: Duration, message: &Message) {
        self.status.handle_message(now, message);
        self.progress_may_be_new = true;
    }

    /// Accepts a goal at `stamp` by the wall clock, and announces its target under a revision of at least `fresh`. False if
    /// its identifier is in use, or its target cannot be formed: the goal then changes nothing.
    pub(crate) fn begin(
        &mut self,
        now: Duration,
        stamp: Time,
        goal: GoalId,
        fresh: u64,
        target: Result<TargetAnnouncement, String>,
    ) -> bool {
        if self.goals.knows(goal) {
            return false;
        }
        let announced =
            target.and_then(|target| self.status.announce_above_all(now, fresh, target));
        let revision = match announced {
            Ok(revision) => revision,
            Err(reason) => {
                // The answer to a goal has no room for a reason, so clients read it in the log.
                tracing::warn!("rejected a goal: {reason}");
                return false;
            }
        };
        self.goals.accept(goal, stamp);
        self.goal_states_are_new = true;
        self.end(replaced);
        self.pursuit = Some(Pursuit {
            goal,
            stamp,
            began: now,
            revision,
            cancelled: None,
            published: None,
            feedback_due: now,
        });
        self.progress_may_be_new = true;
        true
    }

    /// Cancels goals: their target is withdrawn, if it is still the current one. The goal ends when the modules stand
    /// still.
    pub(crate) fn cancel(
        &mut self,
        now: Duration,
        fresh: u64,
        meant: &GoalInfo,
    ) -> CancelGoalResponse {
        let response = self.goals.cancel(meant);
        let is_meant = |goal| {
            response
                .goals_canceling
                .iter()
                .any(|one| one.goal_id == goal)
        };
        if let Some(pursuit) = &mut self.pursuit
            && is_meant(pursuit.goal)
        {
            self.goal_states_are_new = true;
            if pursuit.cancelled.is_none() {
                pursuit.cancelled = Some(now);
                // If another target is the current one, there is nothing to withdraw.
                if let Ok(withdrew) = self.status.withdraw(now, fresh, pursuit.revision) {
                    tracing::info!("cancelled a goal: {withdrew}");
                }
            }
        }
        response
    }

    /// Handles a client that asks for the result of a goal.
    pub(crate) fn ask(&mut self, goal: GoalId, client: Q) {
        self.answers.extend(self.goals.ask(goal, client));
    }

    /// Ends the goal that is pursued, if it is done, cancelled, or exceeds a limit.
    pub(crate) fn advance(&mut self, now: Duration, limits: &PublisherParameters) {
        self.end(|status, pursuit| match pursuit.cancelled {
            Some(since) => end_of_cancelled(status, now, pursuit, since, limits),
            None => end_of_pursued(status, now, pursuit, limits),
        });
    }

    /// When [`Self::advance`] or [`Self::take_feedback`] is due next.
    pub(crate) fn due(&self, limits: &PublisherParameters) -> Option<Duration> {
        let pursuit = self.pursuit.as_ref()?;
        let end = match pursuit.cancelled {
            Some(since) => since.saturating_add(limits.standstill_limit),
            None => pursuit.began.saturating_add(limits.verdict_limit),
        };
        let repeat = pursuit.published.as_ref().map(|(_, repeat)| *repeat);
        let news = self.progress_may_be_new.then_some(pursuit.feedback_due);
        [Some(end), repeat, news].into_iter().flatten().min()
    }

    /// Feedback on the goal that is pursued, if it is new or to be repeated.
    pub(crate) fn take_feedback(
        &mut self,
        now: Duration,
    ) -> Option<(GoalId, FormConfigurationFeedback)> {
        let pursuit = self.pursuit.as_mut()?;
        let is_repeat = matches!(pursuit.published, Some((_, repeat)) if repeat <= now);
        let may_be_new = self.progress_may_be_new && pursuit.feedback_due <= now;
        if !is_repeat && !may_be_new {
            return None;
        }
        self.progress_may_be_new = false;
        pursuit.feedback_due = now + FEEDBACK_INTERVAL;
        let progress = self.status.progress();
        let is_same = matches!(&pursuit.published, Some((latest, _)) if *latest == progress);
        if is_same && !is_repeat {
            return None;
        }
        let feedback = FormConfigurationFeedback {
            progress: (&progress).into(),
        };
        pursuit.published = Some((progress, now + FEEDBACK_REPEAT_INTERVAL));
        Some((pursuit.goal, feedback))
    }

    /// The answers for clients that waited for results.
    pub(crate) fn take_answers(&mut self) -> Vec<Answer<Q>> {
        std::mem::take(&mut self.answers)
    }

    /// The states of all goals, if they are new.
    pub(crate) fn take_goal_states(&mut self) -> Option<GoalStatusArray> {
        std::mem::take(&mut self.goal_states_are_new).then(|| self.goals.statuses())
    }

    /// Publishes the states again, on new endpoints.
    pub(crate) fn renew_goal_states(&mut self) {
        self.goal_states_are_new = true;
    }

    /// Ends the goal that is pursued, if `judge` gives an end.
    fn end(&mut self, judge: impl FnOnce(&FormationStatus, &Pursuit) -> Option<End>) {
        let Some(pursuit) = &self.pursuit else { return };
        let goal = pursuit.goal;
        if let Some((status, result)) = judge(&self.status, pursuit) {
            self.pursuit = None;
            tracing::info!("a goal has ended: {}", result.message);
            self.goal_states_are_new = true;
            let waiting = self.goals.end(goal, status, result.clone()).into_iter();
            let answers = waiting.map(|client| (client, status, result.clone()));
            self.answers.extend(answers);
        }
    }
}

fn result(verdict: Verdict, message: String) -> FormConfigurationResult {
    FormConfigurationResult {
        verdict,
        message: bounds::shortened(message, bounds::ANSWER_BYTES_MAX),
    }
}

fn without_verdict(message: String) -> FormConfigurationResult {
    result(Verdict::default(), message)
}

/// The end of a goal that a newer one replaces.
fn replaced(_: &FormationStatus, pursuit: &Pursuit) -> Option<End> {
    let status = match pursuit.cancelled {
        Some(_) => GoalStatusEnum::Canceled,
        None => GoalStatusEnum::Aborted,
    };
    Some((
        status,
        without_verdict("a newer goal took its place".to_owned()),
    ))
}

/// A goal that is being cancelled ends when the live modules stand still, when they have another target and so will not,
/// or at the limit.
fn end_of_cancelled(
    formation: &FormationStatus,
    now: Duration,
    pursuit: &Pursuit,
    since: Duration,
    limits: &PublisherParameters,
) -> Option<End> {
    let (live, restless) = formation.restless(now);
    let limit = limits.standstill_limit;
    let message = if let Some(newer) = formation.target_newer_than(pursuit.revision) {
        newer
    } else if restless.is_empty() {
        format!("the target is withdrawn, and the {live} live modules stand still")
    } else if now >= since.saturating_add(limit) {
        let named: Vec<String> = restless.iter().map(|module| module.0.to_string()).collect();
        format!(
            "the target is withdrawn, but within standstill_limit_s ({} s) these modules did not report that they stand \
             still: {}",
            limit.as_secs_f64(),
            named.join(", ")
        )
    } else {
        return None;
    };
    Some((GoalStatusEnum::Canceled, without_verdict(message)))
}

/// A goal ends with a verdict, when its target is no longer the current one, or at the limit.
fn end_of_pursued(
    formation: &FormationStatus,
    now: Duration,
    pursuit: &Pursuit,
    limits: &PublisherParameters,
) -> Option<End> {
    if let Some(newer) = formation.newer_than(pursuit.revision) {
        return Some((GoalStatusEnum::Aborted, without_verdict(newer)));
    }
    if let Some(verdict) = formation.verdict_on(pursuit.began, pursuit.stamp) {
        return Some(judged(verdict));
    }
    let limit = limits.verdict_limit;
    if now < pursuit.began.saturating_add(limit) {
        return None;
    }
    let progress = formation.progress();
    let message = format!(
        "no verdict came within verdict_limit_s ({} s), and the target stays announced; the formation is {}, {} of {} \
         modules have settled; `verifier --keep-watching` judges one target after the other",
        limit.as_secs_f64(),
        progress.stage,
        progress.settled,
        progress.to_fill
    );
    Some((GoalStatusEnum::Aborted, without_verdict(message)))
}

fn judged(verdict: &Verdict) -> End {
    let filled = format!(
        "{} of {} spots are filled",
        verdict.filled_spots, verdict.spots
    );
    let (status, message) = match verdict.outcome {
        Verdict::OUTCOME_COMPLETE => (GoalStatusEnum::Succeeded, format!("COMPLETE: {filled}")),
        Verdict::OUTCOME_PARTIAL => (GoalStatusEnum::Succeeded, format!("PARTIAL: {filled}")),
        Verdict::OUTCOME_NOT_JUDGED => {
            let reason = &verdict.collision_reason;
            let message = format!("NOT_JUDGED: {filled}; {reason}");
            (GoalStatusEnum::Aborted, message)
        }
        _ => {
            let wrong = verdict.violations.join("; ");
            (
                GoalStatusEnum::Aborted,
                format!("FAILED: {filled}; {wrong}"),
            )
        }
    };
    (status, result(verdict.clone(), message))
}

#[cfg(test)]
mod tests;
