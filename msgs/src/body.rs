//! The bodies of modules that take no part in a plan; states and rosters carry them.

use formation::model::{BodyReport, Incarnation, ModuleId, Pose, Whereabouts};
use serde::{Deserialize, Serialize};

use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError};
use crate::epoch::Epoch;
use crate::error::Fault;

/// See `Body.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct Body {
    pub module_id: u32,
    pub incarnation: u64,
    pub epoch: Epoch,
    pub sequence: u64,
    pub whereabouts: u8,
    pub x_micro: i64,
    pub y_micro: i64,
    pub theta_micro: i64,
    pub to_x_micro: i64,
    pub to_y_micro: i64,
    pub to_theta_micro: i64,
}

#[expect(missing_docs, reason = "the .msg file documents the constants")]
impl Body {
    pub const WHEREABOUTS_SEEN: u8 = 1;
    pub const WHEREABOUTS_ON_THE_WAY: u8 = 2;
    pub const WHEREABOUTS_HALTED: u8 = 3;
    pub const WHEREABOUTS_REMOVED: u8 = 4;
    pub const WHEREABOUTS_WITHIN: u8 = 5;
}

impl From<&BodyReport> for Body {
    fn from(report: &BodyReport) -> Self {
        let nowhere = Pose::default();
        let (whereabouts, pose, to) = match report.whereabouts {
            Whereabouts::Seen(pose) => (Self::WHEREABOUTS_SEEN, pose, nowhere),
            Whereabouts::OnTheWay { from, to } => (Self::WHEREABOUTS_ON_THE_WAY, from, to),
            Whereabouts::Within { from, to } => (Self::WHEREABOUTS_WITHIN, from, to),
            Whereabouts::Halted(pose) => (Self::WHEREABOUTS_HALTED, pose, nowhere),
            Whereabouts::Removed => (Self::WHEREABOUTS_REMOVED, nowhere, nowhere),
        };
        Self {
            module_id: report.module.0,
            incarnation: report.incarnation.0,
            epoch: report.epoch.as_ref().into(),
            sequence: report.sequence,
            whereabouts,
            x_micro: pose.x.0,
            y_micro: pose.y.0,
            theta_micro: pose.theta.0,
            to_x_micro: to.x.0,
            to_y_micro: to.y.0,
            to_theta_micro: to.theta.0,
        }
    }
}

impl Body {
    fn validated(&self) -> Checked<BodyReport> {
        let pose = Pose {
            x: check::micro("x_micro", self.x_micro)?,
            y: check::micro("y_micro", self.y_micro)?,
            theta: check::micro("theta_micro", self.theta_micro)?,
        };
        let to = Pose {
            x: check::micro("to_x_micro", self.to_x_micro)?,
            y: check::micro("to_y_micro", self.to_y_micro)?,
            theta: check::micro("to_theta_micro", self.to_theta_micro)?,
        };
        Ok(BodyReport {
            module: check::id("module_id", self.module_id, ModuleId)?,
            incarnation: Incarnation(self.incarnation),
            epoch: self.epoch.validated()?,
            sequence: self.sequence,
            whereabouts: match self.whereabouts {
                Self::WHEREABOUTS_SEEN => Whereabouts::Seen(pose),
                Self::WHEREABOUTS_ON_THE_WAY => Whereabouts::OnTheWay { from: pose, to },
                Self::WHEREABOUTS_HALTED => Whereabouts::Halted(pose),
                Self::WHEREABOUTS_REMOVED => Whereabouts::Removed,
                Self::WHEREABOUTS_WITHIN => Whereabouts::Within { from: pose, to },
                value => {
                    let known = "SEEN 1, ON_THE_WAY 2, HALTED 3, REMOVED 4, WITHIN 5";
                    let value = value.into();
                    let fault = Fault::UnknownValue { value, known };
                    return Err(FieldError::new("whereabouts", fault));
                }
            },
        })
    }
}

/// The bodies of distinct modules, ascending.
pub(crate) fn bodies(field: &str, raw: &[Body]) -> Checked<Vec<BodyReport>> {
    let bodies = check::entries(field, raw, MODULES_MAX, Body::validated)?;
    check::ascending(field, bodies.iter().map(|body| body.module))?;
    Ok(bodies)
}
