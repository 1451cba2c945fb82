//! Motion by a driver outside, such as the one of a real robot: goals and docking requests go out, poses and results
//! come in, and nothing is waited for without a limit.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use crate::model::{MicroUnits, ModuleId, Pose};
use crate::protocol::{MotionGoal, MotionReport};

use super::docking::{DockingAction, DockingFault, DockingQueue, DockingRequest, DockingResult};

/// A full turn in micro-radians.
const FULL_TURN: i64 = 6_283_185;

/// How a driver is listened to, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExternalParameters {
    /// A module on its way must tell its pose at least this often.
    pub pose_limit: Duration,
    /// A driver must answer a docking request within this.
    pub docking_limit: Duration,
    /// A module must stand still within this after its goals ceased.
    pub halt_limit: Duration,
    /// A module whose poses stayed within the tolerances for so long stands still.
    pub still: Duration,
    /// How near to its goal a module has arrived, and how far a standing one may stray untold.
    pub position_tolerance: MicroUnits,
    /// The same for its heading, in micro-radians.
    pub heading_tolerance: MicroUnits,
}

impl Default for ExternalParameters {
    fn default() -> Self {
        Self {
            pose_limit: Duration::from_secs(5),
            docking_limit: Duration::from_secs(30),
            halt_limit: Duration::from_secs(10),
            still: Duration::from_millis(500),
            position_tolerance: MicroUnits(20_000),
            heading_tolerance: MicroUnits(30_000),
        }
    }
}

/// What a driver is to be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveCommand {
    /// Go there, or go on going there; stop when this ceases to be said.
    Goal(Pose),
    /// Dock to another module, or let go of it.
    Docking(DockingRequest),
}

/// What is wrong with a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DriveFault {
    /// No pose came while the module was on its way.
    NoPose {
        /// For how long.
        limit: Duration,
    },
    /// The module still moved so long after its goals ceased.
    NotStanding {
        /// How long.
        limit: Duration,
    },
    /// A docking request was never answered.
    DockingUnanswered {
        /// What was asked.
        request: DockingRequest,
        /// How long an answer was awaited.
        limit: Duration,
    },
    /// The driver says that it cannot dock or let go.
    DockingRefused {
        /// What was asked.
        request: DockingRequest,
        /// What the driver says.
        reason: String,
    },
}

