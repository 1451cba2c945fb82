//! The message on `roster`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use std::sync::Arc;

use formation_model::{
    self as model, ClosedRoster, ConfigurationId, Digest, Incarnation, ModuleId, ModuleSize,
    PlanningModule, Pose, RosterMessage, SpotId, Timing, Voters,
};
use serde::{Deserialize, Serialize};

use crate::NONE;
use crate::body::{Body, bodies};
use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};
use crate::epoch::Epoch;
use crate::module_state::{service_from_wire, service_to_wire};
use crate::standard::Duration;
use crate::target::TargetConfiguration;

/// See `RosterMember.msg`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RosterMember {
    pub module_id: u32,
    pub incarnation: u64,
    pub knows: bool,
    pub is_idle: bool,
    pub service: u8,
    pub x_micro: i64,
    pub y_micro: i64,
    pub theta_micro: i64,
    pub links: Vec<u32>,
    pub configuration_id: u32,
    pub leader_id: u32,
    pub pinned_spot_id: u32,
}

/// See `Roster.msg`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Roster {
    pub protocol_version: u32,
    pub session: u64,
    pub epoch: Epoch,
    pub stage: u8,
    pub target_revision: u64,
    pub target_digest: u64,
    pub target: TargetConfiguration,
    pub members: Vec<RosterMember>,
    pub voters: Vec<u32>,
    pub removed_voters: Vec<u32>,
    pub listed_voters: Vec<u32>,
    pub bodies: Vec<Body>,
    pub heartbeat: Duration,
    pub suspicion: Duration,
    pub lease: Duration,
}

impl RosterMember {
    pub const NONE: u32 = NONE;
}

impl Roster {
    pub const STAGE_GATHER: u8 = 1;
    pub const STAGE_PLAN: u8 = 2;
}

impl From<&model::RosterMember> for RosterMember {
    fn from(member: &model::RosterMember) -> Self {
        let module = &member.module;
        Self {
            module_id: module.id.0,
            incarnation: member.incarnation.0,
            knows: member.knows,
            is_idle: member.is_idle,
            service: service_to_wire(member.service),
            x_micro: module.pose.x.0,
            y_micro: module.pose.y.0,
            theta_micro: module.pose.theta.0,
            links: module.links.iter().map(|link| link.0).collect(),
            configuration_id: module.configuration.map_or(NONE, |id| id.0),
            leader_id: module.leader.map_or(NONE, |id| id.0),
            pinned_spot_id: module.pin.map_or(NONE, |id| id.0),
        }
    }
}

impl RosterMember {
    fn validated(&self) -> Checked<model::RosterMember> {
        let id = check::id("module_id", self.module_id, ModuleId)?;
        Ok(model::RosterMember {
            incarnation: Incarnation(self.incarnation),
            knows: self.knows,
            is_idle: self.is_idle,
            service: service_from_wire(self.service)?,
            module: PlanningModule {
                id,
                pose: Pose {
                    x: check::micro("x_micro", self.x_micro)?,
                    y: check::micro("y_micro", self.y_micro)?,
                    theta: check::micro("theta_micro", self.theta_micro)?,
                },
                links: check::links(id, &self.links)?,
                configuration: check::optional_id(self.configuration_id, ConfigurationId),
                leader: check::optional_id(self.leader_id, ModuleId),
                pin: check::optional_id(self.pinned_spot_id, SpotId),
            },
        })
    }
}

impl Roster {
    fn of_plan(roster: &model::Roster, size: ModuleSize) -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            epoch: Epoch::from(&roster.epoch),
            stage: Self::STAGE_PLAN,
            target_revision: roster.target.revision,
            target_digest: 0,
            target: TargetConfiguration::new(&roster.target, size),
            members: roster.members.iter().map(RosterMember::from).collect(),
            voters: roster.voters.named.iter().map(|id| id.0).collect(),
            removed_voters: roster.voters.removed.iter().map(|id| id.0).collect(),
            listed_voters: roster.voters.listed.iter().map(|id| id.0).collect(),
            bodies: roster.bodies.iter().map(Body::from).collect(),
            heartbeat: roster.timing.heartbeat.into(),
            suspicion: roster.timing.suspicion.into(),
            lease: roster.timing.lease.into(),
        }
    }

    /// What a convener announces, as it goes out.
    #[must_use]
    pub fn new(announcement: &RosterMessage, size: ModuleSize) -> Self {
        match announcement {
            RosterMessage::Plan(roster) => Self::of_plan(roster, size),
            &RosterMessage::Gather {
                ref epoch,
                target_revision,
                target,
            } => Self {
                protocol_version: PROTOCOL_VERSION,
                epoch: Epoch::from(epoch),
                stage: Self::STAGE_GATHER,
                target_revision,
                target_digest: target.0,
                ..Self::default()
            },
        }
    }
}

impl Roster {
    pub(crate) fn validated(self, size: ModuleSize) -> Checked<RosterMessage> {
        check::version(self.protocol_version)?;
        match self.stage {
            Self::STAGE_GATHER => self.gather(),
            Self::STAGE_PLAN => self.plan(size),
            value => Err(FieldError::unknown("stage", value, "GATHER 1, PLAN 2")),
        }
    }

    fn gather(&self) -> Checked<RosterMessage> {
        let lists = [
            ("target.spots", self.target.spots.len()),
            ("target.edges", self.target.edges.len()),
            ("members", self.members.len()),
            ("voters", self.voters.len()),
            ("removed_voters", self.removed_voters.len()),
            ("listed_voters", self.listed_voters.len()),
            ("bodies", self.bodies.len()),
        ];
        check::empty(&lists, "must be empty while the epoch gathers")?;
        Ok(RosterMessage::Gather {
            epoch: self.epoch.required()?,
            target_revision: self.target_revision,
            target: Digest(self.target_digest),
        })
    }

    fn plan(self, size: ModuleSize) -> Checked<RosterMessage> {
        let epoch = self.epoch.required()?;
        if self.target.revision != self.target_revision {
            let reason = "differs from target_revision";
            return Err(FieldError::contradiction("target.revision", reason));
        }
        check::count("members", self.members.len(), MODULES_MAX)?;
        if self.members.is_empty() {
            let reason = "a plan needs at least one member";
            return Err(FieldError::contradiction("members", reason));
        }
        let target = self
            .target
            .validated(size)
            .map_err(|error| error.within("target"))?;
        let validate = RosterMember::validated;
        let members = check::entries("members", &self.members, MODULES_MAX, validate)?;
        check::ascending("members", members.iter().map(|member| member.module.id))?;
        let roster = ClosedRoster::from(model::Roster {
            epoch,
            target,
            members,
            voters: Voters {
                named: check::module_ids("voters", &self.voters, MODULES_MAX)?,
                removed: check::modules("removed_voters", &self.removed_voters)?,
                listed: check::modules("listed_voters", &self.listed_voters)?,
            },
            bodies: bodies("bodies", &self.bodies)?,
            timing: Timing {
                heartbeat: self.heartbeat.validated("heartbeat")?,
                suspicion: self.suspicion.validated("suspicion")?,
                lease: self.lease.validated("lease")?,
            },
        });
        // Pins must fit the target and each other; the planner's own validation knows how.
        roster
            .problem()
            .map_err(|error| FieldError::new("members", error))?;
        Ok(RosterMessage::Plan(Arc::new(roster)))
    }
}
