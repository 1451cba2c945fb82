//! What travels on `module_states`, and the parts of it that other messages use too.

use formation::model::{
    self, ConfigurationId, Incarnation, ModuleId, ModulePhase, Service, SpotId,
};
use serde::{Deserialize, Serialize};

use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError};
use crate::epoch::{Epoch, QuorumBasis, quorum_bases};
use crate::error::{Fault, MessageError};
use crate::standard::Header;
use crate::{NONE, topic};

/// See `CausalMark.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct CausalMark {
    pub module_id: u32,
    pub sequence: u64,
}

/// See `ModuleState.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct ModuleState {
    pub module_id: u32,
    pub incarnation: u64,
    pub sequence: u64,
    pub epoch: Epoch,
    pub has_digest: bool,
    pub digest: u64,
    pub phase: u8,
    pub service: u8,
    pub x: f64,
    pub y: f64,
    pub theta: f64,
    pub links: Vec<u32>,
    pub configuration_id: u32,
    pub leader_id: u32,
    pub spot_id: u32,
    pub unit_id: u32,
    pub settled_since: u64,
    pub waited_for: Vec<CausalMark>,
    pub agreed_on: Vec<CausalMark>,
    pub quorum_bases: Vec<QuorumBasis>,
}

/// See `ModuleStates.msg`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct ModuleStates {
    pub header: Header,
    pub modules: Vec<ModuleState>,
}

#[expect(missing_docs, reason = "the .msg file documents the constants")]
impl ModuleState {
    pub const NONE: u32 = NONE;
    pub const PHASE_LISTENING: u8 = 1;
    pub const PHASE_GATHERED: u8 = 2;
    pub const PHASE_PLANNING: u8 = 3;
    pub const PHASE_AGREEING: u8 = 4;
    pub const PHASE_WAITING: u8 = 5;
    pub const PHASE_MOVING: u8 = 6;
    pub const PHASE_SETTLED: u8 = 7;
    pub const PHASE_SPARE: u8 = 8;
    pub const PHASE_WAITING_FOR_QUORUM: u8 = 9;
    pub const SERVICE_ACTIVE: u8 = 1;
    pub const SERVICE_RETIRED: u8 = 2;
    pub const SERVICE_MOTION_FAILED: u8 = 3;
}

pub(crate) fn phase_to_wire(phase: ModulePhase) -> u8 {
    match phase {
        ModulePhase::Listening => ModuleState::PHASE_LISTENING,
        ModulePhase::Gathered => ModuleState::PHASE_GATHERED,
        ModulePhase::Planning => ModuleState::PHASE_PLANNING,
        ModulePhase::Agreeing => ModuleState::PHASE_AGREEING,
        ModulePhase::Waiting => ModuleState::PHASE_WAITING,
        ModulePhase::Moving => ModuleState::PHASE_MOVING,
        ModulePhase::Settled => ModuleState::PHASE_SETTLED,
        ModulePhase::Spare => ModuleState::PHASE_SPARE,
        ModulePhase::WaitingForQuorum => ModuleState::PHASE_WAITING_FOR_QUORUM,
    }
}

pub(crate) fn phase_from_wire(value: u8) -> Checked<ModulePhase> {
    Ok(match value {
        ModuleState::PHASE_LISTENING => ModulePhase::Listening,
        ModuleState::PHASE_GATHERED => ModulePhase::Gathered,
        ModuleState::PHASE_PLANNING => ModulePhase::Planning,
        ModuleState::PHASE_AGREEING => ModulePhase::Agreeing,
        ModuleState::PHASE_WAITING => ModulePhase::Waiting,
        ModuleState::PHASE_MOVING => ModulePhase::Moving,
        ModuleState::PHASE_SETTLED => ModulePhase::Settled,
        ModuleState::PHASE_SPARE => ModulePhase::Spare,
        ModuleState::PHASE_WAITING_FOR_QUORUM => ModulePhase::WaitingForQuorum,
        value => {
            let known = "LISTENING 1, GATHERED 2, PLANNING 3, AGREEING 4, WAITING 5, MOVING 6, SETTLED 7, \
                         SPARE 8, WAITING_FOR_QUORUM 9";
            let value = value.into();
            return Err(FieldError::new(
                "phase",
                Fault::UnknownValue { value, known },
            ));
        }
    })
}

pub(crate) fn service_to_wire(service: Service) -> u8 {
    match service {
        Service::Active => ModuleState::SERVICE_ACTIVE,
        Service::Retired => ModuleState::SERVICE_RETIRED,
        Service::MotionFailed => ModuleState::SERVICE_MOTION_FAILED,
    }
}

