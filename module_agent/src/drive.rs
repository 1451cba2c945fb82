//! What moves a module: a simulation within this process, or a driver outside.

use std::collections::VecDeque;
use std::time::Duration;

use formation::model::ModuleId;
use formation::motion::{DockingAction, DriveCommand, DriveFault, ExternalDrive, SimulatedDrive};
use formation::protocol::{Identity, MotionGoal, MotionReport};

use crate::drivers::{DriverNews, ExternalMotion};

/// Between two looks at a simulated drive that is on its way.
const SIMULATION_INTERVAL: Duration = Duration::from_millis(100);

/// How the hosted modules move.
#[derive(Clone, Debug, PartialEq)]
pub enum MotionParameters {
    /// Straight to their goals, within this process.
    Simulated {
        /// How fast, in units a second.
        speed_units_per_s: f64,
    },
    /// By drivers, which are told over topics.
    External(ExternalMotion),
}

impl Default for MotionParameters {
    fn default() -> Self {
        Self::Simulated {
            speed_units_per_s: 1.0,
        }
    }
}

enum Kind {
    Simulated {
        drive: SimulatedDrive,
        due: Option<Duration>,
    },
    External(ExternalDrive),
}

/// One module's drive and docking ports.
pub(crate) struct Drive {
    kind: Kind,
    reports: VecDeque<MotionReport>,
}

impl Drive {
    /// A drive at rest; a simulated one halts when it was not told to go on for `patience`.
    pub(crate) fn new(
        identity: &Identity,
        parameters: &MotionParameters,
        patience: Duration,
    ) -> Self {
        let kind = match parameters {
            MotionParameters::Simulated { speed_units_per_s } => Kind::Simulated {
                drive: SimulatedDrive::new(identity.pose, *speed_units_per_s, patience),
                due: None,
            },
            // Requests are numbered from the start of the process, so that none of an earlier one has the same.
            MotionParameters::External(motion) => Kind::External(ExternalDrive::new(
                identity.pose,
                motion.drive,
                identity.incarnation.0,
            )),
        };
        Self {
            kind,
            reports: VecDeque::new(),
        }
    }

    /// Goes by other parameters from the next goal on; only the speed of a simulation can change.
    pub(crate) fn set_parameters(&mut self, parameters: &MotionParameters) {
        if let (Kind::Simulated { drive, .. }, MotionParameters::Simulated { speed_units_per_s }) =
            (&mut self.kind, parameters)
        {
            drive.set_speed(*speed_units_per_s);
        }
    }

    /// Takes a goal, or takes note that the present one still holds.
    pub(crate) fn go(&mut self, now: Duration, goal: MotionGoal) {
        match &mut self.kind {
            Kind::Simulated { drive, .. } => drive.go(now, goal),
            Kind::External(drive) => drive.go(now, &goal),
        }
        self.schedule(now);
    }

    /// Stands still, and reports when it does.
    pub(crate) fn halt(&mut self, now: Duration) {
        match &mut self.kind {
            Kind::Simulated { drive, .. } => {
                let report = drive.halt(now);
                self.reports.push_back(report);
            }
            Kind::External(drive) => drive.halt(now),
        }
        self.schedule(now);
    }

    /// Couples a port or lets go, and reports when that is done.
    pub(crate) fn ask(&mut self, now: Duration, action: DockingAction, other: ModuleId) {
        match &mut self.kind {
            // Simulated ports couple and let go without delay.
            Kind::Simulated { .. } => self.reports.push_back(match action {
                DockingAction::Dock => MotionReport::Docked(other),
                DockingAction::Undock => MotionReport::Undocked(other),
            }),
            Kind::External(drive) => drive.ask(now, action, other),
        }
    }

    /// Takes in what a driver outside says; a simulated drive has none.
    pub(crate) fn hear(&mut self, now: Duration, news: DriverNews) {
        if let Kind::External(drive) = &mut self.kind {
            match news {
                DriverNews::Pose(pose) => drive.handle_pose(now, pose),
                DriverNews::Docking(result) => drive.handle_docking_result(now, result),
            }
        }
    }

    /// Lets time pass.
    pub(crate) fn advance(&mut self, now: Duration) {
        match &mut self.kind {
            Kind::Simulated { drive, .. } => {
                let report = drive.advance(now);
                self.reports.extend(report);
            }
            Kind::External(drive) => drive.advance(now),
        }
        self.schedule(now);
    }

    fn schedule(&mut self, now: Duration) {
        if let Kind::Simulated { drive, due } = &mut self.kind {
            *due = drive.is_moving().then(|| now + SIMULATION_INTERVAL);
        }
    }

    /// When [`Self::advance`] is due next.
    pub(crate) fn due(&self) -> Option<Duration> {
        match &self.kind {
            Kind::Simulated { due, .. } => *due,
            Kind::External(drive) => drive.poll_timeout(),
        }
    }

    /// The next thing to tell the agent.
    pub(crate) fn take_report(&mut self) -> Option<MotionReport> {
        match &mut self.kind {
            Kind::Simulated { .. } => self.reports.pop_front(),
            Kind::External(drive) => drive.poll_report(),
        }
    }

    /// The next thing to tell the driver outside.
    pub(crate) fn take_command(&mut self) -> Option<DriveCommand> {
        match &mut self.kind {
            Kind::Simulated { .. } => None,
            Kind::External(drive) => drive.poll_command(),
        }
    }

    /// The next thing that is wrong with the driver outside.
    pub(crate) fn take_fault(&mut self) -> Option<DriveFault> {
        match &mut self.kind {
            Kind::Simulated { .. } => None,
            Kind::External(drive) => drive.poll_fault(),
        }
    }
}
