//! The loop of the process that draws a formation for RViz, Foxglove and their like.

mod markers;
mod scene;
mod transforms;

use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::model::Message;
use formation_msgs::foreign::tf2_msgs::TFMessage;
use formation_msgs::foreign::visualization_msgs::MarkerArray;
use formation_msgs::{Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration};
use ros2_client::{ParameterValue, Publisher};

use formation_node::inlet::{Delivery, deliveries, source_id};
use formation_node::stamp;
use formation_node::topics;
use ros_runtime::arguments::SECONDS;
use ros_runtime::diagnostics::traffic_report;
use ros_runtime::facilities::{Arrival, Facilities, FacilityInlets, arrivals};
use ros_runtime::inbox::{Inbox, Wake};
use ros_runtime::inlet::Inlet;
use ros_runtime::outlet::Outlet;
use ros_runtime::parameters::{Change, Declaration, ParameterError, Range, Values};
use ros_runtime::session::{Session, SessionError};
use ros_runtime::settings::Settings;
use ros_runtime::traffic::Traffic;
use scene::DrawnScene;

/// Even when nothing changes, transforms are sent this often: listeners forget old ones.
const TRANSFORM_INTERVAL: Duration = Duration::from_secs(1);

/// After so many samples the loop turns to drawing.
const SAMPLES_PER_TURN: usize = 256;

const NODE_NAME: &str = "visualiser";

const RATE: &str = "rate";
const SUSPICION: &str = "suspicion_s";
const LABELS: &str = "labels";
/// The fewest pictures a second.
pub const RATE_MIN: f64 = 0.1;
/// The most pictures a second.
pub const RATE_MAX: f64 = 100.0;

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

impl Default for VisualisationParameters {
    fn default() -> Self {
        Self {
            interval: Duration::from_millis(200),
            suspicion: Duration::from_secs(5),
            labels: true,
        }
    }
}

/// Declares what a picture shows, for ROS 2, with these values unless something is assigned.
pub(crate) fn visualisation_declarations(values: &VisualisationParameters) -> Vec<Declaration> {
    vec![
        Declaration {
            name: RATE,
            description: "At most so many pictures a second, and only when something changed",
            value: ParameterValue::Double(1.0 / values.interval.as_secs_f64()),
            range: Range::Double {
                from: RATE_MIN,
                to: RATE_MAX,
            },
            change: Change::AtRunTime,
        },
        Declaration {
            name: SUSPICION,
            description: "A module that was not heard for so many seconds is drawn grey",
            value: ParameterValue::Double(values.suspicion.as_secs_f64()),
            range: SECONDS,
            change: Change::AtStart("it goes with the suspicion_s of the agents"),
        },
        Declaration {
            name: LABELS,
            description: "Whether modules and spots carry their numbers",
            value: ParameterValue::Boolean(values.labels),
            range: Range::Any,
            change: Change::AtRunTime,
        },
    ]
}

fn visualisation_parameters(values: &Values) -> Result<VisualisationParameters, ParameterError> {
    Ok(VisualisationParameters {
        interval: Duration::from_secs_f64(1.0 / values.double(RATE)?.clamp(RATE_MIN, RATE_MAX)),
        suspicion: values.seconds(SUSPICION)?,
        labels: values.boolean(LABELS)?,
    })
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
        let declarations = visualisation_declarations(&self.parameters);
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        let shown = visualisation_parameters(parameters.values())?;
        let mut session = Session::open(&self.settings, NODE_NAME, parameters)?;
        let facilities = FacilityInlets::open(&self.settings, &mut session)?;
        let target: Inlet<TargetConfiguration> = Inlet::open(&mut session, &topics::TARGET)?;
        let states: Inlet<ModuleStates> = Inlet::open(&mut session, &topics::MODULE_STATES)?;
        let roster: Inlet<Roster> = Inlet::open(&mut session, &topics::ROSTER)?;
        let claims: Inlet<SpotClaim> = Inlet::open(&mut session, &topics::claims(1))?;
        let heartbeats: Inlet<Heartbeat> = Inlet::open(&mut session, &topics::HEARTBEATS)?;
        let samples = [
            deliveries(&target),
            deliveries(&states),
            deliveries(&roster),
            deliveries(&claims),
            deliveries(&heartbeats),
        ];
        let inbox = Inbox::new(arrivals(samples, &facilities), stop);
        let mut easel = Easel {
            start: Instant::now(),
            markers: Outlet::open(&mut session, &topics::MARKERS)?,
            transforms: Outlet::open(&mut session, &topics::TRANSFORMS)?,
            fixed_transforms: Outlet::open(&mut session, &topics::FIXED_TRANSFORMS)?,
            inlets: &facilities,
            facilities: Facilities::open(&self.settings, &mut session)?,
            session: &mut session,
            parameters: shown,
            scene: DrawnScene::new(shown.suspicion),
            traffic: Traffic::default(),
            drawn: None,
            transformed: None,
        };
        let result = async_io::block_on(easel.draw_until_stopped(inbox));
        tracing::info!("traffic: {}", easel.traffic);
        result
    }
}

