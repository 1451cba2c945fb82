//! CDR as the DDS library writes and reads it, for every type of the package.

use std::fmt::Debug;

use byteorder::{BigEndian, LittleEndian};
use formation_model::{self as model, ModuleSize};
use formation_msgs as wire;
use formation_msgs::{InterfaceType, IntoCore};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_reflection::{ContainerFormat, Format, Named, Registry, Tracer, TracerConfig};

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
    /// A value in which every list has an entry, encoded.
    pub example: fn(little_endian: bool) -> (Value, Vec<u8>),
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
        example: example::<T>,
    }
}

fn example<T: InterfaceType + Serialize + DeserializeOwned>(
    little_endian: bool,
) -> (Value, Vec<u8>) {
    let registry = trace::<T>();
    // The registry has the names of Rust, which the last part of the type's name is.
    let name = std::any::type_name::<T>().rsplit("::").next().unwrap();
    let value = example_of(&Format::TypeName(name.to_owned()), &registry);
    let typed: T = serde_json::from_value(value.clone()).unwrap();
    (value, encode(&typed, little_endian))
}

fn example_of(format: &Format, registry: &Registry) -> Value {
    match format {
        Format::Bool => Value::from(true),
        Format::U8 | Format::U32 | Format::U64 => Value::from(7),
        Format::I32 | Format::I64 => Value::from(-7),
        Format::F64 => Value::from(0.75),
        Format::Str => Value::from("text"),
        Format::Seq(element) => Value::from(vec![example_of(element, registry)]),
        Format::TypeName(name) => match registry.get(name) {
            Some(ContainerFormat::Struct(fields)) => {
                let fields = fields.iter();
                let of_field = |field: &Named<Format>| example_of(&field.value, registry);
                Value::Object(
                    fields
                        .map(|field| (field.name.clone(), of_field(field)))
                        .collect(),
                )
            }
            other => panic!("{name} is {other:?}, not a struct with named fields"),
        },
        other => panic!("{other:?} is no type of a .msg file"),
    }
}

macro_rules! codecs {
    (
        msg { $($message:ident $(=> $core:ty, $topic:ident $(, $with_lengths:ident)?)?;)+ }
        srv { $($service:ident: $($part:ident = $part_name:literal),+;)+ }
        action { $($action:ident: $($section:ident = $section_name:literal),+;)+ }
    ) => {
        vec![
            $(codecs!(@ $message $(, $core)?),)+
            $($(part::<wire::$part>(),)+)+
            $($(part::<wire::$section>(),)+)+
        ]
    };
    (@ $message:ident) => {
        part::<wire::$message>()
    };
    (@ $message:ident, $core:ty) => {
        codec::<wire::$message, $core>()
    };
}

/// Every type of the package, in the order of the files' names; messages before services before actions.
pub fn all() -> Vec<Codec> {
    formation_msgs::interfaces!(codecs)
}
