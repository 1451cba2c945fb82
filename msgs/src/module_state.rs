//! What travels on `module_states`, and the parts of it that other messages use too.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use std::time::Duration;

use formation_model::{
    self as model, ConfigurationId, Digest, DriveState, Incarnation, ModuleId, ModulePhase,
    ModuleSize, SenderTime, Service, SpotId,
};
use serde::{Deserialize, Serialize};

use crate::NONE;
use crate::body::{Body, bodies};
use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};
use crate::epoch::Epoch;
use crate::operator::{Removal, removals};
use crate::standard::{Header, Time};

/// See `CausalMark.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CausalMark {
    pub module_id: u32,
    pub sequence: u64,
}

/// See `ModuleState.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModuleState {
    pub module_id: u32,
    pub incarnation: u64,
    pub knows: bool,
    pub is_idle: bool,
    pub last_plan: u64,
    pub sequence: u64,
    pub epoch: Epoch,
    pub has_digest: bool,
    pub digest: u64,
    pub phase: u8,
    pub service: u8,
    pub stamp: Time,
    pub drive: u8,
    pub x: f64,
    pub y: f64,
    pub theta: f64,
    pub links: Vec<u32>,
    pub configuration_id: u32,
    pub leader_id: u32,
    pub spot_id: u32,
    pub unit_id: u32,
    pub on_paths: bool,
    pub steps_done: u32,
    pub settled_since: u64,
    pub waited_for: Vec<CausalMark>,
    pub agreed_on: Vec<CausalMark>,
    pub removed_voters: Vec<u32>,
    pub listed_voters: Vec<u32>,
    pub bodies: Vec<Body>,
    pub proposed_removals: Vec<Removal>,
    pub refuted_removals: Vec<Removal>,
}

/// See `ModuleStates.msg`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModuleStates {
    pub header: Header,
    pub protocol_version: u32,
    pub session: u64,
    pub modules: Vec<ModuleState>,
    pub module_size: f64,
}

impl ModuleState {
    pub const NONE: u32 = NONE;
}

enumeration! {
    ModuleState "phase": phase_to_wire, phase_from_wire => ModulePhase {
        PHASE_LISTENING LISTENING 1 = Listening,
        PHASE_GATHERED GATHERED 2 = Gathered,
        PHASE_PLANNING PLANNING 3 = Planning,
        PHASE_AGREEING AGREEING 4 = Agreeing,
        PHASE_WAITING WAITING 5 = Waiting,
        PHASE_MOVING MOVING 6 = Moving,
        PHASE_SETTLED SETTLED 7 = Settled,
        PHASE_SPARE SPARE 8 = Spare,
        PHASE_WAITING_FOR_QUORUM WAITING_FOR_QUORUM 9 = WaitingForQuorum,
        PHASE_COMPUTING COMPUTING 10 = Computing,
    }
}

enumeration! {
    ModuleState "service": service_to_wire, service_from_wire => Service {
        SERVICE_ACTIVE ACTIVE 1 = Active,
        SERVICE_RETIRED RETIRED 2 = Retired,
        SERVICE_MOTION_FAILED MOTION_FAILED 3 = MotionFailed,
    }
}

enumeration! {
    ModuleState "drive": drive_to_wire, drive_from_wire => DriveState {
        DRIVE_STANDING STANDING 1 = Standing,
        DRIVE_MOVING MOVING 2 = Moving,
        DRIVE_FOLDING FOLDING 3 = Folding,
        DRIVE_DISPLACED DISPLACED 4 = Displaced,
        DRIVE_LOST LOST 5 = Lost,
    }
}

impl From<&model::CausalMark> for CausalMark {
    fn from(mark: &model::CausalMark) -> Self {
        Self {
            module_id: mark.module.0,
            sequence: mark.sequence,
        }
    }
}

/// Marks of distinct modules.
fn marks(field: &str, raw: &[CausalMark]) -> Checked<Vec<model::CausalMark>> {
    let marks = check::entries(field, raw, MODULES_MAX, |mark| {
        Ok(model::CausalMark {
            module: check::id("module_id", mark.module_id, ModuleId)?,
            sequence: mark.sequence,
        })
    })?;
    check::distinct(field, marks.iter().map(|mark| mark.module))?;
    Ok(marks)
}

