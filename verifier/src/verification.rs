//! The loop of the process that judges the formation.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::event_log::{Entry, POSE_INTERVAL, Recorder};
use formation::verify::{Agreement, Observer, ObserverParameters, Progress, Verdict};
use formation_msgs::{Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration};
use ros2_client::Publisher;

use crate::judging::{judging_declarations, judging_parameters};
use formation_node::inlet::{Delivery, deliveries, source_id};
use formation_node::source_guard::SourceGuard;
use formation_node::stamp;
use formation_node::topics;
use ros_runtime::diagnostics::traffic_report;
use ros_runtime::facilities::{Arrival, Facilities, FacilityInlets, arrivals};
use ros_runtime::inbox::{Inbox, Wake};
use ros_runtime::inlet::Inlet;
use ros_runtime::outlet::Outlet;
use ros_runtime::parameters::Values;
use ros_runtime::session::{Session, SessionError};
use ros_runtime::settings::Settings;
use ros_runtime::traffic::{RefusalKind, Traffic};

const NODE_NAME: &str = "verifier";

/// However much comes in, the state of things is judged at most this often.
const JUDGE_INTERVAL: Duration = Duration::from_millis(50);

/// Looks this often whether somebody fell silent, and whether it can still hear itself.
const REVIEW_INTERVAL: Duration = Duration::from_secs(1);

/// After so many samples the loop turns to judging.
const SAMPLES_PER_TURN: usize = 256;

/// A process that watches a formation and judges it, from what is on the topics alone.
#[derive(Clone, Debug)]
pub struct VerifierProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// How it judges.
    pub parameters: ObserverParameters,
    /// Whether it is content as soon as all members agree on a plan, and does not wait for them to move.
    pub plan_only: bool,
    /// Whether to tell of everything that happens, and not only how far the formation has come.
    pub event_log: bool,
    /// Whether it stays after the first verdict, and gives another whenever things change, until it is told to end.
    pub keep_watching: bool,
    /// After the verdict, the process stays so long, so that subscribers can take it.
    pub linger: Duration,
}

impl VerifierProcess {
    /// Watches until there is an end, publishes the verdict, if that is what there is, and leaves the graph.
    ///
    /// `told` hears of progress whenever it changes, of what happens if that is asked for, and of the end as soon as
    /// there is one; of each that takes the place of an earlier one, if the process keeps watching.
    ///
    /// When the DDS library stops listening, it begins anew with what is still to be heard.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(
        self,
        stop: &Receiver<()>,
        mut told: impl FnMut(News<'_>),
    ) -> Result<Judgement, SessionError> {
        loop {
            match self.judge(stop, &mut told) {
                Err(deaf @ SessionError::Deaf) => tracing::warn!("{deaf}; joining anew"),
                end => return end,
            }
        }
    }

    fn judge(
        &self,
        stop: &Receiver<()>,
        told: &mut impl FnMut(News<'_>),
    ) -> Result<Judgement, SessionError> {
        let declarations = judging_declarations(&self.parameters);
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        let judging = judging_parameters(parameters.values(), self.parameters.clone())?;
        let mut session = Session::open(&self.settings, NODE_NAME, parameters)?;
        let inlets = Inlets {
            target: Inlet::open(&mut session, &topics::TARGET)?,
            states: Inlet::open(&mut session, &topics::MODULE_STATES)?,
            roster: Inlet::open(&mut session, &topics::ROSTER)?,
            claims: Inlet::open(&mut session, &topics::claims(1))?,
            heartbeats: Inlet::open(&mut session, &topics::HEARTBEATS)?,
            facilities: FacilityInlets::open(&self.settings, &mut session)?,
        };
        let facilities = Facilities::open(&self.settings, &mut session)?;
        // Made at the start, so that subscribers are matched by the time there is something to say.
        let outlet = Outlet::open(&mut session, &topics::VERDICT)?;
        let samples = [
            deliveries(&inlets.target),
            deliveries(&inlets.states),
            deliveries(&inlets.roster),
            deliveries(&inlets.claims),
            deliveries(&inlets.heartbeats),
        ];
        let inbox = Inbox::new(arrivals(samples, &inlets.facilities), stop.clone());
        let mut watch = Watch {
            start: Instant::now(),
            observer: Observer::new(judging),
            plan_only: self.plan_only,
            recorder: self.event_log.then(|| Recorder::new(POSE_INTERVAL)),
            keep_watching: self.keep_watching,
            inbox,
            inlets: &inlets.facilities,
            outlet,
            facilities,
            session: &mut session,
            source_guard: SourceGuard::default(),
            traffic: Traffic::default(),
        };
        let end = async_io::block_on(async {
            let end = watch.until_the_end(told).await?;
            // One that kept watching has been told to end.
            if let Some(End::Judged(_)) = &end
                && !self.keep_watching
            {
                watch.linger(self.linger).await;
            }
            Ok::<_, SessionError>(end)
        })?;
        let traffic = watch.traffic;
        tracing::info!("traffic: {traffic}");
        Ok(Judgement { end, traffic })
    }
}

/// How watching ended.
#[derive(Clone, Debug)]
pub enum End {
    /// With a verdict on the formation; the last, if the process kept watching.
    Judged(Verdict),
    /// With a plan that all members agree on, where no more was asked for.
    Agreed(Agreement),
}

/// What came of watching.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// How it ended; `None` when the process was told to end before.
    pub end: Option<End>,
    /// What was heard, and what was refused.
    pub traffic: Traffic,
}

