//! The topics between modules and their drivers.

use std::collections::BTreeMap;
use std::time::Instant;

use formation_model::{DockingResult, MicroUnits, ModuleId, ModuleSize, Pose, Service};
use formation_motion::DriveCommand;
use formation_msgs::external::geometry_msgs::{self, PoseStamped};
use formation_msgs::external::nav_msgs::Path;
use formation_msgs::{DockingRequest, DriverPose, Header, IntoCore, Time};
use formation_node_support::messages::module_size_of;
use formation_node_support::{PoseSource, stamp, topics};
use formation_protocol::Identity;
use futures::stream::LocalBoxStream;
use ros_runtime::PublisherQueue;
use ros_runtime::arguments::Resource;
use ros_runtime::inputs::{Inputs, Wake};
use ros_runtime::ros_context::{RosContext, RosContextError};
use ros_runtime::topic::Topic;
use serde::de::DeserializeOwned;

use crate::arguments::Motion;

/// A message of a driver.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DriverMessage {
    /// Where its module stands.
    Pose(MeasuredPose),
    /// The answer to a docking request.
    Docking(DockingResult),
}

/// Where a module stands, as its driver says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MeasuredPose {
    pub pose: Pose,
    /// The stamp that the driver gave it.
    pub stamp: Time,
    /// The standard deviation of the position that it states, if any.
    pub deviation: Option<MicroUnits>,
}

/// Messages of drivers, each with its module.
type DriverInputs = Inputs<(ModuleId, DriverMessage)>;

/// Publishes to the drivers of the hosted modules.
pub(crate) struct DriverPublishers {
    frame_id: String,
    module_size: ModuleSize,
    modules: BTreeMap<ModuleId, DriverQueues>,
}

/// What the driver of one module gets.
struct DriverQueues {
    goals: PublisherQueue<PoseStamped>,
    paths: PublisherQueue<Path>,
    requests: PublisherQueue<DockingRequest>,
    /// The stamp of the last pose that came from the driver. Goals echo it, by which the driver finds how long a goal was on its
    /// way: that takes no clock but its own.
    last_pose: Time,
}

/// Creates the endpoints for the drivers of these modules; `frame_id` is the frame of goals and poses.
pub(crate) fn open(
    ros: &mut RosContext,
    modules: impl Iterator<Item = ModuleId>,
    source: PoseSource,
    frame_id: &str,
) -> Result<(DriverInputs, DriverPublishers), RosContextError> {
    let mut inputs = DriverInputs::default();
    let mut publishers = BTreeMap::new();
    let size = module_size_of(ros);
    for module in modules {
        let poses = match source {
            PoseSource::Pose => {
                subscribe_poses(ros, &topics::driver_pose(module), module, frame_id)?
            }
            PoseSource::Odometry => {
                subscribe_poses(ros, &topics::driver_odometry(module), module, frame_id)?
            }
        };
        let results = ros.subscription(&topics::docking_result(module), move |_, result| {
            let (named, result) = result
                .into_core(size)
                .map_err(|error| format!("{module}: {error}"))?;
            if named == module {
                Ok(DriverMessage::Docking(result))
            } else {
                let error = formation_msgs::DockingResult::of_another(named);
                Err(format!("{module}: {error}"))
            }
        })?;
        inputs.add(poses, move |pose| (module, DriverMessage::Pose(pose)));
        inputs.add(results, move |result| (module, result));
        let queues = DriverQueues {
            goals: ros.publisher(&topics::goal_pose(module))?,
            paths: ros.publisher(&topics::path(module))?,
            requests: ros.publisher(&topics::docking(module))?,
            last_pose: Time::default(),
        };
        publishers.insert(module, queues);
    }
    let publishers = DriverPublishers {
        frame_id: frame_id.to_owned(),
        module_size: size,
        modules: publishers,
    };
    Ok((inputs, publishers))
}

