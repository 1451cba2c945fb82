//! The messages of other packages, compared with rosbags' definitions of ROS 2 Jazzy, which we did not write.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeMap;

use crate::common::codec::{Codec, part};
use crate::common::python;
use formation_model::{self as model, DockingAction, ModuleSize};
use formation_msgs::external::geometry_msgs::{
    Point, Pose, PoseStamped, PoseWithCovariance, Quaternion, Transform, TransformStamped, Twist,
    TwistWithCovariance, Vector3,
};
use formation_msgs::external::nav_msgs::{Odometry, Path};
use formation_msgs::external::sensor_msgs::CompressedImage;
use formation_msgs::external::std_msgs::ColorRGBA;
use formation_msgs::external::tf2_msgs::TFMessage;
use formation_msgs::external::visualization_msgs::{Marker, MarkerArray, MeshFile, UVCoordinate};
use formation_msgs::{self as wire, DriverPose, Header, IntoCore};
use serde::Deserialize;
use serde_json::Value;
use serde_reflection::{ContainerFormat, Format, Registry};

fn all() -> Vec<Codec> {
    vec![
        part::<ColorRGBA>(),
        part::<CompressedImage>(),
        part::<Marker>(),
        part::<MarkerArray>(),
        part::<MeshFile>(),
        part::<Odometry>(),
        part::<Path>(),
        part::<Point>(),
        part::<Pose>(),
        part::<PoseStamped>(),
        part::<PoseWithCovariance>(),
        part::<Quaternion>(),
        part::<TFMessage>(),
        part::<Transform>(),
        part::<TransformStamped>(),
        part::<Twist>(),
        part::<TwistWithCovariance>(),
        part::<UVCoordinate>(),
        part::<Vector3>(),
    ]
}

fn package_of(name: &str) -> String {
    match name {
        "Duration" | "Time" => "builtin_interfaces".to_owned(),
        "Header" => "std_msgs".to_owned(),
        _ => all()
            .iter()
            .find(|codec| codec.name == name)
            .map(|codec| codec.package.to_owned())
            .unwrap_or_else(|| panic!("{name} is compared with nothing")),
    }
}

fn length_of(format: &Format) -> (String, usize) {
    match format {
        Format::TupleArray { content, size } => {
            let (element, length) = length_of(content);
            (element, length * size)
        }
        other => (interface_name(other), 1),
    }
}

/// A field's type as ROS 2 writes it, from what serde says.
fn interface_name(format: &Format) -> String {
    match format {
        Format::Bool => "bool".to_owned(),
        Format::U8 => "uint8".to_owned(),
        Format::U32 => "uint32".to_owned(),
        Format::I32 => "int32".to_owned(),
        Format::F32 => "float32".to_owned(),
        Format::F64 => "float64".to_owned(),
        Format::Str => "string".to_owned(),
        Format::Seq(element) => interface_name(element) + "[]",
        Format::TypeName(name) => format!("{}/msg/{name}", package_of(name)),
        Format::TupleArray { .. } => {
            let (element, length) = length_of(format);
            format!("{element}[{length}]")
        }
        other => panic!("{other:?} is no type of these messages"),
    }
}

fn rust_fields(registry: &Registry, name: &str) -> Vec<(String, String)> {
    match registry.get(name) {
        Some(ContainerFormat::Struct(fields)) => fields
            .iter()
            .map(|field| (field.name.clone(), interface_name(&field.value)))
            .collect(),
        other => panic!("{name} is {other:?}, not a struct with named fields"),
    }
}

#[derive(Deserialize)]
struct Definition {
    fields: Vec<(String, String, Option<usize>, Option<usize>)>,
}

#[derive(Deserialize)]
struct Produced {
    #[serde(rename = "type")]
    type_name: String,
    value: Value,
    bytes: String,
}

fn names() -> Vec<String> {
    all().iter().map(Codec::full_name).collect()
}