struct Easel<'a> {
    start: Instant,
    markers: Outlet<MarkerArray, Publisher<MarkerArray>>,
    transforms: Outlet<TFMessage, Publisher<TFMessage>>,
    fixed_transforms: Outlet<TFMessage, Publisher<TFMessage>>,
    inlets: &'a FacilityInlets,
    facilities: Facilities,
    session: &'a mut Session,
    parameters: VisualisationParameters,
    scene: DrawnScene,
    traffic: Traffic,
    /// When the last picture was drawn.
    drawn: Option<Instant>,
    /// When the modules' transforms were sent last.
    transformed: Option<Instant>,
}

impl Easel<'_> {
    async fn draw_until_stopped(
        &mut self,
        mut inbox: Inbox<'_, Arrival<Delivery>>,
    ) -> Result<(), SessionError> {
        loop {
            self.draw();
            self.facilities
                .report(self.session, &mut self.traffic, |traffic| {
                    vec![traffic_report(traffic)]
                })?;
            match inbox.wait(Some(self.due())).await {
                Wake::Stop => return Ok(()),
                Wake::Due => {}
                Wake::Arrival(arrival) => {
                    self.take_in(arrival);
                    for arrival in std::iter::from_fn(|| inbox.ready()).take(SAMPLES_PER_TURN) {
                        self.take_in(arrival);
                    }
                }
            }
        }
    }

    fn take_in(&mut self, arrival: Arrival<Delivery>) {
        let delivery = match arrival {
            Arrival::Sample(delivery) => delivery,
            Arrival::Facility(arrival) => {
                let shown = &mut self.parameters;
                self.facilities.attend(
                    self.inlets,
                    arrival,
                    self.session,
                    &mut self.traffic,
                    &mut |values| {
                        *shown = visualisation_parameters(values)?;
                        Ok(())
                    },
                );
                return;
            }
        };
        let own = source_id(self.session.source());
        if let Some((_, messages)) = delivery.accept(own, &mut self.traffic) {
            let now = self.start.elapsed();
            for message in messages {
                self.handle_message(now, &message);
            }
        }
    }

    fn handle_message(&mut self, now: Duration, message: &Message) {
        let had = self.scene.target().cloned();
        self.scene.handle(now, message);
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
        let drawing = Instant::now() + self.parameters.interval.min(TRANSFORM_INTERVAL);
        self.facilities
            .due()
            .map_or(drawing, |report| report.min(drawing))
    }
}

#[cfg(test)]
mod tests {
    use formation_tests::parameter_section;
    use ros_runtime::arguments::assigned_in;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let mut shipped = assigned_in(&parameter_section("The visualiser")).unwrap();
        // It has the parameter of the agents as well.
        let agents = assigned_in(&parameter_section("Agents")).unwrap();
        shipped.insert(SUSPICION.to_owned(), agents[SUSPICION].clone());
        let declarations = visualisation_declarations(&VisualisationParameters::default());
        let declared = declarations.into_iter();
        let declared = declared.map(|declaration| (declaration.name.to_owned(), declaration.value));
        assert_eq!(shipped, declared.collect());
    }
}
