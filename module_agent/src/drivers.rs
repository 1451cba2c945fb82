//! The topics by which drivers outside are told what to do, and answer.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::model::{ModuleId, Pose};
use formation::motion::{self, DriveCommand, ExternalParameters};
use formation::protocol::Identity;
use formation_msgs::foreign::geometry_msgs::PoseStamped;
use formation_msgs::foreign::nav_msgs::Odometry;
use formation_msgs::{
    DockingRequest, DockingResult, DriverPose, InterfaceType, MessageError, topic,
};
use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros2_client::{Publisher, Subscription};
use serde::de::DeserializeOwned;

use formation_node::stamp;
use formation_node::topics;
use ros_runtime::inbox::{Inbox, Wake};
use ros_runtime::outlet::Outlet;
use ros_runtime::session::{Session, SessionError};
use ros_runtime::traffic::{RefusalKind, Traffic};

/// Which message tells a module's pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum PoseSource {
    /// `geometry_msgs/msg/PoseStamped` on `module_N/pose`
    #[default]
    Pose,
    /// `nav_msgs/msg/Odometry` on `module_N/odom`
    Odom,
}

impl PoseSource {
    /// The topic on which a module's pose is awaited, relative to the namespace of the nodes.
    pub(crate) fn topic_of(self, module: ModuleId) -> String {
        match self {
            Self::Pose => topics::driver_pose(module).path(),
            Self::Odom => topics::driver_odometry(module).path(),
        }
    }
}

/// How drivers are told and listened to.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalMotion {
    /// Which message tells a module's pose.
    pub pose_source: PoseSource,
    /// The frame of goals and poses; `None` for the target's.
    pub frame_id: Option<String>,
    /// A module whose driver told no pose so long after the start does not take part.
    pub first_pose_limit: Duration,
    /// How long the driver is waited for later, and how near is there.
    pub drive: ExternalParameters,
}

impl Default for ExternalMotion {
    fn default() -> Self {
        Self {
            pose_source: PoseSource::default(),
            frame_id: None,
            first_pose_limit: Duration::from_secs(30),
            drive: ExternalParameters::default(),
        }
    }
}

/// What a driver says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DriverNews {
    /// Where its module stands.
    Pose(Pose),
    /// What came of a docking request.
    Docking(motion::DockingResult),
}

/// What came in from a driver, not yet counted.
pub(crate) struct DriverWord {
    module: ModuleId,
    topic: &'static str,
    content: Result<DriverNews, (RefusalKind, String)>,
}

impl DriverWord {
    /// What it says; nothing if it is refused.
    pub(crate) fn accept(self, traffic: &mut Traffic) -> Option<(ModuleId, DriverNews)> {
        match self.content {
            Ok(news) => {
                traffic.on(self.topic).received += 1;
                Some((self.module, news))
            }
            Err((kind, reason)) => {
                let reason = format!("{}: {reason}", self.module);
                traffic.refuse(self.topic, kind, &reason);
                None
            }
        }
    }
}

enum PoseInlet {
    Stamped(Subscription<PoseStamped>),
    Odometry(Subscription<Odometry>),
}

/// What is heard of the drivers of the hosted modules.
pub(crate) struct DriverInlets {
    frame_id: String,
    modules: Vec<(ModuleId, PoseInlet, Subscription<DockingResult>)>,
}

type Wire<M> = Outlet<M, Publisher<M>>;

/// What is told to the drivers of the hosted modules.
pub(crate) struct DriverOutlets {
    frame_id: String,
    modules: BTreeMap<ModuleId, (Wire<PoseStamped>, Wire<DockingRequest>)>,
}

impl DriverInlets {
    /// Listens to the drivers of these modules; `frame_id` is the frame of their poses.
    pub(crate) fn open(
        session: &mut Session,
        modules: &[ModuleId],
        source: PoseSource,
        frame_id: &str,
    ) -> Result<Self, SessionError> {
        let modules = modules
            .iter()
            .map(|&module| {
                let pose = match source {
                    PoseSource::Pose => {
                        PoseInlet::Stamped(session.subscription(&topics::driver_pose(module))?)
                    }
                    PoseSource::Odom => {
                        PoseInlet::Odometry(session.subscription(&topics::driver_odometry(module))?)
                    }
                };
                let results = session.subscription(&topics::docking_result(module))?;
                Ok((module, pose, results))
            })
            .collect::<Result<_, SessionError>>()?;
        Ok(Self {
            frame_id: frame_id.to_owned(),
            modules,
        })
    }