impl fmt::Display for DriveFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |request: &DockingRequest| match request.action {
            DockingAction::Dock => format!("dock to {}", request.other),
            DockingAction::Undock => format!("undock from {}", request.other),
        };
        match self {
            Self::NoPose { limit } => write!(
                formatter,
                "its driver told no pose within pose_limit_s ({} s) while it was to move",
                limit.as_secs_f64()
            ),
            Self::NotStanding { limit } => write!(
                formatter,
                "does not stand still within halt_limit_s ({} s) after its goals ceased",
                limit.as_secs_f64()
            ),
            Self::DockingUnanswered { request, limit } => write!(
                formatter,
                "its driver did not answer the request to {} within docking_limit_s ({} s)",
                named(request),
                limit.as_secs_f64()
            ),
            Self::DockingRefused { request, reason } => {
                write!(formatter, "its driver cannot {}: {reason}", named(request))
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Errand {
    Standing,
    Travelling {
        goal: Pose,
        since: Duration,
    },
    Halting {
        since: Duration,
        /// Since when all poses were near this one.
        still: Option<(Pose, Duration)>,
        told: bool,
    },
}

/// One module's driver, as seen from the module.
///
/// After every call of another method, drain [`Self::poll_command`], [`Self::poll_report`] and [`Self::poll_fault`], and
/// call [`Self::advance`] at [`Self::poll_timeout`].
#[derive(Clone, Debug)]
pub struct ExternalDrive {
    parameters: ExternalParameters,
    pose: Pose,
    heard: Duration,
    /// The pose that the agent was told last.
    told: Pose,
    errand: Errand,
    docking: DockingQueue,
    commands: VecDeque<DriveCommand>,
    reports: VecDeque<MotionReport>,
    faults: VecDeque<DriveFault>,
}

impl ExternalDrive {
    /// A driver whose module stands at `pose`; docking requests are numbered from `first_request`, which must be
    /// beyond those of the module's earlier processes.
    #[must_use]
    pub fn new(pose: Pose, parameters: ExternalParameters, first_request: u64) -> Self {
        Self {
            parameters,
            pose,
            heard: Duration::ZERO,
            told: pose,
            errand: Errand::Standing,
            docking: DockingQueue::new(parameters.docking_limit, first_request),
            commands: VecDeque::new(),
            reports: VecDeque::new(),
            faults: VecDeque::new(),
        }
    }

    /// Sends a goal on; to be called again and again while it holds.
    pub fn go(&mut self, now: Duration, goal: &MotionGoal) {
        let same =
            matches!(self.errand, Errand::Travelling { goal: present, .. } if present == goal.pose);
        if !same {
            self.errand = Errand::Travelling {
                goal: goal.pose,
                since: now,
            };
        }
        self.commands.push_back(DriveCommand::Goal(goal.pose));
    }

    /// Lets goals cease; the halt is reported once the module stands still.
    pub fn halt(&mut self, now: Duration) {
        match self.errand {
            Errand::Standing => self.reports.push_back(MotionReport::Halted(self.pose)),
            Errand::Travelling { .. } => {
                self.errand = Errand::Halting {
                    since: now,
                    still: None,
                    told: false,
                };
            }
            Errand::Halting { .. } => {}
        }
    }

    /// Asks for a port to couple or to let go.
    pub fn ask(&mut self, now: Duration, action: DockingAction, other: ModuleId) {
        self.docking.ask(action, other);
        self.advance(now);
    }

    /// Takes a pose of the driver.
    pub fn handle_pose(&mut self, now: Duration, pose: Pose) {
        self.pose = pose;
        self.heard = now;
        match &mut self.errand {
            Errand::Standing => {
                if !near(&self.parameters, &self.told, &pose) {
                    self.report(MotionReport::Pose(pose));
                }
            }
            Errand::Travelling { goal, .. } => {
                if near(&self.parameters, goal, &pose) {
                    self.errand = Errand::Standing;
                    self.report(MotionReport::Arrived(pose));
                } else {
                    self.report(MotionReport::Pose(pose));
                }
            }
            Errand::Halting { still, .. } => match still {
                Some((anchor, since)) if near(&self.parameters, anchor, &pose) => {
                    if now.saturating_sub(*since) >= self.parameters.still {
                        self.errand = Errand::Standing;
                        self.report(MotionReport::Halted(pose));
                    }
                }
                _ => *still = Some((pose, now)),
            },
        }
    }

    /// Takes an answer to a docking request; one to an earlier request is ignored.
    pub fn handle_docking_result(&mut self, now: Duration, result: DockingResult) {
        match self.docking.hear(result) {
            None => {}
            Some(Ok(report)) => self.report(report),
            Some(Err(fault)) => self.fail_docking(fault),
        }
        self.advance(now);
    }

    /// Does what is due by time alone.
    pub fn advance(&mut self, now: Duration) {
        match &mut self.errand {
            Errand::Travelling { since, .. } => {
                let limit = self.parameters.pose_limit;
                if now >= self.heard.max(*since) + limit {
                    self.errand = Errand::Standing;
                    self.faults.push_back(DriveFault::NoPose { limit });
                    self.report(MotionReport::Failed);
                }
            }
            Errand::Halting { since, told, .. } => {
                let limit = self.parameters.halt_limit;
                if !*told && now >= *since + limit {
                    *told = true;
                    self.faults.push_back(DriveFault::NotStanding { limit });
                }
            }
            Errand::Standing => {}
        }
        match self.docking.advance(now) {
            Ok(None) => {}
            Ok(Some(request)) => self.commands.push_back(DriveCommand::Docking(request)),
            Err(fault) => self.fail_docking(fault),
        }
    }

    /// When [`Self::advance`] is due next.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        let errand = match self.errand {
            Errand::Travelling { since, .. } => {
                Some(self.heard.max(since) + self.parameters.pose_limit)
            }
            Errand::Halting {
                since, told: false, ..
            } => Some(since + self.parameters.halt_limit),
            Errand::Halting { .. } | Errand::Standing => None,
        };
        [errand, self.docking.due()].into_iter().flatten().min()
    }

    /// The next thing to tell the driver.
    pub fn poll_command(&mut self) -> Option<DriveCommand> {
        self.commands.pop_front()
    }

    /// The next thing to tell the agent.
    pub fn poll_report(&mut self) -> Option<MotionReport> {
        self.reports.pop_front()
    }

    /// The next thing to tell people.
    pub fn poll_fault(&mut self) -> Option<DriveFault> {
        self.faults.pop_front()
    }

    fn report(&mut self, report: MotionReport) {
        if let MotionReport::Pose(pose) | MotionReport::Arrived(pose) | MotionReport::Halted(pose) =
            report
        {
            self.told = pose;
        }
        self.reports.push_back(report);
    }

    fn fail_docking(&mut self, fault: DockingFault) {
        self.faults.push_back(match fault {
            DockingFault::Unanswered(request) => DriveFault::DockingUnanswered {
                request,
                limit: self.parameters.docking_limit,
            },
            DockingFault::Refused(request, reason) => {
                DriveFault::DockingRefused { request, reason }
            }
        });
        self.report(MotionReport::Failed);
    }
}

