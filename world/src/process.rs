//! The node that plays the drivers of all modules of a scenario.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::{DockingRequest, ModuleId, ModuleSize, Pose, Scenario};
use formation_motion::{self as motion, PlannedMotion, WorldReport};
use formation_msgs::external::geometry_msgs::{self, PoseStamped, PoseWithCovariance};
use formation_msgs::external::nav_msgs::Odometry;
use formation_msgs::{DockingResult, DriverPose, IntoCore, Time};
use formation_node_support::messages::module_size_of;
use formation_node_support::{PoseSource, stamp, topics};
use formation_planner::plan;
use ros_runtime::PublisherQueue;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::parameters::Tunables;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;

use crate::options::WorldOptions;
use crate::{DriveKind, World};

const NODE_NAME: &str = "world";

/// The world moves on this often.
const INTERVAL: Duration = Duration::from_millis(16);
/// A goal echoes the stamp of the last pose that its module received. One that echoes an older pose has come too late: meanwhile
/// the module may have been found to stand still, for which its process needs 0.5 s (`still_s`). The next goal follows within a
/// heartbeat.
const ECHO_AGE_MAX: Duration = Duration::from_millis(400);
/// The least time between two reports.
const REPORT_INTERVAL: Duration = Duration::from_millis(200);

/// A process that plays the robots of a scenario.
pub struct WorldProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// The modules, the obstacles and the walls.
    pub scenario: Scenario,
    /// How robots move, measure and dock.
    pub options: WorldOptions,
}

/// What a driver gets.
enum Command {
    Goal(Pose),
    Docking(DockingRequest),
}

impl WorldProcess {
    /// Plays the robots until `stop` yields, then leaves the graph. `notify` gets the counts whenever they change.
    ///
    /// # Errors
    /// Modules start where there are no paths, or blocks have a drive that cannot move them, or the graph could not be joined.
    pub fn run(
        &self,
        stop: &Receiver<()>,
        mut notify: impl FnMut(&WorldReport),
    ) -> Result<(), RosContextError> {
        let problem = self.scenario.problem();
        let planned = plan(Arc::new(problem.clone()));
        let (planned, _) = PlannedMotion::of(problem, planned.plan);
        planned.check().map_err(RosContextError::BadInput)?;
        if self.options.drive == DriveKind::Differential {
            let refused = motion::check_differential_drives(problem);
            refused.map_err(RosContextError::BadInput)?;
        }
        if self.options.delay >= ECHO_AGE_MAX {
            return Err(RosContextError::BadInput(format!(
                "delay_ms: no robot would move, as goals that follow from poses of {} ms ago or more are dropped",
                ECHO_AGE_MAX.as_millis()
            )));
        }
        let mut world = World::new(problem, self.options.clone());
        rejoining(|| self.play(&mut world, stop, &mut notify))
    }

    fn play(
        &self,
        world: &mut World,
        stop: &Receiver<()>,
        notify: &mut dyn FnMut(&WorldReport),
    ) -> Result<(), RosContextError> {
        let declarations = self.options.declarations();
        let parameters = self.settings.declare(NODE_NAME, declarations)?;
        let mut ros = RosContext::join(&self.settings, NODE_NAME, parameters)?;
        let frame_id = self.scenario.problem().target().frame_id();
        let mut inputs = Inputs::default();
        let mut drivers = Vec::new();
        for module in world.modules() {
            subscribe(&mut ros, &mut inputs, module, frame_id)?;
            drivers.push(Driver {
                module,
                poses: match self.options.pose_source {
                    PoseSource::Pose => Poses::Pose(ros.publisher(&topics::driver_pose(module))?),
                    PoseSource::Odometry => {
                        Poses::Odometry(ros.publisher(&topics::driver_odometry(module))?)
                    }
                },
                results: ros.publisher(&topics::docking_result(module))?,
            });
        }
        let reports = ros.publisher(&topics::WORLD_REPORT)?;
        let mut node = WorldNode {
            module_size: module_size_of(&ros),
            frame_id,
            options: &self.options,
            world,
            drivers,
            advanced: Instant::now(),
            notify,
            reports,
            reported: (Instant::now(), None),
        };
        let ended = ros.run(&mut node, inputs, stop);
        node.report();
        ended
    }
}

/// Subscribes to what a module sends to its driver.
fn subscribe(
    ros: &mut RosContext,
    inputs: &mut Inputs<(ModuleId, Command)>,
    module: ModuleId,
    frame_id: &str,
) -> Result<(), RosContextError> {
    let size = module_size_of(ros);
    let frame_id = frame_id.to_owned();
    let goals = ros.subscription(&topics::goal_pose(module), move |_, goal: PoseStamped| {
        check_echo(goal.header.stamp).map_err(|reason| format!("a goal of {module} {reason}"))?;
        let pose = goal.in_frame(&frame_id, size);
        pose.map_err(|error| error.to_string())
    })?;
    let requests = ros.subscription(&topics::docking(module), move |_, request| {
        let request: formation_msgs::DockingRequest = request;
        match request.into_core(size) {
            Ok((named, request)) if named == module => Ok(request),
            Ok((named, _)) => Err(format!("names {named}, on a topic of {module}")),
            Err(error) => Err(error.to_string()),
        }
    })?;
    inputs.add(goals, move |goal| (module, Command::Goal(goal)));
    inputs.add(requests, move |request| (module, Command::Docking(request)));
    Ok(())
}

