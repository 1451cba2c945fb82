//! The node of the process that judges the formation.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_event_log::{Entry, POSE_INTERVAL, Recorder};
use formation_model::{Message, SourceId};
use formation_msgs::{InSession, SessionId};
use formation_node_support::messages::{Received, session_of, subscribe_all};
use formation_node_support::{stamp, topics};
use formation_verify::{Admission, Agreement, Observer, Progress, SourceGuard, Verdict};
use ros_runtime::PublisherQueue;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::parameters::Tunables;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;
use ros_runtime::topic_statistics::{RefusalKind, SharedStatistics, TopicStatistics};

use crate::judging::Judging;
use crate::trace::TraceFile;

const NODE_NAME: &str = "verifier";

/// The least time between the arrival of a message and a judgement, and so between two judgements.
const JUDGE_INTERVAL: Duration = Duration::from_millis(50);

/// The verifier waits this many times as long as its last judgement took, within bounds: with a thousand modules a judgement takes
/// longer than the least interval, and the modules may need the processor.
const JUDGEMENTS_WAITED: u32 = 9;

/// How often a verifier that keeps watching looks for modules that have fallen silent.
const REVIEW_INTERVAL: Duration = Duration::from_secs(1);

/// A process that observes a formation and judges it by the topics alone.
#[derive(Clone, Debug)]
pub struct VerifierProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// How it judges.
    pub judging: Judging,
    /// Whether it ends as soon as all members agree on a plan, without waiting for them to move.
    pub plan_only: bool,
    /// Whether it reports every event, and not only the progress.
    pub event_log: bool,
    /// Whether it stays after the first verdict, and gives another whenever it changes, until it is asked to end.
    pub keep_watching: bool,
    /// The file to which it writes the states that it receives.
    pub trace: Option<PathBuf>,
    /// How long it stays after the verdict, so that subscribers can take it.
    pub linger: Duration,
}

impl VerifierProcess {
    /// Observes until there is an end, publishes the verdict, if that is the end, and leaves the graph.
    ///
    /// `notify` gets the progress whenever it changes, the events if those are asked for, and the end as soon as there is
    /// one; each that replaces an earlier one, if the process keeps watching.
    ///
    /// When the DDS library no longer receives, it starts over with what it receives then.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined, or the trace cannot be written, or lacks states.
    pub fn run(
        self,
        stop: &Receiver<()>,
        mut notify: impl FnMut(News<'_>),
    ) -> Result<JudgedFormation, RosContextError> {
        let trace = self.trace.as_deref().map(TraceFile::create).transpose();
        let mut trace = trace.map_err(RosContextError::BadInput)?;
        let judgement = rejoining(|| self.judge(stop, &mut trace, &mut notify))?;
        if let Some(trace) = trace {
            trace.finish().map_err(RosContextError::Failed)?;
        }
        Ok(judgement)
    }

    fn judge(
        &self,
        stop: &Receiver<()>,
        trace: &mut Option<TraceFile>,
        notify: &mut dyn FnMut(News<'_>),
    ) -> Result<JudgedFormation, RosContextError> {
        let parameters = self
            .settings
            .declare(NODE_NAME, self.judging.declarations())?;
        let Judging(judging) = self.judging.clone().read(parameters.values())?;
        let mut ros = RosContext::join(&self.settings, NODE_NAME, parameters)?;
        let mut inputs = Inputs::default();
        for messages in subscribe_all(&mut ros, 1)? {
            inputs.add(messages, |received| received);
        }
        let mut verifier = Verifier {
            process: self,
            start: Instant::now(),
            observer: Observer::new(judging),
            trace,
            recorder: self.event_log.then(|| Recorder::new(POSE_INTERVAL)),
            source_guard: SourceGuard::default(),
            statistics: ros.statistics(),
            session: session_of(&ros),
            // Created at the start, so that subscribers are matched when the verdict is published.
            verdicts: ros.state_publisher(&topics::VERDICT)?,
            notify,
            phase: Phase::Observing(Some(Instant::now())),
            judge_interval: JUDGE_INTERVAL,
            progress: None,
            end: None,
        };
        ros.run(&mut verifier, inputs, stop)?;
        let statistics = ros.statistics().borrow().clone();
        Ok(JudgedFormation {
            end: verifier.end,
            statistics,
        })
    }
}

/// How observation ended.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "an observation has one, so its size does not matter"
)]
pub enum End {
    /// With a verdict on the formation; the last, if the process kept watching.
    Judged(Verdict),
    /// With a plan on which all members agree, where no more was asked for.
    Agreed(Agreement),
}

/// The outcome of observation.
#[derive(Clone, Debug)]
pub struct JudgedFormation {
    /// How it ended; `None` when the process was asked to end before.
    pub end: Option<End>,
    /// What was received, and what was refused.
    pub statistics: TopicStatistics,
}