    /// Everything that comes in, for ever.
    pub(crate) fn words(&self) -> Vec<LocalBoxStream<'_, DriverWord>> {
        let frame_id = self.frame_id.as_str();
        self.modules
            .iter()
            .flat_map(|(module, pose, results)| {
                let poses = match pose {
                    PoseInlet::Stamped(poses) => words(poses, *module, topic::POSE, move |pose| {
                        pose.in_frame(frame_id).map(DriverNews::Pose)
                    }),
                    PoseInlet::Odometry(poses) => {
                        words(poses, *module, topic::ODOMETRY, move |pose| {
                            pose.in_frame(frame_id).map(DriverNews::Pose)
                        })
                    }
                };
                let module = *module;
                let results = words(results, module, topic::DOCKING_RESULT, move |result| {
                    let (named, result) = result.try_into()?;
                    if named == module {
                        Ok(DriverNews::Docking(result))
                    } else {
                        Err(DockingResult::of_another(named))
                    }
                });
                [poses, results]
            })
            .collect()
    }

    /// Waits until every module's driver has told where it stands, at most for `limit`, and returns the modules as they
    /// stand; `None` when the process is to end.
    pub(crate) async fn first_poses(
        &self,
        modules: Vec<Identity>,
        limit: Duration,
        stop: Receiver<()>,
        traffic: &mut Traffic,
    ) -> Option<(Vec<Identity>, Vec<ModuleId>)> {
        let mut inbox = Inbox::new(self.words(), stop);
        let deadline = Instant::now() + limit;
        let mut poses: BTreeMap<ModuleId, Pose> = BTreeMap::new();
        while poses.len() < modules.len() {
            match inbox.wait(Some(deadline)).await {
                Wake::Stop => return None,
                Wake::Due => break,
                Wake::Arrival(word) => {
                    if let Some((module, DriverNews::Pose(pose))) = word.accept(traffic) {
                        poses.insert(module, pose);
                    }
                }
            }
        }
        let (mut present, mut absent) = (Vec::new(), Vec::new());
        for identity in modules {
            match poses.get(&identity.module) {
                Some(&pose) => present.push(Identity { pose, ..identity }),
                None => absent.push(identity.module),
            }
        }
        Some((present, absent))
    }
}

fn words<'a, M: DeserializeOwned + InterfaceType + 'static>(
    subscription: &'a Subscription<M>,
    module: ModuleId,
    topic: &'static str,
    mut read: impl FnMut(M) -> Result<DriverNews, MessageError> + 'a,
) -> LocalBoxStream<'a, DriverWord> {
    subscription
        .async_stream()
        .map(move |taken| DriverWord {
            module,
            topic,
            content: match taken {
                Ok((sample, _)) => {
                    read(sample).map_err(|error| (RefusalKind::Invalid, error.to_string()))
                }
                Err(error) => Err((RefusalKind::Malformed, error.to_string())),
            },
        })
        .boxed_local()
}

impl DriverOutlets {
    /// Speaks to the drivers of these modules; `frame_id` is the frame of the goals.
    pub(crate) fn open(
        session: &mut Session,
        modules: &[ModuleId],
        frame_id: &str,
    ) -> Result<Self, SessionError> {
        let modules = modules
            .iter()
            .map(|&module| {
                let goals = Outlet::open(session, &topics::goal_pose(module))?;
                let requests = Outlet::open(session, &topics::docking(module))?;
                Ok((module, (goals, requests)))
            })
            .collect::<Result<_, SessionError>>()?;
        Ok(Self {
            frame_id: frame_id.to_owned(),
            modules,
        })
    }

    /// Tells a driver what to do.
    pub(crate) fn tell(&mut self, module: ModuleId, command: DriveCommand, traffic: &mut Traffic) {
        let Some((goals, requests)) = self.modules.get_mut(&module) else {
            return;
        };
        let header = stamp::header(&self.frame_id);
        match command {
            DriveCommand::Goal(pose) => {
                let pose = (&pose).into();
                goals.publish(PoseStamped { header, pose }, traffic);
            }
            DriveCommand::Docking(request) => {
                requests.publish(DockingRequest::new(header, module, &request), traffic);
            }
        }
    }

    /// Offers again what the library had no room for.
    pub(crate) fn flush(&mut self, traffic: &mut Traffic) {
        for (goals, requests) in self.modules.values_mut() {
            goals.flush(traffic);
            requests.flush(traffic);
        }
    }

    /// Whether there is anything to offer again.
    pub(crate) fn is_waiting(&self) -> bool {
        self.modules
            .values()
            .any(|(goals, requests)| goals.is_waiting() || requests.is_waiting())
    }
}