/// Refuses a goal that was made from a pose that is too old, by the clock that stamped the pose.
fn check_echo(stamp: Time) -> Result<(), String> {
    match stamp::age(stamp) {
        Some(age) if age <= ECHO_AGE_MAX => Ok(()),
        Some(age) => Err(format!("echoes a pose of {} ms ago", age.as_millis())),
        None => Err("echoes the stamp of no pose of this world".to_owned()),
    }
}

/// What the driver of one module publishes.
struct Driver {
    module: ModuleId,
    poses: Poses,
    results: PublisherQueue<DockingResult>,
}

enum Poses {
    Pose(PublisherQueue<PoseStamped>),
    Odometry(PublisherQueue<Odometry>),
}

struct WorldNode<'a> {
    module_size: ModuleSize,
    frame_id: &'a str,
    options: &'a WorldOptions,
    world: &'a mut World,
    /// By module, ascending.
    drivers: Vec<Driver>,
    /// The time up to which the world was simulated.
    advanced: Instant,
    notify: &'a mut dyn FnMut(&WorldReport),
    reports: PublisherQueue<formation_msgs::WorldReport>,
    /// What was reported last, and when.
    reported: (Instant, Option<WorldReport>),
}

impl Node for WorldNode<'_> {
    type Input = (ModuleId, Command);

    fn handle(&mut self, (module, command): (ModuleId, Command)) {
        match command {
            Command::Goal(goal) => self.world.handle_goal(module, &goal),
            Command::Docking(request) => self.world.handle_request(module, request),
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let now = Instant::now();
        let elapsed = now.saturating_duration_since(self.advanced);
        self.advanced = now;
        self.world.advance(elapsed);
        while let Some((module, pose)) = self.world.poll_pose() {
            self.publish_pose(module, &pose);
        }
        while let Some((module, result)) = self.world.poll_result() {
            let header = stamp::header(self.frame_id);
            let sample = DockingResult::new(header, module, result);
            if let Some(driver) = self.driver(module) {
                driver.results.publish(sample);
            }
        }
        if now >= self.reported.0 + REPORT_INTERVAL {
            self.report();
        }
        Ok(ControlFlow::Continue(()))
    }

    fn due(&self) -> Option<Instant> {
        Some(self.advanced + INTERVAL)
    }
}

impl WorldNode<'_> {
    fn driver(&self, module: ModuleId) -> Option<&Driver> {
        let index = self
            .drivers
            .binary_search_by_key(&module, |driver| driver.module);
        self.drivers.get(index.ok()?)
    }

    fn publish_pose(&self, module: ModuleId, pose: &Pose) {
        let Some(driver) = self.driver(module) else {
            return;
        };
        let header = stamp::header_of_past(self.frame_id, self.options.delay);
        let pose = geometry_msgs::Pose::new(pose, self.module_size);
        match &driver.poses {
            Poses::Pose(queue) => queue.publish(PoseStamped { header, pose }),
            Poses::Odometry(queue) => queue.publish(Odometry {
                header,
                child_frame_id: format!("module_{}", module.0),
                pose: PoseWithCovariance {
                    pose,
                    covariance: self.covariance(),
                },
                twist: geometry_msgs::TwistWithCovariance::default(),
            }),
        }
    }

    /// How sure measured poses are, in metres and radians.
    fn covariance(&self) -> [[f64; 6]; 6] {
        let mut covariance = [[0.0; 6]; 6];
        let noise = self.module_size.scale_to_metres(self.options.noise);
        covariance[0][0] = noise * noise;
        covariance[1][1] = noise * noise;
        covariance[5][5] = self.options.heading_noise * self.options.heading_noise;
        covariance
    }

    fn message(&self, report: &WorldReport) -> formation_msgs::WorldReport {
        let metres = |units| self.module_size.scale_to_metres(units);
        formation_msgs::WorldReport {
            header: stamp::header(self.frame_id),
            contacts: report.contacts,
            contacts_above_touch: report.contacts_above_touch,
            fastest_contact: metres(report.fastest_contact),
            deepest_overlap: metres(report.deepest_overlap),
            wall_contacts: report.wall_contacts,
            docking_attempts: report.docking_attempts,
            docking_failures: report.docking_failures,
            folds: report.folds,
            lost_poses: report.lost_poses,
        }
    }

    /// Reports the counts, if they changed.
    fn report(&mut self) {
        let report = self.world.report();
        if self.reported.1.as_ref() != Some(&report) {
            (self.notify)(&report);
            self.reports.publish(self.message(&report));
            self.reported = (Instant::now(), Some(report));
        }
    }
}