fn ask(arguments: &[&str]) -> Option<String> {
    let names = names();
    let arguments: Vec<&str> = arguments
        .iter()
        .copied()
        .chain(names.iter().map(String::as_str))
        .collect();
    python::ask(&arguments, "")
}

#[test]
fn names_types_and_order_of_fields_agree() {
    let Some(text) = ask(&["definitions"]) else {
        return;
    };
    let definitions: BTreeMap<String, Definition> = serde_json::from_str(&text).unwrap();
    for codec in all() {
        let of_ros: Vec<(String, String)> = definitions[&codec.full_name()]
            .fields
            .iter()
            .map(|(field, kind, ..)| (field.clone(), kind.clone()))
            .collect();
        assert_eq!(
            rust_fields(&(codec.trace)(), codec.name),
            of_ros,
            "{}: ours on the left",
            codec.full_name()
        );
    }
}

/// Numbers as they are after passing through single precision, since JSON writes both precisions alike.
fn narrowed(value: &Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            #[expect(clippy::cast_possible_truncation, reason = "that is the point")]
            let narrow = number.as_f64().unwrap() as f32;
            f64::from(narrow).into()
        }
        Value::Array(entries) => entries.iter().map(narrowed).collect(),
        Value::Object(fields) => fields
            .iter()
            .map(|(name, field)| (name.clone(), narrowed(field)))
            .collect::<serde_json::Map<_, _>>()
            .into(),
        other => other.clone(),
    }
}

/// Six rows of six are written as ROS 2 does: thirty-six numbers.
fn flattened(value: &Value) -> Value {
    match value {
        Value::Array(rows) if !rows.is_empty() && rows.iter().all(Value::is_array) => rows
            .iter()
            .flat_map(|row| row.as_array().unwrap().clone())
            .collect(),
        Value::Array(entries) => entries.iter().map(flattened).collect(),
        Value::Object(fields) => fields
            .iter()
            .map(|(name, field)| (name.clone(), flattened(field)))
            .collect::<serde_json::Map<_, _>>()
            .into(),
        other => other.clone(),
    }
}

#[test]
fn we_read_and_write_what_rosbags_writes() {
    let Some(lines) = ask(&["produce", "20260102", "20"]) else {
        return;
    };
    let codecs: BTreeMap<String, Codec> = all()
        .into_iter()
        .map(|codec| (codec.full_name(), codec))
        .collect();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for line in lines.lines() {
        let produced: Produced = serde_json::from_str(line).unwrap();
        let bytes: Vec<u8> = (0..produced.bytes.len())
            .step_by(2)
            .map(|at| u8::from_str_radix(&produced.bytes[at..at + 2], 16).unwrap())
            .collect();
        let decoded = (codecs[&produced.type_name].decode)(&bytes)
            .unwrap_or_else(|error| panic!("{error} in {line}"));
        assert_eq!(
            narrowed(&flattened(&decoded.value)),
            narrowed(&produced.value),
            "{line}"
        );
        assert_eq!(decoded.consumed, bytes.len(), "{line}");
        assert_eq!(decoded.bytes, bytes, "{line}");
        *seen.entry(produced.type_name).or_default() += 1;
    }
    assert!(seen.len() == codecs.len() && seen.values().all(|&count| count == 40));
}

fn stamped(frame_id: &str, pose: Pose) -> PoseStamped {
    PoseStamped {
        header: Header {
            frame_id: frame_id.to_owned(),
            ..Header::default()
        },
        pose,
    }
}

