//! The bodies of modules that take no part in a plan; states and rosters carry them.

use formation_model::{BodyReport, Incarnation, ModuleId, Polyline, Pose, Whereabouts};
use serde::{Deserialize, Serialize};

use crate::bounds::{MODULES_MAX, PATH_NUMBERS_MAX};
use crate::check::{self, Checked, FieldError};
use crate::epoch::Epoch;

/// See `Body.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
    pub path_micro: Vec<i64>,
}

#[expect(missing_docs, reason = "the .msg file documents the constants")]
impl Body {
    pub const WHEREABOUTS_SEEN: u8 = 1;
    pub const WHEREABOUTS_ON_THE_WAY: u8 = 2;
    pub const WHEREABOUTS_HALTED: u8 = 3;
    pub const WHEREABOUTS_REMOVED: u8 = 4;
    pub const WHEREABOUTS_IN_BLOCK: u8 = 5;
}

impl From<&BodyReport> for Body {
    fn from(report: &BodyReport) -> Self {
        let whereabouts = match &report.whereabouts {
            Whereabouts::Seen(_) => Self::WHEREABOUTS_SEEN,
            Whereabouts::OnTheWay(_) => Self::WHEREABOUTS_ON_THE_WAY,
            Whereabouts::InBlock(_) => Self::WHEREABOUTS_IN_BLOCK,
            Whereabouts::Halted(_) => Self::WHEREABOUTS_HALTED,
            Whereabouts::Removed => Self::WHEREABOUTS_REMOVED,
        };
        let poses = report.whereabouts.poses();
        let pose = poses.first().copied().unwrap_or_default();
        let path = poses.iter().skip(1);
        Self {
            module_id: report.module.0,
            incarnation: report.incarnation.0,
            epoch: report.epoch.as_ref().into(),
            sequence: report.sequence,
            whereabouts,
            x_micro: pose.x.0,
            y_micro: pose.y.0,
            theta_micro: pose.theta.0,
            path_micro: path
                .flat_map(|pose| [pose.x.0, pose.y.0, pose.theta.0])
                .collect(),
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
        let has_path = [Self::WHEREABOUTS_ON_THE_WAY, Self::WHEREABOUTS_IN_BLOCK];
        if !has_path.contains(&self.whereabouts) {
            let path = [("path_micro", self.path_micro.len())];
            check::empty(&path, "only a body on the way has a path")?;
        }
        Ok(BodyReport {
            module: check::id("module_id", self.module_id, ModuleId)?,
            incarnation: Incarnation(self.incarnation),
            epoch: self.epoch.validated()?,
            sequence: self.sequence,
            whereabouts: match self.whereabouts {
                Self::WHEREABOUTS_SEEN => Whereabouts::Seen(pose),
                Self::WHEREABOUTS_ON_THE_WAY => Whereabouts::OnTheWay(self.path(pose)?),
                Self::WHEREABOUTS_IN_BLOCK => Whereabouts::InBlock(self.path(pose)?),
                Self::WHEREABOUTS_HALTED => Whereabouts::Halted(pose),
                Self::WHEREABOUTS_REMOVED => Whereabouts::Removed,
                value => {
                    let known = "SEEN 1, ON_THE_WAY 2, HALTED 3, REMOVED 4, IN_BLOCK 5";
                    return Err(FieldError::unknown("whereabouts", value, known));
                }
            },
        })
    }

    fn path(&self, seen: Pose) -> Checked<Polyline> {
        let field = "path_micro";
        check::count(field, self.path_micro.len(), PATH_NUMBERS_MAX)?;
        let (triples, rest) = self.path_micro.as_chunks::<3>();
        if !rest.is_empty() {
            let reason = "the number of entries is not a multiple of three";
            return Err(FieldError::contradiction(field, reason));
        }
        let mut poses = vec![seen];
        for &[x, y, theta] in triples {
            poses.push(Pose {
                x: check::micro(field, x)?,
                y: check::micro(field, y)?,
                theta: check::micro(field, theta)?,
            });
        }
        let polyline = Polyline::try_from(poses);
        polyline.map_err(|_| FieldError::contradiction(field, "it has too many poses"))
    }
}

/// The bodies of distinct modules, ascending.
pub(crate) fn bodies(field: &str, raw: &[Body]) -> Checked<Vec<BodyReport>> {
    let bodies = check::entries(field, raw, MODULES_MAX, Body::validated)?;
    check::ascending(field, bodies.iter().map(|body| body.module))?;
    Ok(bodies)
}
