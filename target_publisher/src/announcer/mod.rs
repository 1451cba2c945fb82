//! The process that announces the target, and answers for it.

mod conduct;
mod desk;
mod register;
mod services;
mod tunables;
mod wishes;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::model::TargetAnnouncement;
use formation_msgs::{FormConfigurationGoal, TargetConfiguration, WithdrawTargetResponse, bounds};
use ros2_client::Publisher;
use ros2_client::builtin_interfaces::Time;

use formation_node::inlet::source_id;
use formation_node::stamp;
use formation_node::topics;
use ros_runtime::action::{ActionOutlets, ActionRequest};
use ros_runtime::diagnostics::traffic_report;
use ros_runtime::facilities::{Facilities, FacilityInlets};
use ros_runtime::inbox::{Inbox, Wake};
use ros_runtime::outlet::Outlet;
use ros_runtime::parameters::{NodeWide, Values};
use ros_runtime::service::RequestId;
use ros_runtime::session::{Session, SessionError};
use ros_runtime::settings::Settings;
use ros_runtime::traffic::Traffic;

use conduct::{Conduct, Limits};
use desk::{Arrival, Desk, FormConfiguration};
use services::Question;
use wishes::Wishes;

const NODE_NAME: &str = "target_publisher";

const RETRY_AFTER: Duration = Duration::from_millis(20);

/// With nothing else to do, it looks this often whether the DDS library still works.
const HEARING_INTERVAL: Duration = Duration::from_secs(1);

/// After so many samples the loop turns to what they led to.
const SAMPLES_PER_TURN: usize = 256;

/// A process that announces a target, keeps it for whoever comes late, and announces what others ask for.
#[derive(Clone, Debug)]
pub struct TargetProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What it announces at its start, if anything.
    pub announcement: Option<TargetAnnouncement>,
    /// How many modules take part, unless a parameter says otherwise.
    pub expected_modules: Option<u32>,
    /// The folder of the scenarios that others can name, unless a parameter says otherwise.
    pub scenario_folder: Option<PathBuf>,
}

impl TargetProcess {
    /// Announces the target, and what others ask for, until `stop` yields, then leaves the graph.
    ///
    /// When the DDS library stops listening, it joins anew, announces what it announced last, and pursues its goal
    /// further.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let start = Instant::now();
        let mut conduct = Conduct::new();
        loop {
            match self.announce(start, &mut conduct, stop) {
                Err(deaf @ SessionError::Deaf) => tracing::warn!("{deaf}; joining anew"),
                end => return end,
            }
        }
    }

    fn announce(
        &self,
        start: Instant,
        conduct: &mut Conduct<RequestId>,
        stop: &Receiver<()>,
    ) -> Result<(), SessionError> {
        let declarations = tunables::declarations(&Wishes {
            folder: self.scenario_folder.clone(),
            expected_modules: self.expected_modules,
        });
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        let wishes = tunables::wishes(parameters.values())?;
        let limits = tunables::limits(parameters.values())?;
        if let Some(announcement) = &self.announcement
            && conduct.register.own().is_none()
        {
            let announcement = TargetAnnouncement {
                expected_modules: wishes.expected_modules,
                ..announcement.clone()
            };
            conduct.register.announce(start.elapsed(), announcement);
        }
        let mut session = Session::open(&self.settings, NODE_NAME, parameters)?;
        let inlets = FacilityInlets::open(&self.settings, &mut session)?;
        let facilities = Facilities::open(&self.settings, &mut session)?;
        let outlet = Outlet::open(&mut session, &topics::TARGET)?;
        // Where the node answers no tools it answers nobody, as discovery grows with the number of endpoints.
        let serves = NodeWide::of(session.parameters().values())?.parameter_services;
        if !serves && self.announcement.is_none() {
            tracing::warn!(
                "announces nothing and serves no goals, as start_parameter_services is false"
            );
        }
        let desk = serves.then(|| Desk::open(&mut session)).transpose()?;
        conduct.renew_statuses();
        let mut announcer = Announcer {
            start,
            conduct,
            wishes,
            limits,
            announced: None,
            inlets: &inlets,
            desk: desk.as_ref(),
            outlet,
            action: desk.as_ref().map(|desk| desk.action.outlets()),
            facilities,
            session: &mut session,
            traffic: Traffic::default(),
        };
        async_io::block_on(announcer.turn_until_stopped(stop))
    }
}

struct Announcer<'a> {
    start: Instant,
    conduct: &'a mut Conduct<RequestId>,
    wishes: Wishes,
    limits: Limits,
    /// The revision that was published last.
    announced: Option<u64>,
    inlets: &'a FacilityInlets,
    desk: Option<&'a Desk>,
    outlet: Outlet<TargetConfiguration, Publisher<TargetConfiguration>>,
    action: Option<ActionOutlets<FormConfiguration>>,
    facilities: Facilities,
    session: &'a mut Session,
    traffic: Traffic,
}

