//! The robots of modules with external drivers, as `launch_scripts/examples/robot_model.py` has them.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hiroz::msg::ZMessage;
use hiroz::prelude::ZPub;
use serde_yaml::Value;
use tokio::task::JoinHandle;
use tokio::time::sleep;

use crate::messages::ros::builtin_interfaces::Time;
use crate::messages::ros::formation_msgs::{DockingRequest, DockingResult};
use crate::messages::ros::geometry_msgs::{Pose as PoseMessage, PoseStamped};
use crate::messages::ros::nav_msgs::{Odometry, Path};
use crate::messages::{latched, volatile};
use crate::peer::{Peer, Result};

/// Between two poses.
const INTERVAL: Duration = Duration::from_millis(50);
/// How long a robot drives to a goal that does not repeat.
const PATIENCE: Duration = Duration::from_millis(1_500);
/// A goal that echoes the stamp of an older pose came too late.
const ECHO_AGE_MAX: Duration = Duration::from_millis(400);
/// How long docking takes.
const DOCKING: Duration = Duration::from_millis(200);
/// Metres in a second.
const SPEED: f64 = 4.0;
/// Radians in a second.
const TURN_RATE: f64 = 20.0;
/// How many modules publish poses; those after them publish odometry.
const POSES: usize = 5;

/// Metres, and radians counter-clockwise from the x axis.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    x: f64,
    y: f64,
    theta: f64,
}

/// Where the modules of a scenario stand at the start, in the order of their identifiers. Only singletons are read.
pub fn start_poses(scenario: &str) -> Result<Vec<(u64, Pose)>> {
    let scenario: Value = serde_yaml::from_str(&fs::read_to_string(scenario)?)?;
    let singletons = scenario["singletons"].as_sequence();
    let modules = singletons.into_iter().flatten().filter_map(|module| {
        let pose = Pose {
            x: module["x"].as_f64()?,
            y: module["y"].as_f64()?,
            theta: module["theta"].as_f64().unwrap_or(0.0),
        };
        Some((module["id"].as_u64()?, pose))
    });
    let mut poses: Vec<(u64, Pose)> = modules.collect();
    poses.sort_by_key(|(module, _)| *module);
    Ok(poses)
}

struct Robot {
    pose: Pose,
    /// Where it drives, and when that was last requested.
    goal: Option<(Pose, Instant)>,
    /// The docking request at work, and when it began.
    request: Option<(u64, Instant)>,
}

impl Robot {
    /// Moves straight to its goal for this time, if there is a goal that still holds.
    fn step(&mut self, elapsed: f64) {
        self.goal = self.goal.filter(|(_, at)| at.elapsed() <= PATIENCE);
        let Some((goal, _)) = self.goal else {
            return;
        };
        let (x, y) = (goal.x - self.pose.x, goal.y - self.pose.y);
        let distance = x.hypot(y);
        let share = if distance > 0.0 {
            (SPEED * elapsed / distance).min(1.0)
        } else {
            0.0
        };
        let turn = (goal.theta - self.pose.theta + PI).rem_euclid(TAU) - PI;
        let turn_max = TURN_RATE * elapsed;
        self.pose.x += x * share;
        self.pose.y += y * share;
        self.pose.theta += turn.clamp(-turn_max, turn_max);
    }

    /// Whether a docking request, which may arrive many times, is carried out by now.
    fn is_docked(&mut self, request: u64) -> bool {
        let began = match self.request {
            Some((known, began)) if known == request => began,
            _ => Instant::now(),
        };
        self.request = Some((request, began));
        began.elapsed() >= DOCKING
    }

    fn message(&self) -> PoseMessage {
        let mut message = PoseMessage::default();
        (message.position.x, message.position.y) = (self.pose.x, self.pose.y);
        let half = self.pose.theta / 2.0;
        (message.orientation.z, message.orientation.w) = half.sin_cos();
        message
    }
}

/// The present time, as poses are stamped.
fn stamp() -> Time {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Time {
        sec: i32::try_from(now.as_secs()).unwrap_or(i32::MAX),
        nanosec: now.subsec_nanos(),
    }
}

