//! The loop of the process that announces the target.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::message::TargetAnnouncement;
use formation_msgs::TargetConfiguration;

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
        let mut session = Session::open(&self.settings, "target_publisher")?;
        let mut outlet = Outlet::open(&mut session, &topics::TARGET)?;
        let mut traffic = Traffic::default();
        let mut sample = TargetConfiguration::from(&self.announcement);
        sample.header.stamp = stamp::header("").stamp;
        outlet.publish(sample, &mut traffic);
        tracing::info!(
            revision = self.announcement.revision,
            name = self.announcement.name,
            spots = self
                .announcement
                .target
                .as_ref()
                .map_or(0, |target| target.spots().len()),
            "announced the target"
        );
        let mut inbox = Inbox::<std::convert::Infallible>::new([], stop.clone());
        async_io::block_on(async {
            loop {
                let wait = if outlet.is_waiting() {
                    RETRY_AFTER
                } else {
                    HEARING_INTERVAL
                };
                match inbox.wait(Some(Instant::now() + wait)).await {
                    Wake::Stop => return Ok(()),
                    Wake::Due | Wake::Arrival(_) => outlet.flush(&mut traffic),
                }
                session.check_hearing()?;
            }
        })
    }
}