pub(crate) fn service_from_wire(value: u8) -> Checked<Service> {
    Ok(match value {
        ModuleState::SERVICE_ACTIVE => Service::Active,
        ModuleState::SERVICE_RETIRED => Service::Retired,
        ModuleState::SERVICE_MOTION_FAILED => Service::MotionFailed,
        value => {
            let (value, known) = (value.into(), "ACTIVE 1, RETIRED 2, MOTION_FAILED 3");
            return Err(FieldError::new(
                "service",
                Fault::UnknownValue { value, known },
            ));
        }
    })
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
    check::count(field, raw.len(), MODULES_MAX)?;
    let marks = raw
        .iter()
        .enumerate()
        .map(|(index, mark)| {
            Ok(model::CausalMark {
                module: check::id("module_id", mark.module_id, ModuleId)
                    .map_err(|error| error.within_entry(field, index))?,
                sequence: mark.sequence,
            })
        })
        .collect::<Checked<Vec<_>>>()?;
    check::distinct(field, marks.iter().map(|mark| mark.module))?;
    Ok(marks)
}

impl From<&model::ModuleState> for ModuleState {
    fn from(state: &model::ModuleState) -> Self {
        Self {
            module_id: state.module.0,
            incarnation: state.incarnation.0,
            sequence: state.sequence,
            epoch: state.epoch.as_ref().into(),
            has_digest: state.digest.is_some(),
            digest: state.digest.map_or(0, |digest| digest.0),
            phase: phase_to_wire(state.phase),
            service: service_to_wire(state.service),
            x: state.pose.x.to_units(),
            y: state.pose.y.to_units(),
            theta: state.pose.theta.to_units(),
            links: state.links.iter().map(|link| link.0).collect(),
            configuration_id: state.configuration.map_or(NONE, |id| id.0),
            leader_id: state.leader.map_or(NONE, |id| id.0),
            spot_id: state.spot.map_or(NONE, |id| id.0),
            unit_id: state.unit.map_or(NONE, |id| id.0),
            settled_since: state.settled_since,
            waited_for: state.waited_for.iter().map(CausalMark::from).collect(),
            agreed_on: state.agreed_on.iter().map(CausalMark::from).collect(),
            quorum_bases: state.quorum_bases.iter().map(QuorumBasis::from).collect(),
        }
    }
}

impl TryFrom<ModuleState> for model::ModuleState {
    type Error = MessageError;

    fn try_from(state: ModuleState) -> Result<Self, MessageError> {
        state
            .validated()
            .map_err(|error| error.on(topic::MODULE_STATES))
    }
}

impl ModuleState {
    fn validated(&self) -> Checked<model::ModuleState> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        let epoch = self.epoch.validated()?;
        Ok(model::ModuleState {
            module,
            incarnation: Incarnation(self.incarnation),
            sequence: self.sequence,
            epoch,
            digest: check::digest(epoch, self.has_digest, self.digest)?,
            phase: phase_from_wire(self.phase)?,
            service: service_from_wire(self.service)?,
            pose: check::pose(self.x, self.y, self.theta)?,
            links: check::links(module, &self.links)?,
            configuration: check::optional_id(self.configuration_id, ConfigurationId),
            leader: check::optional_id(self.leader_id, ModuleId),
            spot: check::optional_id(self.spot_id, SpotId),
            unit: check::optional_id(self.unit_id, ModuleId),
            settled_since: settled_since(self.settled_since, self.sequence)?,
            waited_for: marks("waited_for", &self.waited_for)?,
            agreed_on: marks("agreed_on", &self.agreed_on)?,
            quorum_bases: quorum_bases("quorum_bases", &self.quorum_bases)?,
        })
    }
}

/// A module cannot have settled in a state that it has yet to publish.
fn settled_since(since: u64, sequence: u64) -> Checked<u64> {
    if since > sequence {
        return Err(FieldError::new(
            "settled_since",
            Fault::TooGreat {
                value: since,
                limit: sequence,
            },
        ));
    }
    Ok(since)
}

impl ModuleStates {
    /// One sample of the states of all modules that a process hosts.
    pub fn new<'a>(
        header: Header,
        states: impl IntoIterator<Item = &'a model::ModuleState>,
    ) -> Self {
        Self {
            header,
            modules: states.into_iter().map(ModuleState::from).collect(),
        }
    }
}

impl TryFrom<ModuleStates> for Vec<model::ModuleState> {
    type Error = MessageError;

    /// The states of distinct modules, in the order in which they came.
    fn try_from(sample: ModuleStates) -> Result<Self, MessageError> {
        let validated = || {
            check::name("header.frame_id", &sample.header.frame_id)?;
            check::count("modules", sample.modules.len(), MODULES_MAX)?;
            let states = sample
                .modules
                .iter()
                .enumerate()
                .map(|(index, state)| {
                    state
                        .validated()
                        .map_err(|error| error.within_entry("modules", index))
                })
                .collect::<Checked<Vec<_>>>()?;
            check::distinct("modules", states.iter().map(|state| state.module))?;
            Ok(states)
        };
        validated().map_err(|error: FieldError| error.on(topic::MODULE_STATES))
    }
}