fn near(parameters: &ExternalParameters, one: &Pose, other: &Pose) -> bool {
    let turn = (one.theta.0 - other.theta.0).rem_euclid(FULL_TURN);
    one.distance_to(other) <= parameters.position_tolerance
        && turn.min(FULL_TURN - turn) <= parameters.heading_tolerance.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const OTHER: ModuleId = ModuleId(7);

    fn at(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    fn pose(x: f64, theta: f64) -> Pose {
        Pose::from_units(x, 0.0, theta).unwrap()
    }

    fn goal(x: f64) -> MotionGoal {
        MotionGoal {
            pose: pose(x, 0.0),
            unit_distance: MicroUnits(0),
        }
    }

    fn drive() -> ExternalDrive {
        ExternalDrive::new(pose(0.0, 0.0), ExternalParameters::default(), 100)
    }

    fn reports(drive: &mut ExternalDrive) -> Vec<MotionReport> {
        std::iter::from_fn(|| drive.poll_report()).collect()
    }

    fn commands(drive: &mut ExternalDrive) -> Vec<DriveCommand> {
        std::iter::from_fn(|| drive.poll_command()).collect()
    }

    fn faults(drive: &mut ExternalDrive) -> Vec<String> {
        std::iter::from_fn(|| drive.poll_fault())
            .map(|fault| fault.to_string())
            .collect()
    }

    #[test]
    fn goals_go_out_each_time_and_arrival_is_judged_by_the_pose() {
        let mut drive = drive();
        for second in 0..3 {
            drive.go(at(second * 1_000), &goal(2.0));
        }
        assert_eq!(
            commands(&mut drive),
            [DriveCommand::Goal(goal(2.0).pose); 3]
        );
        drive.handle_pose(at(2_100), pose(1.0, 0.0));
        // Where it should be, but turned by more than the tolerance.
        drive.handle_pose(at(2_200), pose(2.0, 0.1));
        drive.handle_pose(at(2_300), pose(2.01, -0.02));
        assert_eq!(
            reports(&mut drive),
            [
                MotionReport::Pose(pose(1.0, 0.0)),
                MotionReport::Pose(pose(2.0, 0.1)),
                MotionReport::Arrived(pose(2.01, -0.02)),
            ]
        );
        // Noise of a standing module is no news, but being carried off is.
        drive.handle_pose(at(9_000), pose(2.02, -0.02));
        drive.handle_pose(at(9_100), pose(2.5, -0.02));
        assert_eq!(reports(&mut drive), [MotionReport::Pose(pose(2.5, -0.02))]);
        assert_eq!(drive.poll_timeout(), None);
    }

    #[test]
    fn headings_are_compared_across_the_full_turn() {
        let parameters = ExternalParameters::default();
        assert!(near(&parameters, &pose(0.0, 3.13), &pose(0.0, -3.13)));
        assert!(!near(&parameters, &pose(0.0, 3.1), &pose(0.0, -3.1)));
    }

    #[test]
    fn a_driver_that_falls_silent_on_the_way_has_failed() {
        let mut drive = drive();
        drive.go(at(1_000), &goal(2.0));
        assert_eq!(drive.poll_timeout(), Some(at(6_000)));
        drive.handle_pose(at(2_000), pose(0.5, 0.0));
        assert_eq!(drive.poll_timeout(), Some(at(7_000)));
        drive.advance(at(6_999));
        assert_eq!(faults(&mut drive), [""; 0]);
        drive.advance(at(7_000));
        assert_eq!(reports(&mut drive).last(), Some(&MotionReport::Failed));
        assert!(faults(&mut drive)[0].contains("pose_limit_s (5 s)"));
        assert_eq!(drive.poll_timeout(), None);
    }

    #[test]
    fn a_halt_is_reported_when_the_module_stands_still_and_not_before() {
        let mut drive = drive();
        drive.halt(at(0));
        assert_eq!(
            reports(&mut drive),
            [MotionReport::Halted(pose(0.0, 0.0))],
            "it never moved"
        );
        drive.go(at(0), &goal(5.0));
        drive.halt(at(1_000));
        for step in 0..10_u32 {
            drive.handle_pose(
                at(1_000 + u64::from(step) * 100),
                pose(f64::from(step) * 0.1, 0.0),
            );
        }
        assert_eq!(reports(&mut drive), [], "it rolls on");
        drive.handle_pose(at(2_000), pose(0.901, 0.0));
        drive.handle_pose(at(2_400), pose(0.9, 0.0));
        assert_eq!(reports(&mut drive), [MotionReport::Halted(pose(0.9, 0.0))]);
    }

    #[test]
    fn a_module_that_cannot_be_stopped_is_told_of_once_and_never_counts_as_halted() {
        let mut drive = drive();
        drive.go(at(0), &goal(5.0));
        drive.halt(at(0));
        for step in 1..300_u32 {
            let now = at(u64::from(step) * 100);
            drive.handle_pose(now, pose(f64::from(step), 0.0));
            drive.advance(now);
        }
        assert_eq!(reports(&mut drive), []);
        let told = faults(&mut drive);
        assert_eq!(told.len(), 1);
        assert!(told[0].contains("halt_limit_s (10 s)"), "{told:?}");
    }

    fn answer(request: u64, outcome: Result<(), String>) -> DockingResult {
        DockingResult { request, outcome }
    }

    fn asked(request: u64, action: DockingAction) -> DriveCommand {
        DriveCommand::Docking(DockingRequest {
            request,
            action,
            other: OTHER,
        })
    }

    #[test]
    fn docking_requests_go_out_one_after_another_and_repeat_until_answered() {
        let mut drive = drive();
        drive.ask(at(0), DockingAction::Undock, OTHER);
        drive.ask(at(0), DockingAction::Undock, OTHER);
        drive.ask(at(0), DockingAction::Dock, OTHER);
        assert_eq!(drive.poll_timeout(), Some(at(500)));
        drive.advance(at(500));
        assert_eq!(
            commands(&mut drive),
            [
                asked(100, DockingAction::Undock),
                asked(100, DockingAction::Undock)
            ]
        );
        drive.handle_docking_result(at(600), answer(101, Ok(())));
        assert_eq!(reports(&mut drive), [], "that one was not sent yet");
        drive.handle_docking_result(at(700), answer(100, Ok(())));
        drive.handle_docking_result(at(800), answer(100, Ok(())));
        drive.handle_docking_result(at(900), answer(101, Ok(())));
        assert_eq!(
            reports(&mut drive),
            [MotionReport::Undocked(OTHER), MotionReport::Docked(OTHER)]
        );
        assert_eq!(commands(&mut drive), [asked(101, DockingAction::Dock)]);
        assert_eq!(drive.poll_timeout(), None);
    }

    #[test]
    fn a_driver_that_does_not_dock_or_cannot_has_failed() {
        let mut drive = drive();
        drive.ask(at(0), DockingAction::Dock, OTHER);
        drive.ask(at(0), DockingAction::Dock, ModuleId(8));
        drive.advance(at(30_000));
        assert_eq!(reports(&mut drive), [MotionReport::Failed]);
        assert_eq!(
            faults(&mut drive),
            [
                "its driver did not answer the request to dock to module 7 within docking_limit_s (30 s)"
            ]
        );
        drive.ask(at(40_000), DockingAction::Undock, OTHER);
        drive.handle_docking_result(at(40_100), answer(102, Err("latch jammed".to_owned())));
        assert_eq!(reports(&mut drive), [MotionReport::Failed]);
        assert_eq!(
            faults(&mut drive),
            ["its driver cannot undock from module 7: latch jammed"]
        );
    }
}
