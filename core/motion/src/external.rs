//! Motion by a driver outside the process, such as that of a real robot: goals and docking requests go out, poses and
//! results come in, and every wait has a limit.

mod rest;
mod stated_deviation;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use super::docking_queue::DockingQueue;
use super::fault::DriveFault;
use super::goal::{MotionGoal, MotionReport};
use formation_model::{DockingAction, DockingRequest, DockingResult, MicroUnits, ModuleId, Pose};
use rest::Rest;
use stated_deviation::StatedDeviation;

/// For longer than this no driver follows a goal that does not repeat.
const HOLDING: Duration = Duration::from_secs(2);

/// A pose that is further than this from where a module is to stand is no noise.
const JUMP: MicroUnits = MicroUnits(100_000);

/// The standard deviation that a driver states of its position beyond which localisation is lost, unless another one is given.
pub const DEVIATION_LIMIT: MicroUnits = MicroUnits(100_000);

/// Where a module is to stand.
#[derive(Clone, Copy, Debug)]
struct Holding {
    pose: Pose,
    since: Duration,
    /// When the driver last got this pose as its goal, or reached it.
    sent: Duration,
}

impl Holding {
    fn at(pose: Pose, now: Duration) -> Self {
        Self {
            pose,
            since: now,
            sent: now,
        }
    }
}

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
    /// A module whose poses, or the running mean of them, stay within the tolerances for this long stands still.
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
    /// Move there; stop when the command is no longer repeated, or at once if it names the present pose.
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
        /// The pose near which all later ones are, and its time; and the same of the running mean.
        still: [Option<(Pose, Duration)>; 2],
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
    deviation: StatedDeviation,
    /// Where it is to stand, until the driver certainly follows no earlier goal.
    holding: Option<Holding>,
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
            deviation: StatedDeviation::default(),
            holding: None,
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
        self.holding = None;
        self.commands.push_back(DriveCommand::Goal(goal.pose));
    }

    /// Sends the pose as the goal for as long as the driver may follow an earlier goal, then nothing. The halt is reported once the
    /// module is measured to stand still.
    pub fn halt(&mut self, now: Duration) {
        match self.state {
            State::Standing => self.report(MotionReport::Halted(self.pose)),
            State::Travelling { .. } => {
                self.state = State::Halting {
                    since: now,
                    still: [None; 2],
                    is_overdue: false,
                };
                self.holding = Some(Holding::at(self.pose, now));
                self.commands.push_back(DriveCommand::Goal(self.pose));
            }
            State::Halting { .. } => {}
        }
    }

    /// Requests to dock or undock.
    pub fn ask(&mut self, now: Duration, action: DockingAction, other: ModuleId) {
        self.docking.ask(action, other);
        self.advance(now);
    }

    /// Handles the standard deviation that the driver states of the pose that follows, if it states any.
    pub fn handle_deviation(&mut self, stated: Option<MicroUnits>) {
        if let Some(deviation) = self.deviation.next(stated) {
            self.report(MotionReport::Deviation(deviation));
        }
    }

    /// Handles a pose from the driver.
    pub fn handle_pose(&mut self, now: Duration, pose: Pose) {
        self.pose = pose;
        self.received = now;
        self.hold(now, &pose);
        match self.state {
            State::Standing => {
                self.rest.measure(&pose);
                if !self.is_near(&self.rest.reported, &self.rest.mean) {
                    self.report(MotionReport::Pose(pose));
                }
            }
            State::Travelling { goal, .. } if self.is_near(&goal, &pose) => {
                self.state = State::Standing;
                self.holding = Some(Holding::at(goal, now));
                self.report(MotionReport::Arrived { goal, pose });
            }
            State::Travelling { .. } => self.report(MotionReport::Pose(pose)),
            State::Halting {
                since,
                still,
                is_overdue,
            } => {
                self.rest.measure(&pose);
                let mean = self.rest.mean;
                // A module whose poses are exact stands still sooner, and one whose poses scatter does so by their mean.
                let still = [(still[0], pose), (still[1], mean)].map(|(still, pose)| {
                    let near = still.filter(|(anchor, _)| self.is_near(anchor, &pose));
                    near.unwrap_or((pose, now))
                });
                let stands =
                    still.map(|(_, since)| now.saturating_sub(since) >= self.parameters.still);
                if stands.contains(&true) {
                    self.state = State::Standing;
                    let pose = if stands[0] { pose } else { mean };
                    return self.report(MotionReport::Halted(pose));
                }
                self.state = State::Halting {
                    since,
                    still: still.map(Some),
                    is_overdue,
                };
                if !self.is_near(&self.rest.reported, &mean) {
                    self.report(MotionReport::Pose(mean));
                }
            }
        }
    }

    /// A driver that follows an earlier goal stops at once if it gets its pose as the goal. If its localisation jumps, it would go from
    /// there to the goal that it got last, so that the pose becomes its goal. Otherwise the goal stays, so that noise moves it nowhere.
    fn hold(&mut self, now: Duration, pose: &Pose) {
        let halts = matches!(self.state, State::Halting { .. });
        let holding = self.holding.take();
        let Some(mut holding) = holding.filter(|holding| now < holding.sent + HOLDING) else {
            return;
        };
        if holding.pose.distance_to(pose) > JUMP {
            holding = Holding::at(*pose, now);
            self.commands.push_back(DriveCommand::Goal(*pose));
        } else if halts && now < holding.since + HOLDING {
            holding.sent = now;
            self.commands.push_back(DriveCommand::Goal(holding.pose));
        }
        self.holding = Some(holding);
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
