//! Motion by a driver outside the process, such as that of a real robot: goals and docking requests go out, poses and
//! results come in, and every wait has a limit.

mod rest;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use super::docking_queue::DockingQueue;
use super::fault::DriveFault;
use super::goal::{MotionGoal, MotionReport};
use formation_model::{DockingAction, DockingRequest, DockingResult, MicroUnits, ModuleId, Pose};
use rest::Rest;

/// The limits and tolerances for a driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExternalParameters {
    /// The longest time between two poses of a module that is to move.
    pub pose_limit: Duration,
    /// The longest time until the driver answers a docking request.
    pub docking_limit: Duration,
    /// The time after which an unanswered docking request is repeated: drivers can join late, and messages can be lost.
    pub docking_repeat: Duration,
    /// The longest time until a module stands still after its goals cease.
    pub halt_limit: Duration,
    /// A module whose poses stay within the tolerances for this long stands still.
    pub still: Duration,
    /// The distance from its goal at which a module has arrived, and by which a standing module, by the mean of its last poses,
    /// can move unreported.
    pub position_tolerance: MicroUnits,
    /// The same for its heading, in micro-radians.
    pub heading_tolerance: MicroUnits,
}

impl Default for ExternalParameters {
    fn default() -> Self {
        Self {
            pose_limit: Duration::from_secs(5),
            docking_limit: Duration::from_secs(30),
            docking_repeat: Duration::from_millis(500),
            halt_limit: Duration::from_secs(10),
            still: Duration::from_millis(500),
            position_tolerance: MicroUnits(20_000),
            heading_tolerance: MicroUnits(30_000),
        }
    }
}

/// A command to a driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveCommand {
    /// Move there; stop when the command is no longer repeated.
    Goal(Pose),
    /// Dock to another module, or undock from it.
    Docking(DockingRequest),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Standing,
    Travelling {
        goal: Pose,
        since: Duration,
    },
    Halting {
        since: Duration,
        /// The pose near which all later ones are, and its time.
        still: Option<(Pose, Duration)>,
        /// Whether [`DriveFault::NotStanding`] has been reported.
        is_overdue: bool,
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
    /// The time at which `pose` was received.
    received: Duration,
    /// Where it was reported last, and measured since.
    rest: Rest,
    state: State,
    docking: DockingQueue,
    commands: VecDeque<DriveCommand>,
    reports: VecDeque<MotionReport>,
    faults: VecDeque<DriveFault>,
}

impl ExternalDrive {
    /// A driver whose module stands at `pose`. Docking requests are numbered from `first_request`, which must be beyond
    /// those of the module's earlier processes.
    pub fn new(pose: Pose, parameters: ExternalParameters, first_request: u64) -> Self {
        Self {
            parameters,
            pose,
            received: Duration::ZERO,
            rest: Rest::at(pose),
            state: State::Standing,
            docking: DockingQueue::new(
                parameters.docking_limit,
                parameters.docking_repeat,
                first_request,
            ),
            commands: VecDeque::new(),
            reports: VecDeque::new(),
            faults: VecDeque::new(),
        }
    }

    /// Sends a goal; the caller repeats the call while the goal holds.
    pub fn go(&mut self, now: Duration, goal: &MotionGoal) {
        let is_same =
            matches!(self.state, State::Travelling { goal: present, .. } if present == goal.pose);
        if !is_same {
            self.state = State::Travelling {
                goal: goal.pose,
                since: now,
            };
        }
        self.commands.push_back(DriveCommand::Goal(goal.pose));
    }

    /// Stops sending goals; the halt is reported once the module is measured to stand still.
    pub fn halt(&mut self, now: Duration) {
        match self.state {
            State::Standing => self.report(MotionReport::Halted(self.pose)),
            State::Travelling { .. } => {
                self.state = State::Halting {
                    since: now,
                    still: None,
                    is_overdue: false,
                };
            }
            State::Halting { .. } => {}
        }
    }