/// What a verifier reports.
#[derive(Clone, Copy, Debug)]
pub enum News<'a> {
    /// The progress, when it changed.
    Progress(&'a Progress),
    /// An event.
    Entry(&'a Entry),
    /// How observation ended.
    End(&'a End),
}

struct Verifier<'a> {
    process: &'a VerifierProcess,
    start: Instant,
    observer: Observer,
    /// Where every event is to be reported.
    recorder: Option<Recorder>,
    trace: &'a mut Option<TraceFile>,
    source_guard: SourceGuard<SourceId>,
    statistics: SharedStatistics,
    /// The session of the formation that is judged.
    session: SessionId,
    verdicts: PublisherQueue<formation_msgs::Verdict>,
    notify: &'a mut dyn FnMut(News<'_>),
    phase: Phase,
    /// The time between the arrival of a message and a judgement.
    judge_interval: Duration,
    /// The progress that was reported last.
    progress: Option<Progress>,
    end: Option<End>,
}

#[derive(Clone, Copy)]
enum Phase {
    /// Judges at this time, if there is something new to judge.
    Observing(Option<Instant>),
    /// Has published its verdict, and stays until then for subscribers.
    Lingering(Instant),
    Over,
}

impl Node for Verifier<'_> {
    type Input = Received;

    fn handle(&mut self, received: Received) {
        let Phase::Observing(judge_at) = self.phase else {
            return;
        };
        for message in &received.messages {
            match self.source_guard.admit(received.source, message) {
                Admission::Accepted => self.take_in(message),
                Admission::Waiting => {}
                Admission::Refused => {
                    let reason = "another process publishes for that module";
                    let mut statistics = self.statistics.borrow_mut();
                    statistics.refuse(received.topic, RefusalKind::Misattributed, &reason);
                }
            }
            for message in self.source_guard.released() {
                self.take_in(&message);
            }
        }
        let soon = Instant::now() + self.judge_interval;
        self.phase = Phase::Observing(Some(judge_at.map_or(soon, |at| at.min(soon))));
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        if self.due().is_some_and(|due| due <= Instant::now()) {
            self.phase = match self.phase {
                Phase::Observing(_) => self.judge(),
                Phase::Lingering(_) | Phase::Over => Phase::Over,
            };
        }
        Ok(match self.phase {
            Phase::Observing(_) | Phase::Lingering(_) => ControlFlow::Continue(()),
            Phase::Over => ControlFlow::Break(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        match self.phase {
            Phase::Observing(judge_at) => {
                // A verdict that is reviewed is reviewed at its time.
                let limit = self.observer.poll_timeout();
                let limit = limit.filter(|_| !self.process.keep_watching);
                let limit = limit.map(|due| self.start + due);
                [judge_at, limit].into_iter().flatten().min()
            }
            Phase::Lingering(until) => Some(until),
            Phase::Over => None,
        }
    }
}

/// The time between the arrival of a message and a judgement, after one that took this time. A process that was stopped while it judged
/// goes on as soon as any other.
fn interval_after(judgement: Duration) -> Duration {
    let pause = judgement.saturating_mul(JUDGEMENTS_WAITED);
    pause.clamp(JUDGE_INTERVAL, REVIEW_INTERVAL)
}

impl Verifier<'_> {
    fn take_in(&mut self, message: &Message) {
        let now = self.start.elapsed();
        self.observer.handle(now, message);
        if let Some(trace) = self.trace {
            trace.write(message);
        }
        let recorder = self.recorder.as_mut();
        let entries = recorder.map(|recorder| recorder.record(now, message));
        for entry in entries.into_iter().flatten() {
            (self.notify)(News::Entry(&entry));
        }
    }

    /// Judges what was received, and reports what is new.
    fn judge(&mut self) -> Phase {
        let began = Instant::now();
        if let Some(trace) = self.trace {
            trace.flush();
        }
        let progress = self.observer.progress();
        if self.progress.as_ref() != Some(&progress) {
            (self.notify)(News::Progress(&progress));
            self.progress = Some(progress);
        }
        let end = self.find_end();
        if let Some(end) = &end {
            (self.notify)(News::End(end));
        }
        if let Some(End::Judged(verdict)) = &end {
            let mut sample = formation_msgs::Verdict::from(verdict).in_session(self.session);
            sample.header = stamp::header("");
            self.verdicts.publish(sample);
        }
        let now = Instant::now();
        self.judge_interval = interval_after(now.saturating_duration_since(began));
        let next = match &end {
            _ if self.process.keep_watching => Phase::Observing(Some(now + REVIEW_INTERVAL)),
            None => Phase::Observing(None),
            Some(End::Judged(_)) => Phase::Lingering(now + self.process.linger),
            Some(End::Agreed(_)) => Phase::Over,
        };
        self.end = end.or(self.end.take());
        next
    }

    fn find_end(&mut self) -> Option<End> {
        if self.process.plan_only
            && let Some(agreement) = self.observer.agreement()
        {
            return Some(End::Agreed(agreement));
        }
        let now = self.start.elapsed();
        let verdict = if self.process.keep_watching {
            self.observer.review(now)
        } else {
            self.observer.verdict(now)
        };
        verdict.map(|verdict| End::Judged(verdict.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judgements_take_a_tenth_of_the_time_and_wait_no_longer_than_a_review() {
        let millis = Duration::from_millis;
        assert_eq!(interval_after(millis(1)), JUDGE_INTERVAL);
        assert_eq!(interval_after(millis(80)), millis(720));
        assert_eq!(interval_after(Duration::MAX), REVIEW_INTERVAL);
    }
}
