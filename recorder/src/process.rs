//! The node of the process that records.

use std::io;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use async_channel::Receiver;
use formation_model::ModuleId;
use formation_msgs::INTERFACES;
use formation_node_support::topics;
use ros_runtime::arguments::Resource;
use ros_runtime::diagnostics::{DiagnosticLevel, Report};
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;
use ros_runtime::topic::{Topic, Untyped};
use ros_runtime::type_hash::Interfaces;

use crate::file::{RecordedTopic, RecordingFile, Written};
use crate::queue::{Item, WriteQueue};

const NODE_NAME: &str = "recorder";

/// The most modules whose own topics are recorded: the DDS library holds 1,024 endpoints until they are announced, and a
/// module has six topics.
pub const MODULES_MAX: usize = 100;

/// A process that records what is on the topics.
#[derive(Clone, Debug)]
pub struct RecorderProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// The file that it writes.
    pub file: PathBuf,
    /// The modules whose own topics it records.
    pub modules: Vec<ModuleId>,
}

impl RecorderProcess {
    /// Records until `stop` yields, finishes the file, then leaves the graph. When the DDS library no longer receives, it
    /// rejoins the graph and continues with the same file.
    ///
    /// # Errors
    /// The file cannot be written, or the graph cannot be joined.
    pub fn run(&self, stop: &Receiver<()>) -> Result<Written, RosContextError> {
        let interfaces = Interfaces::with(INTERFACES).map_err(RosContextError::Failed)?;
        let file = RecordingFile::create(&self.file, interfaces);
        let file = file.map_err(RosContextError::BadInput)?;
        let mut queue = WriteQueue::start(file).map_err(|error| self.failed(&error))?;
        let written = rejoining(|| self.record(stop, &mut queue))?;
        Ok(written.unwrap_or_default())
    }

    fn record(
        &self,
        stop: &Receiver<()>,
        queue: &mut WriteQueue,
    ) -> Result<Option<Written>, RosContextError> {
        let parameters = self.settings.declare(NODE_NAME, Vec::new())?;
        let mut ros = RosContext::join(&self.settings, NODE_NAME, parameters)?;
        let mut inputs = Inputs::default();
        let of_formation = topics::all().into_iter().map(|listed| listed.topic);
        let of_modules = self.modules.iter().copied();
        let of_modules = of_modules.flat_map(topics::all_of_module);
        for topic in of_formation.chain(of_modules) {
            subscribe(&mut ros, &mut inputs, &topic)?;
        }
        let mut recorder = Recorder {
            queue,
            recorded: 0,
            has_failed: false,
        };
        let ended = ros.run(&mut recorder, inputs, stop);
        if let Err(error) = &ended
            && error.ends_with_rejoining()
        {
            return ended.map(|()| None);
        }
        // Before the context is dropped: to leave the graph may take longer than the process has.
        let written = queue.finish().map_err(|error| self.failed(&error))?;
        ended.map(|()| written)
    }

    fn failed(&self, error: &io::Error) -> RosContextError {
        RosContextError::Failed(format!("cannot write {}: {error}", self.file.display()))
    }
}

fn subscribe(
    ros: &mut RosContext,
    inputs: &mut Inputs<Item>,
    topic: &Topic<Untyped>,
) -> Result<(), RosContextError> {
    let (package, type_name) = topic.type_name();
    let recorded = Arc::new(RecordedTopic {
        name: ros.resolve(Resource::Topic, &topic.path())?,
        type_name: format!("{package}/msg/{type_name}"),
        quality: topic.quality(),
    });
    let samples = ros.raw_subscription(topic)?;
    inputs.add(samples, move |sample| Item {
        topic: Arc::clone(&recorded),
        sample,
    });
    Ok(())
}

struct Recorder<'a> {
    queue: &'a mut WriteQueue,
    recorded: u64,
    /// Whether the thread that writes has ended.
    has_failed: bool,
}

impl Node for Recorder<'_> {
    type Input = Item;

    fn handle(&mut self, item: Item) {
        let lost = self.queue.lost();
        self.has_failed |= !self.queue.put(item);
        self.recorded += 1;
        if lost == 0 && self.queue.lost() > 0 {
            tracing::error!("samples arrive faster than they can be written, and are lost");
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        // The end of the thread has the reason.
        Ok(match self.has_failed {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        None
    }

    fn reports(&self) -> Vec<Report> {
        let lost = self.queue.lost();
        let (level, message) = match lost {
            0 => (DiagnosticLevel::Ok, "no sample was lost".to_owned()),
            lost => (DiagnosticLevel::Error, format!("{lost} samples were lost")),
        };
        vec![Report {
            part: "recording".to_owned(),
            hardware_id: String::new(),
            level,
            message,
            values: vec![("arrived".to_owned(), self.recorded.to_string())],
        }]
    }
}