/// What a verifier has to tell.
#[derive(Clone, Copy, Debug)]
pub enum News<'a> {
    /// How far the formation has come, when it changed.
    Progress(&'a Progress),
    /// Something that happened.
    Entry(&'a Entry),
    /// How it ended.
    End(&'a End),
}

struct Inlets {
    target: Inlet<TargetConfiguration>,
    states: Inlet<ModuleStates>,
    roster: Inlet<Roster>,
    claims: Inlet<SpotClaim>,
    heartbeats: Inlet<Heartbeat>,
    facilities: FacilityInlets,
}

struct Watch<'a> {
    start: Instant,
    observer: Observer,
    plan_only: bool,
    /// Where everything that happens is to be told.
    recorder: Option<Recorder>,
    keep_watching: bool,
    inbox: Inbox<'a, Arrival<Delivery>>,
    inlets: &'a FacilityInlets,
    outlet: Outlet<formation_msgs::Verdict, Publisher<formation_msgs::Verdict>>,
    facilities: Facilities,
    session: &'a mut Session,
    source_guard: SourceGuard,
    traffic: Traffic,
}

impl Watch<'_> {
    async fn until_the_end(
        &mut self,
        told: &mut impl FnMut(News<'_>),
    ) -> Result<Option<End>, SessionError> {
        let mut shown = None;
        let mut last = None;
        // When to judge next, if anything came in since.
        let mut judge_at = Some(Instant::now());
        loop {
            if judge_at.is_some_and(|at| at <= Instant::now()) || self.is_overdue() {
                judge_at = None;
                let progress = self.observer.progress();
                if shown.as_ref() != Some(&progress) {
                    told(News::Progress(&progress));
                    shown = Some(progress);
                }
                if let Some(end) = self.end() {
                    told(News::End(&end));
                    if let End::Judged(verdict) = &end {
                        self.publish(verdict);
                    }
                    if !self.keep_watching {
                        return Ok(Some(end));
                    }
                    last = Some(end);
                }
                if self.keep_watching {
                    judge_at = Some(Instant::now() + REVIEW_INTERVAL);
                }
            }
            self.outlet.flush(&mut self.traffic);
            self.session.check_hearing()?;
            self.report()?;
            let timeout = self.observer.poll_timeout().map(|due| self.start + due);
            let look_at = Some(Instant::now() + REVIEW_INTERVAL);
            let due = [judge_at, timeout, look_at, self.facilities.due()]
                .into_iter()
                .flatten()
                .min();
            match self.inbox.wait(due).await {
                Wake::Stop => return Ok(last),
                Wake::Due => {}
                Wake::Arrival(arrival) => {
                    let mut next = Some(arrival);
                    for _ in 0..SAMPLES_PER_TURN {
                        let Some(arrival) = next else { break };
                        if self.take_in(arrival, told) {
                            let soon = Instant::now() + JUDGE_INTERVAL;
                            judge_at = Some(judge_at.map_or(soon, |at| at.min(soon)));
                        }
                        next = self.inbox.ready();
                    }
                }
            }
        }
    }

    /// Takes something in; returns whether there is something new to judge.
    fn take_in(&mut self, arrival: Arrival<Delivery>, told: &mut impl FnMut(News<'_>)) -> bool {
        let delivery = match arrival {
            Arrival::Sample(delivery) => delivery,
            Arrival::Facility(arrival) => {
                // How a formation is judged is settled when watching begins.
                let apply = &mut |_: &Values| Ok(());
                self.facilities.attend(
                    self.inlets,
                    arrival,
                    self.session,
                    &mut self.traffic,
                    apply,
                );
                return false;
            }
        };
        let topic = delivery.topic();
        let Some((source, messages)) =
            delivery.accept(source_id(self.session.source()), &mut self.traffic)
        else {
            return false;
        };
        let now = self.start.elapsed();
        for message in &messages {
            if !self.source_guard.admit(source, message) {
                let reason = "another process speaks for that module";
                self.traffic
                    .refuse(topic, RefusalKind::Misattributed, &reason);
                continue;
            }
            self.observer.handle(now, message);
            if let Some(recorder) = &mut self.recorder {
                for entry in recorder.record(now, message) {
                    told(News::Entry(&entry));
                }
            }
        }
        true
    }

    fn report(&mut self) -> Result<(), SessionError> {
        self.facilities
            .report(self.session, &mut self.traffic, |traffic| {
                vec![traffic_report(traffic)]
            })
    }

    fn end(&mut self) -> Option<End> {
        if self.plan_only
            && let Some(agreement) = self.observer.agreement()
        {
            return Some(End::Agreed(agreement));
        }
        let now = self.start.elapsed();
        let verdict = if self.keep_watching {
            self.observer.review(now)
        } else {
            self.observer.verdict(now)
        }?;
        Some(End::Judged(verdict.clone()))
    }

    fn is_overdue(&self) -> bool {
        self.observer
            .poll_timeout()
            .is_some_and(|due| due <= self.start.elapsed())
    }

    fn publish(&mut self, verdict: &Verdict) {
        let mut sample = formation_msgs::Verdict::from(verdict);
        sample.header = stamp::header("");
        self.outlet.publish(sample, &mut self.traffic);
    }

    /// Stays for a while, so that subscribers can take what was published, unless the process is to end.
    async fn linger(&mut self, linger: Duration) {
        let end = Instant::now() + linger;
        while Instant::now() < end {
            if let Wake::Stop = self.inbox.wait(Some(end)).await {
                return;
            }
            self.outlet.flush(&mut self.traffic);
        }
    }
}
