//! The process that announces the target, and answers for it.

mod desk;
mod register;
mod services;

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::MODULES_MAX;
use formation::message::TargetAnnouncement;
use formation_msgs::TargetConfiguration;
use ros2_client::{ParameterValue, Publisher};

use crate::diagnostics::traffic_report;
use crate::facilities::{Facilities, FacilityInlets};
use crate::inbox::{Inbox, Wake};
use crate::outlet::Outlet;
use crate::parameters::{Change, Declaration, NodeWide, ParameterError, Range, Values};
use crate::session::{Session, SessionError};
use crate::settings::Settings;
use crate::stamp;
use crate::topics;
use crate::traffic::Traffic;

use desk::{Arrival, Desk};
use register::Register;
use services::Question;

const RETRY_AFTER: Duration = Duration::from_millis(20);

/// With nothing else to do, it looks this often whether the DDS library still works.
const HEARING_INTERVAL: Duration = Duration::from_secs(1);

/// After so many samples the loop turns to what they led to.
const SAMPLES_PER_TURN: usize = 256;

/// A process that announces a target, and keeps it for whoever comes late.
#[derive(Clone, Debug)]
pub struct TargetProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What it announces.
    pub announcement: TargetAnnouncement,
}

impl TargetProcess {
    /// Announces the target, and what services ask for, until `stop` yields, then leaves the graph.
    ///
    /// When the DDS library stops listening, it joins anew and announces what it announced last.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let start = Instant::now();
        let mut register = Register::new();
        loop {
            match self.announce(start, &mut register, stop) {
                Err(deaf @ SessionError::Deaf) => tracing::warn!("{deaf}; joining anew"),
                end => return end,
            }
        }
    }

    fn announce(
        &self,
        start: Instant,
        register: &mut Register,
        stop: &Receiver<()>,
    ) -> Result<(), SessionError> {
        let declarations = announcer_declarations(self.announcement.expected_modules);
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        if register.own().is_none() {
            let announcement = TargetAnnouncement {
                expected_modules: expected_modules(parameters.values())?,
                ..self.announcement.clone()
            };
            register.announce(start.elapsed(), announcement);
        }
        let mut session = Session::open(&self.settings, NODE_NAME, parameters)?;
        let inlets = FacilityInlets::open(&self.settings, &mut session)?;
        let facilities = Facilities::open(&self.settings, &mut session)?;
        let outlet = Outlet::open(&mut session, &topics::TARGET)?;
        // Where the node answers no tools it answers nobody, as discovery grows with the number of endpoints.
        let serves = NodeWide::of(session.parameters().values())?.parameter_services;
        let desk = serves.then(|| Desk::open(&mut session)).transpose()?;
        let mut announcer = Announcer {
            start,
            register,
            announced: None,
            inlets: &inlets,
            desk: desk.as_ref(),
            outlet,
            facilities,
            session: &mut session,
            traffic: Traffic::default(),
        };
        async_io::block_on(announcer.turn_until_stopped(stop))
    }
}

struct Announcer<'a> {
    start: Instant,
    register: &'a mut Register,
    /// The revision that was published last.
    announced: Option<u64>,
    inlets: &'a FacilityInlets,
    desk: Option<&'a Desk>,
    outlet: Outlet<TargetConfiguration, Publisher<TargetConfiguration>>,
    facilities: Facilities,
    session: &'a mut Session,
    traffic: Traffic,
}

impl Announcer<'_> {
    async fn turn_until_stopped(&mut self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let mut inbox = Inbox::new(desk::arrivals(self.inlets, self.desk), stop.clone());
        loop {
            self.publish();
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
        let wait = if self.outlet.is_waiting() {
            RETRY_AFTER
        } else {
            HEARING_INTERVAL
        };
        [Some(Instant::now() + wait), self.facilities.due()]
            .into_iter()
            .flatten()
            .min()
    }

    fn take_in(&mut self, arrival: Arrival) {
        match arrival {
            Arrival::Facility(arrival) => {
                // Nothing of what is announced changes at run time.
                let apply = &mut |_: &Values| Ok(());
                let (session, traffic) = (&mut *self.session, &mut self.traffic);
                self.facilities
                    .attend(self.inlets, arrival, session, traffic, apply);
            }
            Arrival::Sample(delivery) => {
                let heard = delivery.accept(self.session.source(), &mut self.traffic);
                let now = self.start.elapsed();
                for message in heard.into_iter().flat_map(|(_, messages)| messages) {
                    self.register.hear(now, &message);
                }
            }
            Arrival::Question(question) => self.answer(&question),
        }
    }

    fn answer(&mut self, question: &Question) {
        let Some(desk) = self.desk else { return };
        match *question {
            Question::Status(id, request) => {
                let response = self.register.status(request);
                desk.services.answer_status(id, response);
            }
            Question::Withdraw(id, request) => {
                let now = self.start.elapsed();
                let response = self.register.withdraw(now, stamp::revision(), request);
                // What is answered must be true by then.
                self.publish();
                desk.services.answer_withdrawal(id, response);
            }
        }
    }

    /// Publishes what the process has to announce, if it did not yet.
    fn publish(&mut self) {
        self.outlet.flush(&mut self.traffic);
        let Some(own) = self.register.own() else {
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

    fn report(&mut self) -> Result<(), SessionError> {
        self.facilities
            .report(self.session, &mut self.traffic, |traffic| {
                vec![traffic_report(traffic)]
            })
    }
}

const NODE_NAME: &str = "target_publisher";
const EXPECTED_MODULES: &str = "expected_modules";

/// Declares what can be tuned of an announcement.
pub(crate) fn announcer_declarations(expected_modules: Option<u32>) -> Vec<Declaration> {
    vec![Declaration {
        name: EXPECTED_MODULES,
        description: "How many modules take part; 0 if that is not known, and gathering ends when nothing new comes",
        value: ParameterValue::Integer(expected_modules.unwrap_or_default().into()),
        range: Range::Integer {
            from: 0,
            to: i64::try_from(MODULES_MAX).unwrap_or(i64::MAX),
        },
        change: Change::AtStart("it belongs to the target that was announced with it"),
    }]
}

fn expected_modules(values: &Values) -> Result<Option<u32>, ParameterError> {
    let count = values.integer(EXPECTED_MODULES)?;
    Ok(u32::try_from(count).ok().filter(|&count| count > 0))
}
