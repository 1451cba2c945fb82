//! Pursues the goals of the action `FormConfiguration`, one at a time: a newer goal takes the place of the one before it, as
//! a newer target does. It knows no DDS.

use std::time::Duration;

use formation::model::{Message, TargetAnnouncement};
use formation::verify::Progress;
use formation_msgs::{FormConfigurationFeedback, FormConfigurationResult, Verdict};
use ros2_client::action::{CancelGoalResponse, GoalId, GoalInfo, GoalStatusEnum};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::builtin_interfaces::Time;

use super::answer;
use super::register::Register;
use ros_runtime::goals::{Asked, Goals};

/// However much comes in, feedback is given at most this often.
const FEEDBACK_INTERVAL: Duration = Duration::from_millis(100);

/// How long is waited for others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limits {
    /// For a verdict on a goal.
    pub(super) verdict: Duration,
    /// For the modules to stand still, once a goal is cancelled.
    pub(super) standstill: Duration,
}

/// The goal on its way.
struct Pursuit {
    goal: GoalId,
    /// When it was accepted, by the wall clock and by the process' own.
    stamp: Time,
    began: Duration,
    /// The revision under which its target was announced.
    revision: u64,
    /// Since when it is being cancelled.
    cancelled: Option<Duration>,
    /// What the latest feedback told.
    told: Option<Progress>,
    feedback_due: Duration,
}

/// What somebody is to be told who waited for the result of a goal.
pub(super) type Answer<Q> = (Q, GoalStatusEnum, FormConfigurationResult);

/// The goals, and what is announced for them; whoever waits for a result is known by a `Q`.
pub(super) struct Conduct<Q> {
    pub(super) register: Register,
    goals: Goals<FormConfigurationResult, Q>,
    pursuit: Option<Pursuit>,
    answers: Vec<Answer<Q>>,
    statuses_are_new: bool,
    progress_may_be_new: bool,
}

impl<Q> Conduct<Q> {
    pub(super) fn new() -> Self {
        Self {
            register: Register::new(),
            goals: Goals::new(),
            pursuit: None,
            answers: Vec::new(),
            statuses_are_new: false,
            progress_may_be_new: false,
        }
    }

    /// Takes in what modules say.
    pub(super) fn hear(&mut self, now: Duration, message: &Message) {
        self.register.hear(now, message);
        self.progress_may_be_new = true;
    }

    /// Takes a goal, accepted at `stamp` by the wall clock; false if its identifier is in use. What it wants is announced
    /// under a revision of at least `fresh`; a goal that wants what cannot be ends at once, with the reason, and changes
    /// nothing.
    pub(super) fn begin(
        &mut self,
        now: Duration,
        stamp: Time,
        goal: GoalId,
        fresh: u64,
        wanted: Result<TargetAnnouncement, String>,
    ) -> bool {
        if !self.goals.accept(goal, stamp) {
            return false;
        }
        self.statuses_are_new = true;
        let announced =
            wanted.and_then(|wanted| self.register.announce_above_all(now, fresh, wanted));
        match announced {
            Ok(revision) => {
                self.end(Self::superseded);
                self.pursuit = Some(Pursuit {
                    goal,
                    stamp,
                    began: now,
                    revision,
                    cancelled: None,
                    told: None,
                    feedback_due: now,
                });
                self.progress_may_be_new = true;
            }
            Err(reason) => {
                tracing::warn!("gave up a goal: {reason}");
                self.conclude(goal, GoalStatusEnum::Aborted, &without_verdict(reason));
            }
        }
        true
    }

    /// Gives goals up: their target is withdrawn, if it still holds. The goal ends when the modules stand still.
    pub(super) fn cancel(
        &mut self,
        now: Duration,
        fresh: u64,
        meant: &GoalInfo,
    ) -> CancelGoalResponse {
        let response = self.goals.cancel(meant);
        let is_meant = |goal: GoalId| {
            response
                .goals_canceling
                .iter()
                .any(|one| one.goal_id == goal)
        };
        if let Some(pursuit) = &mut self.pursuit
            && is_meant(pursuit.goal)
        {
            self.statuses_are_new = true;
            if pursuit.cancelled.is_none() {
                pursuit.cancelled = Some(now);
                // If it does not hold any more, there is nothing to withdraw.
                let withdrawn = self.register.withdraw(now, fresh, pursuit.revision);
                if let Ok(told) = withdrawn {
                    tracing::info!("cancelled a goal: {told}");
                }
            }
        }
        response
    }

    /// Somebody wants to know what came of a goal.
    pub(super) fn ask(&mut self, goal: GoalId, who: Q)
    where
        Q: Clone,
    {
        if let Asked::Answer(status, result) = self.goals.ask(goal, who.clone()) {
            self.answers.push((who, status, result));
        }
    }

    /// Ends the goal on its way, if it is done, was given up, or waited for long enough.
    pub(super) fn advance(&mut self, now: Duration, limits: Limits) {
        self.end(|register, pursuit| match pursuit.cancelled {
            Some(since) => given_up(register, now, pursuit, since, limits),
            None => came_to_an_end(register, now, pursuit, limits),
        });
    }

    /// When [`Self::advance`] or [`Self::take_feedback`] is due next.
    pub(super) fn due(&self, limits: Limits) -> Option<Duration> {
        let pursuit = self.pursuit.as_ref()?;
        let end = match pursuit.cancelled {
            Some(since) => since.saturating_add(limits.standstill),
            None => pursuit.began.saturating_add(limits.verdict),
        };
        Some(if self.progress_may_be_new {
            end.min(pursuit.feedback_due)
        } else {
            end
        })
    }