#[test]
fn poses_survive_the_way_out_and_in() {
    for (theta, metres) in [0.0, 1.0, -1.0, 3.1, -3.1, 1.5]
        .into_iter()
        .flat_map(|theta| [(theta, 1.0), (theta, 0.08)])
    {
        let size = ModuleSize::from_metres(metres).unwrap();
        let pose = model::Pose::from_units(-3.25, 1e6, theta).unwrap();
        let sent = Pose::new(&pose, size);
        assert!((sent.position.x + 3.25 * metres).abs() < 1e-12);
        let back = stamped("map", sent).in_frame("map", size).unwrap();
        assert_eq!((back.x, back.y), (pose.x, pose.y));
        assert!(
            (back.theta.0 - pose.theta.0).abs() <= 1,
            "{theta}: {back:?}"
        );
    }
}

#[test]
fn a_covariance_gives_the_deviation_along_its_longest_axis_if_it_is_one() {
    let stated = |x: f64, y: f64, across: f64| {
        let mut message = Odometry {
            header: Header::default(),
            child_frame_id: String::new(),
            pose: PoseWithCovariance {
                pose: Pose::default(),
                covariance: [[0.0; 6]; 6],
            },
            twist: TwistWithCovariance::default(),
        };
        message.pose.covariance[0] = [x, across, 7.0, 7.0, 7.0, 7.0];
        message.pose.covariance[1] = [across, y, 7.0, 7.0, 7.0, 7.0];
        let size = ModuleSize::from_metres(0.5).unwrap();
        message
            .deviation(size)
            .map(|deviation| deviation.to_units())
    };
    assert_eq!(stated(0.0004, 0.0001, 0.0), Some(0.04));
    assert_eq!(stated(0.0001, 0.0004, 0.0), Some(0.04));
    // By 45 degrees: 0.0005 along one diagonal, 0.0001 along the other.
    assert_eq!(stated(0.0003, 0.0003, 0.0002), Some(0.044_721));
    assert_eq!(stated(1e12, 0.0, 0.0), Some(1_000.0));
    for nonsense in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(stated(nonsense, nonsense, 0.0), None, "{nonsense}");
    }
    let pose = stamped("map", Pose::default());
    assert_eq!(pose.deviation(ModuleSize::METRE), None);
}

#[test]
fn a_pose_that_cannot_be_used_is_refused_with_its_field() {
    let refused = |message: &PoseStamped| {
        message
            .in_frame("map", ModuleSize::METRE)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused(&stamped("odom", Pose::default())),
        "pose: header.frame_id: must be `map`, the frame of all poses, got `odom`"
    );
    let mut unset = stamped("map", Pose::default());
    unset.pose.orientation.w = 0.0;
    assert_eq!(
        refused(&unset),
        "pose: pose.orientation: is no rotation: its length must be 1, got 0"
    );
    unset.pose.orientation.w = f64::NAN;
    assert!(refused(&unset).contains("pose.orientation"));
    let mut far = stamped("map", Pose::default());
    far.pose.position.y = f64::INFINITY;
    assert!(
        refused(&far).starts_with("pose: pose.position.y: "),
        "{}",
        refused(&far)
    );
}

#[test]
fn docking_requests_and_results_survive_the_way_out_and_in() {
    let module = model::ModuleId(4);
    for action in [DockingAction::Dock, DockingAction::Undock] {
        let request = model::DockingRequest {
            request: 77,
            action,
            other: model::ModuleId(9),
        };
        let sent = wire::DockingRequest::new(Header::default(), module, &request);
        let back = sent.clone().into_core(ModuleSize::METRE).unwrap();
        assert_eq!(back, (module, request));
        let unknown = wire::DockingRequest { action: 3, ..sent };
        let refused = unknown.into_core(ModuleSize::METRE).unwrap_err();
        assert!(
            refused.to_string().starts_with("docking: action: "),
            "{refused}"
        );
    }
    for outcome in [Ok(()), Err("the ports are blocked".to_owned())] {
        let result = model::DockingResult {
            request: 77,
            outcome,
        };
        let sent = wire::DockingResult::new(Header::default(), module, result.clone());
        let back = sent.into_core(ModuleSize::METRE).unwrap();
        assert_eq!(back, (module, result));
    }
}