impl ModuleState {
    /// The state of a module, as it goes out.
    #[must_use]
    pub fn new(state: &model::ModuleState, size: ModuleSize) -> Self {
        let (x, y) = size.position_in_metres(&state.pose);
        Self {
            module_id: state.module.0,
            incarnation: state.incarnation.0,
            knows: state.knows,
            is_idle: state.is_idle,
            last_plan: state.last_plan.map_or(0, |digest| digest.0),
            sequence: state.sequence,
            epoch: state.epoch.as_ref().into(),
            has_digest: state.digest.is_some(),
            digest: state.digest.map_or(0, |digest| digest.0),
            phase: phase_to_wire(state.phase),
            service: service_to_wire(state.service),
            stamp: state.at.0.into(),
            drive: drive_to_wire(state.drive),
            x,
            y,
            theta: state.pose.theta.to_units(),
            links: state.links.iter().map(|link| link.0).collect(),
            configuration_id: state.configuration.map_or(NONE, |id| id.0),
            leader_id: state.leader.map_or(NONE, |id| id.0),
            spot_id: state.spot.map_or(NONE, |id| id.0),
            unit_id: state.unit.map_or(NONE, |id| id.0),
            on_paths: state.steps_done.is_some(),
            steps_done: state.steps_done.unwrap_or_default(),
            settled_since: state.settled_since,
            waited_for: state.waited_for.iter().map(CausalMark::from).collect(),
            agreed_on: state.agreed_on.iter().map(CausalMark::from).collect(),
            removed_voters: state.removed_voters.iter().map(|id| id.0).collect(),
            listed_voters: state.listed_voters.iter().map(|id| id.0).collect(),
            bodies: state.bodies.iter().map(Body::from).collect(),
            proposed_removals: state.proposed_removals.iter().map(Removal::from).collect(),
            refuted_removals: state.refuted_removals.iter().map(Removal::from).collect(),
        }
    }
}

impl ModuleState {
    fn steps_done(&self) -> Checked<Option<u32>> {
        if self.on_paths && !self.has_digest {
            let reason = "must be false without a plan";
            return Err(FieldError::contradiction("on_paths", reason));
        }
        if !self.on_paths && self.steps_done > 0 {
            let reason = "must be 0 unless the module moves along a path";
            return Err(FieldError::contradiction("steps_done", reason));
        }
        Ok(self.on_paths.then_some(self.steps_done))
    }

    pub(crate) fn validated(&self, size: ModuleSize) -> Checked<model::ModuleState> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        let epoch = self.epoch.validated()?;
        // A module cannot have settled in a state that it has yet to publish.
        check::at_most("settled_since", self.settled_since, self.sequence)?;
        Ok(model::ModuleState {
            module,
            incarnation: Incarnation(self.incarnation),
            knows: self.knows,
            is_idle: self.is_idle,
            last_plan: Some(Digest(self.last_plan)).filter(|digest| digest.0 != 0),
            sequence: self.sequence,
            epoch,
            digest: check::digest(epoch, self.has_digest, self.digest)?,
            phase: phase_from_wire(self.phase)?,
            service: service_from_wire(self.service)?,
            at: SenderTime(self.stamp.validated("stamp")?),
            drive: drive_from_wire(self.drive)?,
            pose: check::pose((self.x, self.y), self.theta, size)?,
            links: check::links(module, &self.links)?,
            configuration: check::optional_id(self.configuration_id, ConfigurationId),
            leader: check::optional_id(self.leader_id, ModuleId),
            spot: check::optional_id(self.spot_id, SpotId),
            unit: check::optional_id(self.unit_id, ModuleId),
            steps_done: self.steps_done()?,
            settled_since: self.settled_since,
            waited_for: marks("waited_for", &self.waited_for)?,
            agreed_on: marks("agreed_on", &self.agreed_on)?,
            removed_voters: check::modules("removed_voters", &self.removed_voters)?,
            listed_voters: check::modules("listed_voters", &self.listed_voters)?,
            bodies: bodies("bodies", &self.bodies)?,
            proposed_removals: removals("proposed_removals", &self.proposed_removals)?,
            refuted_removals: removals("refuted_removals", &self.refuted_removals)?
                .into_iter()
                .map(|removal| removal.run)
                .collect(),
        })
    }
}

impl ModuleStates {
    /// One sample of states of modules that a process hosts, whose clock began at `clock_zero`, the time since 1970.
    pub fn new<'a>(
        header: Header,
        clock_zero: Duration,
        states: impl IntoIterator<Item = &'a model::ModuleState>,
        size: ModuleSize,
    ) -> Self {
        let stamped = |state: &model::ModuleState| ModuleState {
            stamp: (clock_zero + state.at.0).into(),
            ..ModuleState::new(state, size)
        };
        Self {
            header,
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            modules: states.into_iter().map(stamped).collect(),
            module_size: size.metres(),
        }
    }

    /// The states of distinct modules, in the order in which they came.
    pub(crate) fn validated(self, size: ModuleSize) -> Checked<Vec<model::ModuleState>> {
        check::version(self.protocol_version)?;
        check::module_size(self.module_size, size)?;
        check::name("header.frame_id", &self.header.frame_id)?;
        let validate = |state: &ModuleState| state.validated(size);
        let states = check::entries("modules", &self.modules, MODULES_MAX, validate)?;
        check::distinct("modules", states.iter().map(|state| state.module))?;
        Ok(states)
    }
}