impl Announcer<'_> {
    async fn turn_until_stopped(&mut self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let mut inbox = Inbox::new(desk::arrivals(self.inlets, self.desk), stop.clone());
        loop {
            self.conduct.advance(self.start.elapsed(), self.limits);
            self.publish();
            self.tell_of_goals();
            self.report()?;
            match inbox.wait(self.due()).await {
                Wake::Stop => return Ok(()),
                Wake::Due => {}
                Wake::Arrival(arrival) => {
                    self.take_in(arrival);
                    for arrival in std::iter::from_fn(|| inbox.ready()).take(SAMPLES_PER_TURN) {
                        self.take_in(arrival);
                    }
                }
            }
            self.session.check_hearing()?;
        }
    }

    fn due(&self) -> Option<Instant> {
        let is_waiting =
            self.outlet.is_waiting() || self.action.as_ref().is_some_and(ActionOutlets::is_waiting);
        let wait = if is_waiting {
            RETRY_AFTER
        } else {
            HEARING_INTERVAL
        };
        let goals = self.conduct.due(self.limits).map(|due| self.start + due);
        [Some(Instant::now() + wait), goals, self.facilities.due()]
            .into_iter()
            .flatten()
            .min()
    }

    fn take_in(&mut self, arrival: Arrival) {
        let now = self.start.elapsed();
        match arrival {
            Arrival::Facility(arrival) => {
                let limits = &mut self.limits;
                let apply = &mut |values: &Values| {
                    *limits = tunables::limits(values)?;
                    Ok(())
                };
                let (session, traffic) = (&mut *self.session, &mut self.traffic);
                self.facilities
                    .attend(self.inlets, arrival, session, traffic, apply);
            }
            Arrival::Sample(delivery) => {
                let heard = delivery.accept(source_id(self.session.source()), &mut self.traffic);
                for message in heard.into_iter().flat_map(|(_, messages)| messages) {
                    self.conduct.hear(now, &message);
                }
            }
            Arrival::Verdict(Ok(verdict)) => {
                self.traffic.on(topics::VERDICT.name()).received += 1;
                self.conduct.register.hear_verdict(now, verdict);
            }
            Arrival::Verdict(Err((kind, reason))) => {
                self.traffic.refuse(topics::VERDICT.name(), kind, &reason);
            }
            Arrival::Question(question) => self.answer(&question),
            Arrival::Action(request) => self.attend(request),
        }
    }

    fn answer(&mut self, question: &Question) {
        let Some(desk) = self.desk else { return };
        match *question {
            Question::QueryStatus(id, request) => {
                let response = self.conduct.register.status(request);
                desk.services.query_status.answer(id, response);
            }
            Question::WithdrawTarget(id, request) => {
                let now = self.start.elapsed();
                let register = &mut self.conduct.register;
                let outcome = register.withdraw(now, stamp::revision(), request.revision);
                // What is answered must be true by then.
                self.publish();
                let response = WithdrawTargetResponse {
                    success: outcome.is_ok(),
                    message: answer(outcome.unwrap_or_else(|reason| reason)),
                };
                desk.services.withdraw_target.answer(id, response);
            }
        }
    }

    /// Does what a client of the action wants.
    fn attend(&mut self, request: ActionRequest<FormConfigurationGoal>) {
        let Some(desk) = self.desk else { return };
        let now = self.start.elapsed();
        match request {
            ActionRequest::SendGoal(id, goal, content) => {
                let wanted = self.wishes.resolve(content);
                let (stamp, fresh) = (Time::now(), stamp::revision());
                let accepted = self.conduct.begin(now, stamp, goal, fresh, wanted);
                desk.action.answer_goal(id, accepted, stamp);
            }
            ActionRequest::CancelGoal(id, meant) => {
                let response = self.conduct.cancel(now, stamp::revision(), &meant);
                // A goal that came in at the same time must not take its place unseen: modules would not plan anew.
                self.publish();
                desk.action.answer_cancellation(id, response);
            }
            ActionRequest::GetResult(id, goal) => self.conduct.ask(goal, id),
        }
    }

    /// Publishes what the process has to announce, if it did not yet.
    fn publish(&mut self) {
        self.outlet.flush(&mut self.traffic);
        let Some(own) = self.conduct.register.own() else {
            return;
        };
        if self.announced == Some(own.revision) {
            return;
        }
        self.announced = Some(own.revision);
        let mut sample = TargetConfiguration::from(own.as_ref());
        sample.header.stamp = stamp::header("").stamp;
        self.outlet.publish(sample, &mut self.traffic);
        match &own.target {
            Some(target) => tracing::info!(
                revision = own.revision,
                name = own.name,
                spots = target.spots().len(),
                "announced the target"
            ),
            None => tracing::info!(
                revision = own.revision,
                name = own.name,
                "withdrew the target"
            ),
        }
    }

    /// Tells clients of the action how their goals fare, and what came of them.
    fn tell_of_goals(&mut self) {
        let (Some(desk), Some(action)) = (self.desk, &mut self.action) else {
            return;
        };
        action.flush(&mut self.traffic);
        if let Some((goal, feedback)) = self.conduct.take_feedback(self.start.elapsed()) {
            action.tell(goal, feedback, &mut self.traffic);
        }
        if let Some(statuses) = self.conduct.take_statuses() {
            action.tell_statuses(statuses, &mut self.traffic);
        }
        for (id, status, result) in self.conduct.take_answers() {
            desk.action.answer_result(id, status, result);
        }
    }

    fn report(&mut self) -> Result<(), SessionError> {
        self.facilities
            .report(self.session, &mut self.traffic, |traffic| {
                vec![traffic_report(traffic)]
            })
    }
}

/// What somebody is told in answer, as far as it fits.
fn answer(message: String) -> String {
    bounds::shortened(message, bounds::ANSWER_BYTES_MAX)
}