fn subscribe_poses<M: DriverPose + DeserializeOwned + 'static>(
    ros: &mut RosContext,
    topic: &Topic<M>,
    module: ModuleId,
    frame_id: &str,
) -> Result<LocalBoxStream<'static, MeasuredPose>, RosContextError> {
    let (frame_id, size) = (frame_id.to_owned(), module_size_of(ros));
    ros.subscription(topic, move |_, sample: M| {
        let (stamp, deviation) = (sample.stamp(), sample.deviation(size));
        let pose = sample.in_frame(&frame_id, size);
        pose.map(|pose| MeasuredPose {
            pose,
            stamp,
            deviation,
        })
        .map_err(|error| format!("{module}: {error}"))
    })
}

/// Waits until the driver of every module has sent its pose, at most for the limit, and leaves the modules as they
/// stand; false when the process is to end. Modules whose drivers sent no pose are removed and logged: they can be
/// started again, and are newcomers then.
/// Enforces B7.
pub(crate) fn wait_for_poses(
    inputs: &mut DriverInputs,
    publishers: &mut DriverPublishers,
    modules: &mut Vec<(Identity, Service)>,
    motion: &Motion,
    ros: &RosContext,
    stop: &async_channel::Receiver<()>,
) -> Result<bool, RosContextError> {
    let deadline = Some(Instant::now() + motion.first_pose_limit);
    let mut poses = BTreeMap::new();
    while poses.len() < modules.len() {
        match async_io::block_on(inputs.wait(deadline, stop)) {
            Wake::Stop => return Ok(false),
            Wake::Due => break,
            Wake::Input((module, DriverMessage::Pose(measured))) => {
                publishers.keep_stamp(module, measured.stamp);
                poses.insert(module, measured.pose);
            }
            Wake::Input(_) => {}
        }
    }
    let mut absent = Vec::new();
    modules.retain_mut(|(identity, _)| match poses.get(&identity.module) {
        Some(&pose) => {
            identity.pose = pose;
            true
        }
        None => {
            absent.push(identity.module);
            false
        }
    });
    let mut reasons = Vec::new();
    for module in absent {
        let topic = match motion.pose_source {
            PoseSource::Pose => topics::driver_pose(module).path(),
            PoseSource::Odometry => topics::driver_odometry(module).path(),
        };
        reasons.push(format!(
            "{module} does not take part: its driver sent no pose on `{}` within first_pose_limit_s ({} s)",
            ros.resolve(Resource::Topic, &topic)?,
            motion.first_pose_limit.as_secs_f64()
        ));
    }
    if modules.is_empty() {
        return Err(RosContextError::Failed(reasons.join("; ")));
    }
    for reason in reasons {
        tracing::error!("{reason}");
    }
    Ok(true)
}

impl DriverPublishers {
    /// Takes in the stamp of a pose that came from the driver of a module; the goals that follow echo it.
    pub(crate) fn keep_stamp(&mut self, module: ModuleId, stamp: Time) {
        if let Some(queues) = self.modules.get_mut(&module) {
            queues.last_pose = stamp;
        }
    }

    /// Publishes the path of a module to its driver.
    pub(crate) fn publish_path(&self, module: ModuleId, path: &[Pose]) {
        let Some(DriverQueues { paths, .. }) = self.modules.get(&module) else {
            return;
        };
        let header = stamp::header(&self.frame_id);
        let poses = path.iter().map(|pose| PoseStamped {
            header: header.clone(),
            pose: geometry_msgs::Pose::new(pose, self.module_size),
        });
        let poses = poses.collect();
        paths.publish(Path { header, poses });
    }

    /// Publishes a command to the driver of a module.
    pub(crate) fn publish(&self, module: ModuleId, command: DriveCommand) {
        let Some(queues) = self.modules.get(&module) else {
            return;
        };
        match command {
            DriveCommand::Goal(pose) => {
                let header = Header {
                    stamp: queues.last_pose,
                    frame_id: self.frame_id.clone(),
                };
                let pose = geometry_msgs::Pose::new(&pose, self.module_size);
                queues.goals.publish(PoseStamped { header, pose });
            }
            DriveCommand::Docking(request) => {
                let header = stamp::header(&self.frame_id);
                queues
                    .requests
                    .publish(DockingRequest::new(header, module, &request));
            }
        }
    }
}
