//! The node of the process that draws a formation for RViz, Foxglove and similar tools.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::{Message, ModuleSize};
use formation_msgs::external::tf2_msgs::TFMessage;
use formation_msgs::external::visualization_msgs::MarkerArray;
use formation_node_support::messages::{Received, module_size_of, subscribe_all};
use formation_node_support::{stamp, topics};
use ros_runtime::PublisherQueue;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::parameters::{ParameterError, Tunable, Tunables, Values, number, seconds, switch};
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;

use crate::scene::DrawnScene;
use crate::{markers, transforms};

/// The longest time between two samples of transforms: listeners forget old ones.
const TRANSFORM_INTERVAL: Duration = Duration::from_secs(1);

const NODE_NAME: &str = "visualiser";

/// What a picture shows, and how often it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drawing {
    /// The most pictures per second.
    pub rate: f64,
    /// A module that is silent for longer is drawn grey.
    pub suspicion: Duration,
    /// Whether modules and spots are labelled with their identifiers.
    pub labels: bool,
}

impl Default for Drawing {
    fn default() -> Self {
        Self {
            rate: 5.0,
            suspicion: Duration::from_secs(5),
            labels: true,
        }
    }
}

impl Tunables for Drawing {
    const HEADING: &'static str = "Drawing";

    fn table() -> Vec<Tunable<Self>> {
        vec![
            Tunable::new(
                "rate",
                number("NUMBER", 0.1, 100.0),
                |own: &mut Self| &mut own.rate,
                "The most pictures per second; one is drawn only when something changed",
            ),
            Tunable::new(
                "suspicion_s",
                seconds(),
                |own: &mut Self| &mut own.suspicion,
                "A module that is silent for longer is drawn grey",
            )
            .at_start("it goes with the suspicion_s of the agents"),
            Tunable::new(
                "labels",
                switch(),
                |own: &mut Self| &mut own.labels,
                "Whether modules and spots are labelled with their identifiers",
            )
            .unset_by("no-labels"),
        ]
    }
}

/// Draws what is on the topics until `stop` yields, then leaves the graph. When the DDS library no longer receives, it starts
/// over with what it receives then.
pub(crate) fn draw(
    settings: &Settings,
    drawing: Drawing,
    stop: &Receiver<()>,
) -> Result<(), RosContextError> {
    rejoining(|| {
        let parameters = settings.declare(NODE_NAME, drawing.declarations())?;
        let drawing = drawing.read(parameters.values())?;
        let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
        let mut inputs = Inputs::default();
        for messages in subscribe_all(&mut ros, 1)? {
            inputs.add(messages, |received| received);
        }
        let mut visualiser = Visualiser {
            start: Instant::now(),
            module_size: module_size_of(&ros),
            markers: ros.publisher(&topics::MARKERS)?,
            transforms: ros.publisher(&topics::TRANSFORMS)?,
            fixed_transforms: ros.publisher(&topics::FIXED_TRANSFORMS)?,
            drawing,
            scene: DrawnScene::new(drawing.suspicion),
            drawn: None,
            transformed: None,
        };
        ros.run(&mut visualiser, inputs, stop)
    })
}

struct Visualiser {
    start: Instant,
    module_size: ModuleSize,
    markers: PublisherQueue<MarkerArray>,
    transforms: PublisherQueue<TFMessage>,
    fixed_transforms: PublisherQueue<TFMessage>,
    drawing: Drawing,
    scene: DrawnScene,
    /// When the last picture was drawn.
    drawn: Option<Instant>,
    /// When the modules' transforms were last published.
    transformed: Option<Instant>,
}

impl Node for Visualiser {
    type Input = Received;

    fn handle(&mut self, received: Received) {
        let now = self.start.elapsed();
        for message in &received.messages {
            self.handle_message(now, message);
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let now = Instant::now();
        self.scene.advance(self.start.elapsed());
        let is_due =
            |last: Option<Instant>, interval| last.is_none_or(|last| now >= last + interval);
        let changed = self.scene.has_changed() && is_due(self.drawn, self.interval());
        let header = stamp::header(self.scene.frame_id());
        if changed {
            let picture = markers::of(&self.scene, &header, self.drawing.labels);
            self.markers
                .publish(picture.scaled(self.module_size.metres()));
            self.scene.was_drawn();
            self.drawn = Some(now);
        }
        if changed || is_due(self.transformed, TRANSFORM_INTERVAL) {
            let sample = transforms::of_modules(&self.scene, &header, self.module_size);
            if !sample.transforms.is_empty() {
                self.transforms.publish(sample);
            }
            self.transformed = Some(now);
        }
        Ok(ControlFlow::Continue(()))
    }

    fn due(&self) -> Option<Instant> {
        Some(Instant::now() + self.interval().min(TRANSFORM_INTERVAL))
    }

    fn set_parameters(&mut self, values: &Values) -> Result<(), ParameterError> {
        self.drawing = self.drawing.read(values)?;
        Ok(())
    }
}

impl Visualiser {
    /// The least time between two pictures.
    fn interval(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.drawing.rate)
    }

    fn handle_message(&mut self, now: Duration, message: &Message) {
        let had = self.scene.target().cloned();
        self.scene.handle(now, message);
        if let Some(target) = self.scene.target()
            && had.as_ref() != Some(target)
        {
            let header = stamp::header(self.scene.frame_id());
            self.fixed_transforms
                .publish(transforms::of_spots(target, &header, self.module_size));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    use formation_tests::parameter_section;
    use ros_runtime::arguments::RosArguments;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let words = ["", "--ros-args", "--params-file", ""].map(OsString::from);
        let sections = parameter_section(&["The visualiser", "Agents"]);
        let (_, ros) = RosArguments::extract(words, |_| Ok(sections.clone())).unwrap();
        let node = Settings::default().identity(NODE_NAME);
        let shipped = ros.parameters.of_node(&node).into_iter();
        // Of the parameters of agents it has one.
        let shipped = shipped.filter(|(name, _)| ["rate", "labels", "suspicion_s"].contains(name));
        let shipped = shipped.map(|(name, assignment)| (name, assignment.value.clone()));
        let declared = Drawing::default().declarations().into_iter();
        let declared = declared.map(|declaration| (declaration.name, declaration.value));
        assert_eq!(shipped.collect::<BTreeMap<_, _>>(), declared.collect());
    }
}