    /// Requests to dock or undock.
    pub fn ask(&mut self, now: Duration, action: DockingAction, other: ModuleId) {
        self.docking.ask(action, other);
        self.advance(now);
    }

    /// Handles a pose from the driver.
    pub fn handle_pose(&mut self, now: Duration, pose: Pose) {
        self.pose = pose;
        self.received = now;
        match self.state {
            State::Standing => {
                self.rest.measure(&pose);
                if !self.is_near(&self.rest.reported, &self.rest.mean) {
                    self.report(MotionReport::Pose(pose));
                }
            }
            State::Travelling { goal, .. } if self.is_near(&goal, &pose) => {
                self.state = State::Standing;
                self.report(MotionReport::Arrived { goal, pose });
            }
            State::Travelling { .. } => self.report(MotionReport::Pose(pose)),
            State::Halting {
                since,
                still,
                is_overdue,
            } => match still.filter(|(anchor, _)| self.is_near(anchor, &pose)) {
                Some((_, still_since)) => {
                    if now.saturating_sub(still_since) >= self.parameters.still {
                        self.state = State::Standing;
                        self.report(MotionReport::Halted(pose));
                    }
                }
                None => {
                    self.state = State::Halting {
                        since,
                        still: Some((pose, now)),
                        is_overdue,
                    };
                }
            },
        }
    }

    /// Handles an answer to a docking request; ignores one to an earlier request.
    pub fn handle_docking_result(&mut self, now: Duration, result: DockingResult) {
        match self.docking.handle_result(result) {
            None => {}
            Some(Ok(report)) => self.report(report),
            Some(Err(fault)) => self.fail(fault),
        }
        self.advance(now);
    }

    /// Does what is due by time.
    /// Enforces S1.
    pub fn advance(&mut self, now: Duration) {
        match &mut self.state {
            State::Travelling { since, .. } => {
                let limit = self.parameters.pose_limit;
                if now >= self.received.max(*since) + limit {
                    self.halt(now);
                    self.fail(DriveFault::NoPose { limit });
                }
            }
            State::Halting {
                since, is_overdue, ..
            } => {
                let limit = self.parameters.halt_limit;
                if !*is_overdue && now >= *since + limit {
                    *is_overdue = true;
                    self.fail(DriveFault::NotStanding { limit });
                }
            }
            State::Standing => {}
        }
        match self.docking.advance(now) {
            Ok(None) => {}
            Ok(Some(request)) => self.commands.push_back(DriveCommand::Docking(request)),
            Err(fault) => self.fail(fault),
        }
    }

    /// The time at which the next call of [`Self::advance`] is due.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let due = match self.state {
            State::Travelling { since, .. } => {
                Some(self.received.max(since) + self.parameters.pose_limit)
            }
            State::Halting {
                since,
                is_overdue: false,
                ..
            } => Some(since + self.parameters.halt_limit),
            State::Halting { .. } | State::Standing => None,
        };
        [due, self.docking.due()].into_iter().flatten().min()
    }

    /// The next command to the driver.
    pub fn poll_command(&mut self) -> Option<DriveCommand> {
        self.commands.pop_front()
    }

    /// The next report to the agent.
    pub fn poll_report(&mut self) -> Option<MotionReport> {
        self.reports.pop_front()
    }

    /// The next fault, for people.
    pub fn poll_fault(&mut self) -> Option<DriveFault> {
        self.faults.pop_front()
    }

    fn report(&mut self, report: MotionReport) {
        if let MotionReport::Pose(pose)
        | MotionReport::Arrived { pose, .. }
        | MotionReport::Halted(pose) = report
        {
            self.rest = Rest::at(pose);
        }
        self.reports.push_back(report);
    }

    fn fail(&mut self, fault: DriveFault) {
        self.faults.push_back(fault);
        self.report(MotionReport::Failed);
    }

    fn is_near(&self, one: &Pose, other: &Pose) -> bool {
        one.distance_to(other) <= self.parameters.position_tolerance
            && one.heading_difference(other) <= self.parameters.heading_tolerance
    }
}
