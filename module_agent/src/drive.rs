//! What moves a module: a simulation in this process, or an external driver.

use std::collections::VecDeque;
use std::time::Duration;

use formation_model::{DockingAction, ModuleId, Pose};
use formation_motion::{
    DriveCommand, DriveFault, ExternalDrive, MotionGoal, MotionReport, SimulatedDrive,
};
use formation_protocol::Identity;

use crate::arguments::{DriveMode, Motion};
use crate::drivers::DriverMessage;

/// The longest time between two reports of a simulated drive that moves. It reports its arrival at once.
const SIMULATION_INTERVAL: Duration = Duration::from_millis(100);

/// One module's drive and docking ports.
#[expect(
    clippy::large_enum_variant,
    reason = "a process has one for each of its modules"
)]
pub(crate) enum Drive {
    Simulated {
        drive: SimulatedDrive,
        due: Option<Duration>,
        reports: VecDeque<MotionReport>,
    },
    External(ExternalDrive),
}

impl Drive {
    /// A drive at rest; a simulated one halts when its goal does not repeat for `patience`.
    pub(crate) fn new(identity: &Identity, motion: &Motion, patience: Duration) -> Self {
        let pose = identity.pose;
        match motion.mode {
            DriveMode::Simulated => Self::Simulated {
                drive: SimulatedDrive::new(pose, motion.speed, patience),
                due: None,
                reports: VecDeque::new(),
            },
            // Requests are numbered from the start of the process, so that no earlier process used the same number.
            DriveMode::External => {
                let first_request = identity.incarnation.0;
                Self::External(ExternalDrive::new(pose, motion.external, first_request))
            }
        }
    }

    /// Uses other parameters from the next goal on; only the speed of a simulation can change.
    pub(crate) fn set_parameters(&mut self, motion: &Motion) {
        if let Self::Simulated { drive, .. } = self {
            drive.set_speed(motion.speed);
        }
    }

    /// Takes a goal, or notes that the current one still holds.
    pub(crate) fn go(&mut self, now: Duration, goal: MotionGoal) {
        match self {
            Self::Simulated { drive, .. } => drive.go(now, goal),
            Self::External(drive) => drive.go(now, &goal),
        }
        self.schedule(now);
    }

    /// Stands still, and reports when it does.
    pub(crate) fn halt(&mut self, now: Duration) {
        match self {
            Self::Simulated { drive, reports, .. } => reports.push_back(drive.halt(now)),
            Self::External(drive) => drive.halt(now),
        }
        self.schedule(now);
    }

    /// Docks or undocks, and reports when that is done; simulated ports need no time.
    pub(crate) fn ask(&mut self, now: Duration, action: DockingAction, other: ModuleId) {
        match self {
            Self::Simulated { reports, .. } => reports.push_back(match action {
                DockingAction::Dock => MotionReport::Docked(other),
                DockingAction::Undock => MotionReport::Undocked(other),
            }),
            Self::External(drive) => drive.ask(now, action, other),
        }
    }

    /// A hand moves the body of a simulated module, and tears it off these others; returns whether it is simulated.
    pub(crate) fn push(
        &mut self,
        now: Duration,
        pose: Pose,
        torn_off: impl IntoIterator<Item = ModuleId>,
    ) -> bool {
        let Self::Simulated { drive, reports, .. } = self else {
            return false;
        };
        reports.extend(torn_off.into_iter().map(MotionReport::Undocked));
        reports.extend(drive.put(now, pose));
        self.schedule(now);
        true
    }

    /// A simulated port opens, as what it held was torn off; returns whether it is simulated.
    pub(crate) fn tear_off(&mut self, other: ModuleId) -> bool {
        match self {
            Self::Simulated { reports, .. } => {
                reports.push_back(MotionReport::Undocked(other));
                true
            }
            Self::External(_) => false,
        }
    }

    /// Takes in a message of the driver; a simulated drive has none.
    pub(crate) fn handle_message(&mut self, now: Duration, message: DriverMessage) {
        if let Self::External(drive) = self {
            match message {
                DriverMessage::Pose(measured) => {
                    drive.handle_deviation(measured.deviation);
                    drive.handle_pose(now, measured.pose);
                }
                DriverMessage::Docking(result) => drive.handle_docking_result(now, result),
            }
        }
    }

    /// Lets time pass.
    pub(crate) fn advance(&mut self, now: Duration) {
        match self {
            Self::Simulated { drive, reports, .. } => reports.extend(drive.advance(now)),
            Self::External(drive) => drive.advance(now),
        }
        self.schedule(now);
    }

    fn schedule(&mut self, now: Duration) {
        if let Self::Simulated { drive, due, .. } = self {
            *due = drive.due().map(|due| due.min(now + SIMULATION_INTERVAL));
        }
    }

    /// When [`Self::advance`] is due next.
    pub(crate) fn due(&self) -> Option<Duration> {
        match self {
            Self::Simulated { due, .. } => *due,
            Self::External(drive) => drive.poll_timeout(),
        }
    }

    /// The next report for the agent.
    pub(crate) fn take_report(&mut self) -> Option<MotionReport> {
        match self {
            Self::Simulated { reports, .. } => reports.pop_front(),
            Self::External(drive) => drive.poll_report(),
        }
    }

    /// The next command for the driver.
    pub(crate) fn take_command(&mut self) -> Option<DriveCommand> {
        match self {
            Self::Simulated { .. } => None,
            Self::External(drive) => drive.poll_command(),
        }
    }

    /// The next fault of the driver.
    pub(crate) fn take_fault(&mut self) -> Option<DriveFault> {
        match self {
            Self::Simulated { .. } => None,
            Self::External(drive) => drive.poll_fault(),
        }
    }
}
