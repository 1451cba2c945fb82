//! CDR as the DDS library writes and reads it, for every type of the package.

use std::fmt::Debug;

use byteorder::{BigEndian, LittleEndian};
use formation_model::{self as model, ModuleId, ModuleSize};
use formation_msgs as wire;
use formation_msgs::{InterfaceType, IntoCore};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_reflection::{Registry, Tracer, TracerConfig};

/// The four bytes before the value that identify its encoding.
const ENCAPSULATION_LENGTH: usize = 4;
const BIG_ENDIAN: [u8; ENCAPSULATION_LENGTH] = [0, 0, 0, 0];
const LITTLE_ENDIAN: [u8; ENCAPSULATION_LENGTH] = [0, 1, 0, 0];

/// What a value was read as.
pub struct Decoded {
    pub value: Value,
    /// The same value, written again with the same byte order.
    pub bytes: Vec<u8>,
    /// How many bytes of the payload were read, the encapsulation included.
    pub consumed: usize,
}

/// One type of the package, with its type erased.
pub struct Codec {
    pub package: &'static str,
    pub name: &'static str,
    pub decode: fn(&[u8]) -> Result<Decoded, String>,
    /// Decodes and, if that works, makes validated data of it. Says whether both worked.
    pub accept: fn(&[u8]) -> bool,
    /// What serde says about the fields.
    pub trace: fn() -> Registry,
}

impl Codec {
    pub fn full_name(&self) -> String {
        format!("{}/msg/{}", self.package, self.name)
    }
}

pub fn full_name<T: InterfaceType>() -> String {
    format!("{}/msg/{}", T::PACKAGE, T::NAME)
}

/// The value, and how many bytes of the payload it took, the encapsulation included.
pub fn read<T: DeserializeOwned>(payload: &[u8]) -> Result<(T, usize), String> {
    let (head, body) = payload
        .split_first_chunk::<ENCAPSULATION_LENGTH>()
        .ok_or("no encapsulation")?;
    match *head {
        LITTLE_ENDIAN => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        BIG_ENDIAN => cdr_encoding::from_bytes::<T, BigEndian>(body),
        other => return Err(format!("unknown encapsulation {other:?}")),
    }
    .map(|(value, consumed)| (value, consumed + ENCAPSULATION_LENGTH))
    .map_err(|error| error.to_string())
}

pub fn encode<T: Serialize>(value: &T, little_endian: bool) -> Vec<u8> {
    let (head, body) = if little_endian {
        (
            LITTLE_ENDIAN,
            cdr_encoding::to_vec::<T, LittleEndian>(value),
        )
    } else {
        (BIG_ENDIAN, cdr_encoding::to_vec::<T, BigEndian>(value))
    };
    [&head[..], &body.unwrap()].concat()
}

/// Out as CDR in either byte order, and in again.
pub fn over_the_wire<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: T) -> T {
    for little_endian in [true, false] {
        let payload = encode(&value, little_endian);
        let arrived = read::<T>(&payload).map(|(arrived, consumed)| {
            assert_eq!(arrived, value);
            consumed
        });
        assert_eq!(arrived, Ok(payload.len()));
    }
    value
}

fn decode<T: Serialize + DeserializeOwned>(payload: &[u8]) -> Result<Decoded, String> {
    let (value, consumed) = read::<T>(payload)?;
    Ok(Decoded {
        bytes: encode(&value, payload[..ENCAPSULATION_LENGTH] == LITTLE_ENDIAN),
        value: serde_json::to_value(&value).unwrap(),
        consumed,
    })
}

fn accept<T, V>(payload: &[u8]) -> bool
where
    T: DeserializeOwned + IntoCore<V>,
{
    read::<T>(payload).is_ok_and(|(value, _)| value.into_core(ModuleSize::METRE).is_ok())
}

fn trace<T: DeserializeOwned>() -> Registry {
    let mut tracer = Tracer::new(TracerConfig::default());
    tracer.trace_simple_type::<T>().unwrap();
    tracer.registry().unwrap()
}

fn codec<T, V>() -> Codec
where
    T: InterfaceType + Serialize + DeserializeOwned + IntoCore<V>,
{
    Codec {
        accept: accept::<T, V>,
        ..part::<T>()
    }
}

/// A type that only ever travels within another one, or only goes out.
pub fn part<T: InterfaceType + Serialize + DeserializeOwned>() -> Codec {
    Codec {
        package: T::PACKAGE,
        name: T::NAME,
        decode: decode::<T>,
        accept: |payload| read::<T>(payload).is_ok(),
        trace: trace::<T>,
    }
}

/// Every type of the package, in the order of the files' names; messages before services before actions.
pub fn all() -> Vec<Codec> {
    vec![
        part::<wire::Area>(),
        part::<wire::Body>(),
        part::<wire::CausalMark>(),
        codec::<wire::DockingRequest, (ModuleId, model::DockingRequest)>(),
        codec::<wire::DockingResult, (ModuleId, model::DockingResult)>(),
        part::<wire::Edge>(),
        part::<wire::Epoch>(),
        codec::<wire::Eviction, model::EvictionNotice>(),
        part::<wire::EvictionRecord>(),
        codec::<wire::Heartbeat, Vec<model::Heartbeat>>(),
        codec::<wire::ModuleHeartbeat, model::Heartbeat>(),
        codec::<wire::ModuleState, model::ModuleState>(),
        codec::<wire::ModuleStates, Vec<model::ModuleState>>(),
        codec::<wire::OperatorCommand, Vec<model::Message>>(),
        part::<wire::PlannerParameters>(),
        part::<wire::PolicyOption>(),
        part::<wire::Progress>(),
        part::<wire::QuorumBasis>(),
        part::<wire::Removal>(),
        codec::<wire::Roster, model::RosterMessage>(),
        part::<wire::RosterMember>(),
        part::<wire::Spot>(),
        codec::<wire::SpotClaim, model::SpotClaim>(),
        part::<wire::SpotSelection>(),
        part::<wire::Stop>(),
        codec::<wire::TargetConfiguration, model::TargetAnnouncement>(),
        part::<wire::Verdict>(),
        part::<wire::AddModuleRequest>(),
        part::<wire::AddModuleResponse>(),
        part::<wire::QueryStatusRequest>(),
        part::<wire::QueryStatusResponse>(),
        part::<wire::RemoveModuleRequest>(),
        part::<wire::RemoveModuleResponse>(),
        part::<wire::RetireModuleRequest>(),
        part::<wire::RetireModuleResponse>(),
        part::<wire::StopFormationRequest>(),
        part::<wire::StopFormationResponse>(),
        part::<wire::WithdrawTargetRequest>(),
        part::<wire::WithdrawTargetResponse>(),
        part::<wire::FormConfigurationGoal>(),
        part::<wire::FormConfigurationResult>(),
        part::<wire::FormConfigurationFeedback>(),
    ]
}
