//! The loop of the process that announces the target.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::MODULES_MAX;
use formation::message::TargetAnnouncement;
use formation_msgs::TargetConfiguration;
use ros2_client::ParameterValue;

use crate::diagnostics::traffic_report;
use crate::facilities::{Facilities, FacilityInlets};
use crate::parameters::{Change, Declaration, ParameterError, Range, Values};

use crate::inbox::{Inbox, Wake};
use crate::outlet::Outlet;
use crate::session::{Session, SessionError};
use crate::settings::Settings;
use crate::stamp;
use crate::topics;
use crate::traffic::Traffic;

const RETRY_AFTER: Duration = Duration::from_millis(20);

/// With nothing else to do, it looks this often whether the DDS library still works.
const HEARING_INTERVAL: Duration = Duration::from_secs(1);

/// A process that announces a target, and keeps it for whoever comes late.
#[derive(Clone, Debug)]
pub struct TargetProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What it announces.
    pub announcement: TargetAnnouncement,
}

impl TargetProcess {
    /// Announces the target until `stop` yields, then leaves the graph.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(self, stop: &Receiver<()>) -> Result<(), SessionError> {
        loop {
            match self.announce(stop) {
                Err(deaf @ SessionError::Deaf) => tracing::warn!("{deaf}; joining anew"),
                end => return end,
            }
        }
    }

    fn announce(&self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let declarations = announcer_declarations(self.announcement.expected_modules);
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        let expected_modules = expected_modules(parameters.values())?;
        let mut session = Session::open(&self.settings, NODE_NAME, parameters)?;
        let inlets = FacilityInlets::open(&self.settings, &mut session)?;
        let mut facilities = Facilities::open(&self.settings, &mut session)?;
        let mut outlet = Outlet::open(&mut session, &topics::TARGET)?;
        let mut traffic = Traffic::default();
        let announcement = TargetAnnouncement {
            expected_modules,
            ..self.announcement.clone()
        };
        let mut sample = TargetConfiguration::from(&announcement);
        sample.header.stamp = stamp::header("").stamp;
        outlet.publish(sample, &mut traffic);
        tracing::info!(
            revision = announcement.revision,
            name = announcement.name,
            spots = announcement
                .target
                .as_ref()
                .map_or(0, |target| target.spots().len()),
            "announced the target"
        );
        let mut inbox = Inbox::new(inlets.arrivals(), stop.clone());
        async_io::block_on(async {
            loop {
                outlet.flush(&mut traffic);
                facilities.report(&mut session, &mut traffic, |traffic| {
                    vec![traffic_report(traffic)]
                })?;
                let wait = if outlet.is_waiting() {
                    RETRY_AFTER
                } else {
                    HEARING_INTERVAL
                };
                let due = [Some(Instant::now() + wait), facilities.due()]
                    .into_iter()
                    .flatten()
                    .min();
                match inbox.wait(due).await {
                    Wake::Stop => return Ok(()),
                    Wake::Due => {}
                    Wake::Arrival(arrival) => {
                        // Nothing of what is announced changes at run time.
                        let apply = &mut |_: &Values| Ok(());
                        facilities.attend(&inlets, arrival, &mut session, &mut traffic, apply);
                    }
                }
                session.check_hearing()?;
            }
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