    /// What to tell of the goal on its way, if that is new.
    pub(super) fn take_feedback(
        &mut self,
        now: Duration,
    ) -> Option<(GoalId, FormConfigurationFeedback)> {
        let pursuit = self.pursuit.as_mut()?;
        if !self.progress_may_be_new || now < pursuit.feedback_due {
            return None;
        }
        self.progress_may_be_new = false;
        pursuit.feedback_due = now + FEEDBACK_INTERVAL;
        let progress = self.register.progress();
        if pursuit.told.as_ref() == Some(&progress) {
            return None;
        }
        let feedback = FormConfigurationFeedback {
            progress: (&progress).into(),
        };
        pursuit.told = Some(progress);
        Some((pursuit.goal, feedback))
    }

    /// Who is to be told of results.
    pub(super) fn take_answers(&mut self) -> Vec<Answer<Q>> {
        std::mem::take(&mut self.answers)
    }

    /// In which state all goals are, if that is new.
    pub(super) fn take_statuses(&mut self) -> Option<GoalStatusArray> {
        std::mem::take(&mut self.statuses_are_new).then(|| self.goals.statuses())
    }

    /// Has the statuses told again, to new endpoints.
    pub(super) fn renew_statuses(&mut self) {
        self.statuses_are_new = true;
    }

    fn superseded(
        _: &Register,
        pursuit: &Pursuit,
    ) -> Option<(GoalStatusEnum, FormConfigurationResult)> {
        let status = match pursuit.cancelled {
            Some(_) => GoalStatusEnum::Canceled,
            None => GoalStatusEnum::Aborted,
        };
        Some((
            status,
            without_verdict("a newer goal took its place".to_owned()),
        ))
    }

    /// Ends the goal on its way, if `judge` says how.
    fn end(
        &mut self,
        judge: impl FnOnce(&Register, &Pursuit) -> Option<(GoalStatusEnum, FormConfigurationResult)>,
    ) {
        let Some(pursuit) = &self.pursuit else { return };
        let goal = pursuit.goal;
        if let Some((status, result)) = judge(&self.register, pursuit) {
            self.pursuit = None;
            tracing::info!("a goal has ended: {}", result.message);
            self.conclude(goal, status, &result);
        }
    }

    fn conclude(&mut self, goal: GoalId, status: GoalStatusEnum, result: &FormConfigurationResult) {
        self.statuses_are_new = true;
        let waiting = self.goals.end(goal, status, result.clone());
        let answers = waiting.into_iter().map(|who| (who, status, result.clone()));
        self.answers.extend(answers);
    }
}

fn without_verdict(message: String) -> FormConfigurationResult {
    FormConfigurationResult {
        verdict: Verdict::default(),
        message: answer(message),
    }
}

/// A goal that is being cancelled ends when the modules that live stand still, when they have another target and so will
/// not, or when they were waited for long enough.
fn given_up(
    register: &Register,
    now: Duration,
    pursuit: &Pursuit,
    since: Duration,
    limits: Limits,
) -> Option<(GoalStatusEnum, FormConfigurationResult)> {
    let (living, restless) = register.restless(now);
    let message = if let Some(newer) = register.target_newer_than(pursuit.revision) {
        newer
    } else if restless.is_empty() {
        format!("the target is withdrawn, and the {living} modules that were heard stand still")
    } else if now >= since.saturating_add(limits.standstill) {
        let named: Vec<String> = restless.iter().map(|module| module.0.to_string()).collect();
        format!(
            "the target is withdrawn, but within standstill_limit_s ({} s) these modules did not say that they stand \
             still: {}",
            limits.standstill.as_secs_f64(),
            named.join(", ")
        )
    } else {
        return None;
    };
    Some((GoalStatusEnum::Canceled, without_verdict(message)))
}

/// A goal ends with a verdict, when its target does not hold any more, or when it was waited for long enough.
fn came_to_an_end(
    register: &Register,
    now: Duration,
    pursuit: &Pursuit,
    limits: Limits,
) -> Option<(GoalStatusEnum, FormConfigurationResult)> {
    if let Some(newer) = register.newer_than(pursuit.revision) {
        return Some((GoalStatusEnum::Aborted, without_verdict(newer)));
    }
    if let Some(verdict) = register.verdict_on(pursuit.began, pursuit.stamp) {
        return Some(judged(verdict));
    }
    if now < pursuit.began.saturating_add(limits.verdict) {
        return None;
    }
    let progress = register.progress();
    let message = format!(
        "no verdict came within verdict_limit_s ({} s), and the target stays announced; the formation is {}, {} of {} \
         modules have settled; `verifier --keep-watching` judges one target after the other",
        limits.verdict.as_secs_f64(),
        progress.stage,
        progress.settled,
        progress.to_fill
    );
    Some((GoalStatusEnum::Aborted, without_verdict(message)))
}

fn judged(verdict: &Verdict) -> (GoalStatusEnum, FormConfigurationResult) {
    let filled = format!(
        "{} of {} spots are filled",
        verdict.filled_spots, verdict.spots
    );
    let (status, message) = match verdict.outcome {
        Verdict::OUTCOME_COMPLETE => (GoalStatusEnum::Succeeded, format!("COMPLETE: {filled}")),
        Verdict::OUTCOME_PARTIAL => (GoalStatusEnum::Succeeded, format!("PARTIAL: {filled}")),
        _ => {
            let wrong = verdict.violations.join("; ");
            (
                GoalStatusEnum::Aborted,
                format!("FAILED: {filled}; {wrong}"),
            )
        }
    };
    let result = FormConfigurationResult {
        verdict: verdict.clone(),
        message: answer(message),
    };
    (status, result)
}

#[cfg(test)]
mod tests;
