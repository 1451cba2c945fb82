//! The loop of the process that draws a formation for RViz, Foxglove and their like.

mod markers;
mod scene;
mod transforms;

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::message::Message;
use formation_msgs::foreign::tf2_msgs::TFMessage;
use formation_msgs::foreign::visualization_msgs::MarkerArray;
use formation_msgs::{Heartbeat, ModuleStates, SpotClaim, TargetConfiguration};
use ros2_client::Publisher;

use crate::inbox::{Inbox, Wake};
use crate::inlet::{Delivery, Inlet};
use crate::outlet::Outlet;
use crate::session::{Session, SessionError};
use crate::settings::Settings;
use crate::stamp;
use crate::topics;
use crate::traffic::Traffic;
use scene::Scene;

/// Even when nothing changes, transforms are sent this often: listeners forget old ones.
const TRANSFORM_INTERVAL: Duration = Duration::from_secs(1);

/// After so many samples the loop turns to drawing.
const SAMPLES_PER_TURN: usize = 256;

/// What a picture shows, and how often it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisualisationParameters {
    /// The least time between two pictures.
    pub interval: Duration,
    /// A module that was not heard for so long is drawn grey.
    pub suspicion: Duration,
    /// Whether modules and spots carry their numbers.
    pub labels: bool,
}

/// A process that draws what is on the topics.
#[derive(Clone, Debug)]
pub struct VisualiserProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What it shows, and how often.
    pub parameters: VisualisationParameters,
}

impl VisualiserProcess {
    /// Draws until `stop` yields, then leaves the graph.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined.
    pub fn run(self, stop: Receiver<()>) -> Result<(), SessionError> {
        let mut session = Session::open(&self.settings, "visualiser")?;
        let target: Inlet<TargetConfiguration> = Inlet::open(&mut session, &topics::TARGET)?;
        let states: Inlet<ModuleStates> = Inlet::open(&mut session, &topics::MODULE_STATES)?;
        let claims: Inlet<SpotClaim> = Inlet::open(&mut session, &topics::claims(1))?;
        let heartbeats: Inlet<Heartbeat> = Inlet::open(&mut session, &topics::HEARTBEATS)?;
        let inbox = Inbox::new(
            [
                target.deliveries(),
                states.deliveries(),
                claims.deliveries(),
                heartbeats.deliveries(),
            ],
            stop,
        );
        let mut easel = Easel {
            start: Instant::now(),
            markers: Outlet::open(&mut session, &topics::MARKERS)?,
            transforms: Outlet::open(&mut session, &topics::TRANSFORMS)?,
            fixed_transforms: Outlet::open(&mut session, &topics::FIXED_TRANSFORMS)?,
            session: &session,
            parameters: self.parameters,
            scene: Scene::new(self.parameters.suspicion),
            traffic: Traffic::default(),
            drawn: None,
            transformed: None,
        };
        async_io::block_on(easel.draw_until_stopped(inbox));
        tracing::info!("traffic: {}", easel.traffic);
        Ok(())
    }
}

struct Easel<'a> {
    start: Instant,
    markers: Outlet<MarkerArray, Publisher<MarkerArray>>,
    transforms: Outlet<TFMessage, Publisher<TFMessage>>,
    fixed_transforms: Outlet<TFMessage, Publisher<TFMessage>>,
    session: &'a Session,
    parameters: VisualisationParameters,
    scene: Scene,
    traffic: Traffic,
    /// When the last picture was drawn.
    drawn: Option<Instant>,
    /// When the modules' transforms were sent last.
    transformed: Option<Instant>,
}

impl Easel<'_> {
    async fn draw_until_stopped(&mut self, mut inbox: Inbox<'_, Delivery>) {
        loop {
            self.draw();
            match inbox.wait(Some(self.due())).await {
                Wake::Stop => return,
                Wake::Due => {}
                Wake::Arrival(delivery) => {
                    self.take_in(delivery);
                    for delivery in std::iter::from_fn(|| inbox.ready()).take(SAMPLES_PER_TURN) {
                        self.take_in(delivery);
                    }
                }
            }
        }
    }

    fn take_in(&mut self, delivery: Delivery) {
        let own = self.session.source();
        if let Some((_, messages)) = delivery.accept(own, &mut self.traffic) {
            let now = self.start.elapsed();
            for message in messages {
                self.hear(now, message);
            }
        }
    }

    fn hear(&mut self, now: Duration, message: Message) {
        let had = self.scene.target().cloned();
        self.scene.hear(now, message);
        if let Some(target) = self.scene.target()
            && had.as_ref() != Some(target)
        {
            let sample = transforms::of_spots(target, &stamp::header(self.scene.frame_id()));
            self.fixed_transforms.publish(sample, &mut self.traffic);
        }
    }

    fn draw(&mut self) {
        let now = Instant::now();
        self.scene.advance(self.start.elapsed());
        let is_due =
            |last: Option<Instant>, interval| last.is_none_or(|last| now >= last + interval);
        let changed = self.scene.has_changed() && is_due(self.drawn, self.parameters.interval);
        if changed {
            let header = stamp::header(self.scene.frame_id());
            let sample = markers::of(&self.scene, &header, self.parameters.labels);
            self.markers.publish(sample, &mut self.traffic);
            self.scene.was_drawn();
            self.drawn = Some(now);
        }
        if changed || is_due(self.transformed, TRANSFORM_INTERVAL) {
            let header = stamp::header(self.scene.frame_id());
            let sample = transforms::of_modules(&self.scene, &header);
            if !sample.transforms.is_empty() {
                self.transforms.publish(sample, &mut self.traffic);
            }
            self.transformed = Some(now);
        }
        self.markers.flush(&mut self.traffic);
        self.transforms.flush(&mut self.traffic);
        self.fixed_transforms.flush(&mut self.traffic);
    }

    fn due(&self) -> Instant {
        Instant::now() + self.parameters.interval.min(TRANSFORM_INTERVAL)
    }
}
