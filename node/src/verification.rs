//! The loop of the process that judges the formation.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::chronicle::{Chronicler, Entry};
use formation::verify::{Agreement, Observer, ObserverParameters, Progress, Verdict};
use formation_msgs::{Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration};
use ros2_client::Publisher;

use crate::inbox::{Inbox, Wake};
use crate::inlet::{Delivery, Inlet};
use crate::outlet::Outlet;
use crate::session::{Session, SessionError};
use crate::settings::Settings;
use crate::stamp;
use crate::topics;
use crate::traffic::Traffic;

/// However much comes in, the state of things is judged at most this often.
const JUDGE_INTERVAL: Duration = Duration::from_millis(50);

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
    pub chronicle: bool,
    /// After the verdict, the process stays so long, so that subscribers can take it.
    pub linger: Duration,
}

impl VerifierProcess {
    /// Watches until there is an end, publishes the verdict, if that is what there is, and leaves the graph.
    ///
    /// `told` hears of progress whenever it changes, of what happens if that is asked for, and of the end as soon as
    /// there is one.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(
        self,
        stop: Receiver<()>,
        mut told: impl FnMut(News<'_>),
    ) -> Result<Judgement, SessionError> {
        let mut session = Session::open(&self.settings, "verifier")?;
        let inlets = Inlets {
            target: Inlet::open(&mut session, &topics::TARGET)?,
            states: Inlet::open(&mut session, &topics::MODULE_STATES)?,
            roster: Inlet::open(&mut session, &topics::ROSTER)?,
            claims: Inlet::open(&mut session, &topics::claims(1))?,
            heartbeats: Inlet::open(&mut session, &topics::HEARTBEATS)?,
        };
        // Made at the start, so that subscribers are matched by the time there is something to say.
        let outlet = Outlet::open(&mut session, &topics::VERDICT)?;
        let inbox = Inbox::new(
            [
                inlets.target.deliveries(),
                inlets.states.deliveries(),
                inlets.roster.deliveries(),
                inlets.claims.deliveries(),
                inlets.heartbeats.deliveries(),
            ],
            stop,
        );
        let mut watch = Watch {
            start: Instant::now(),
            observer: Observer::new(self.parameters),
            plan_only: self.plan_only,
            chronicler: self.chronicle.then(Chronicler::default),
            inbox,
            outlet,
            session: &session,
            traffic: Traffic::default(),
        };
        let end = async_io::block_on(async {
            let end = watch.until_the_end(&mut told).await;
            if let Some(end) = &end {
                told(News::End(end));
            }
            if let Some(End::Judged(verdict)) = &end {
                watch.publish(verdict, self.linger).await;
            }
            end
        });
        let traffic = watch.traffic;
        tracing::info!("traffic: {traffic}");
        Ok(Judgement { end, traffic })
    }
}

/// How watching ended.
#[derive(Clone, Debug)]
pub enum End {
    /// With a verdict on the formation.
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
}

struct Watch<'a> {
    start: Instant,
    observer: Observer,
    plan_only: bool,
    /// Where everything that happens is to be told.
    chronicler: Option<Chronicler>,
    inbox: Inbox<'a, Delivery>,
    outlet: Outlet<formation_msgs::Verdict, Publisher<formation_msgs::Verdict>>,
    session: &'a Session,
    traffic: Traffic,
}

impl Watch<'_> {
    async fn until_the_end(&mut self, told: &mut impl FnMut(News<'_>)) -> Option<End> {
        let mut shown = None;
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
                    return Some(end);
                }
            }
            let timeout = self.observer.poll_timeout().map(|due| self.start + due);
            let due = [judge_at, timeout].into_iter().flatten().min();
            match self.inbox.wait(due).await {
                Wake::Stop => return None,
                Wake::Due => {}
                Wake::Arrival(delivery) => {
                    let mut next = Some(delivery);
                    for _ in 0..SAMPLES_PER_TURN {
                        let Some(delivery) = next else { break };
                        if let Some((_, messages)) =
                            delivery.accept(self.session.source(), &mut self.traffic)
                        {
                            let now = self.start.elapsed();
                            for message in &messages {
                                self.observer.handle(now, message);
                                if let Some(chronicler) = &mut self.chronicler {
                                    for entry in chronicler.hear(now, message) {
                                        told(News::Entry(&entry));
                                    }
                                }
                            }
                            judge_at.get_or_insert_with(|| Instant::now() + JUDGE_INTERVAL);
                        }
                        next = self.inbox.ready();
                    }
                }
            }
        }
    }

    fn end(&mut self) -> Option<End> {
        if self.plan_only
            && let Some(agreement) = self.observer.agreement()
        {
            return Some(End::Agreed(agreement));
        }
        let verdict = self.observer.verdict(self.start.elapsed())?;
        Some(End::Judged(verdict.clone()))
    }

    fn is_overdue(&self) -> bool {
        self.observer
            .poll_timeout()
            .is_some_and(|due| due <= self.start.elapsed())
    }

    /// Publishes the verdict and stays for a while, unless the process is to end.
    async fn publish(&mut self, verdict: &Verdict, linger: Duration) {
        let mut sample = formation_msgs::Verdict::from(verdict);
        sample.header = stamp::header("");
        self.outlet.publish(sample, &mut self.traffic);
        let end = Instant::now() + linger;
        while Instant::now() < end {
            if let Wake::Stop = self.inbox.wait(Some(end)).await {
                return;
            }
            self.outlet.flush(&mut self.traffic);
        }
    }
}