/// Whether a goal follows from a recent pose, by the clock that stamped the pose.
fn is_recent(echo: &Time) -> bool {
    let stamped = Duration::new(u64::try_from(echo.sec).unwrap_or_default(), echo.nanosec);
    let age = SystemTime::now().duration_since(UNIX_EPOCH + stamped);
    age.is_ok_and(|age| age <= ECHO_AGE_MAX)
}

fn locked(robot: &Mutex<Robot>) -> MutexGuard<'_, Robot> {
    robot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where a robot publishes its pose.
enum Source {
    Pose(ZPub<PoseStamped, <PoseStamped as ZMessage>::Serdes>),
    Odometry(ZPub<Odometry, <Odometry as ZMessage>::Serdes>),
}

impl Source {
    fn publish(&self, pose: PoseMessage) -> Result<()> {
        match self {
            Self::Pose(publisher) => {
                let mut message = PoseStamped::default();
                message.header.stamp = stamp();
                "map".clone_into(&mut message.header.frame_id);
                message.pose = pose;
                publisher.publish(&message)
            }
            Self::Odometry(publisher) => {
                let mut message = Odometry::default();
                message.header.stamp = stamp();
                "map".clone_into(&mut message.header.frame_id);
                message.pose.pose = pose;
                publisher.publish(&message)
            }
        }
    }
}

/// Drives these modules until the task is aborted.
pub fn start(peer: &Peer, modules: &[(u64, Pose)]) -> Result<JoinHandle<()>> {
    let mut robots = Vec::new();
    for (number, (module, pose)) in modules.iter().enumerate() {
        let robot = Arc::new(Mutex::new(Robot {
            pose: *pose,
            goal: None,
            request: None,
        }));
        subscribe(peer, *module, &robot)?;
        let below = |name: &str| format!("module_{module}/{name}");
        let source = if number < POSES {
            Source::Pose(peer.publisher(&below("pose"), volatile())?)
        } else {
            Source::Odometry(peer.publisher(&below("odom"), volatile())?)
        };
        robots.push((robot, source));
    }
    Ok(tokio::spawn(async move {
        let mut last = Instant::now();
        loop {
            sleep(INTERVAL).await;
            let elapsed = last.elapsed();
            last += elapsed;
            for (robot, source) in &robots {
                let pose = {
                    let mut robot = locked(robot);
                    robot.step(elapsed.as_secs_f64());
                    robot.message()
                };
                if let Err(error) = source.publish(pose) {
                    eprintln!("the robots stop, as a pose was not published: {error}");
                    return;
                }
            }
        }
    }))
}

/// Takes the goals of a module, and answers its requests to dock.
fn subscribe(peer: &Peer, module: u64, robot: &Arc<Mutex<Robot>>) -> Result<()> {
    let below = |name: &str| format!("module_{module}/{name}");
    let driven = robot.clone();
    let topic = below("goal_pose");
    peer.subscribe_as(&topic, &topic, volatile(), move |goal: &PoseStamped| {
        if !is_recent(&goal.header.stamp) {
            return;
        }
        let (position, orientation) = (&goal.pose.position, &goal.pose.orientation);
        let goal = Pose {
            x: position.x,
            y: position.y,
            theta: 2.0 * orientation.z.atan2(orientation.w),
        };
        locked(&driven).goal = Some((goal, Instant::now()));
    })?;
    peer.subscribe::<Path>(&below("path"), latched())?;
    let results = peer.publisher::<DockingResult>(&below("docking_result"), volatile())?;
    let docked = robot.clone();
    let topic = below("docking");
    peer.subscribe_as(
        &topic,
        &topic,
        volatile(),
        move |request: &DockingRequest| {
            if !locked(&docked).is_docked(request.request) {
                return;
            }
            let answer = DockingResult {
                module_id: request.module_id,
                request: request.request,
                success: true,
                ..DockingResult::default()
            };
            if let Err(error) = results.publish(&answer) {
                eprintln!("an answer to a docking request was not published: {error}");
            }
        },
    )
}
