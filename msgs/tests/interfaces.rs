//! The interface files and the Rust types are the same types, judged by rosbags, which parses the files and speaks CDR.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use crate::common::codec::{self, Codec};
use crate::common::python;
use crate::common::samples::samples;
use formation_msgs as wire;
use formation_msgs::bounds;
use serde::Deserialize;
use serde_json::Value;
use serde_reflection::{ContainerFormat, Format, Registry};

#[derive(Deserialize)]
struct Definition {
    constants: BTreeMap<String, i64>,
    fields: Vec<Field>,
}

/// Name, type, bound of the list, bound of the string.
type Field = (String, String, Option<usize>, Option<usize>);

#[derive(Deserialize)]
struct Produced {
    #[serde(rename = "type")]
    type_name: String,
    value: Value,
    bytes: String,
}

#[derive(Deserialize)]
struct Consumed {
    value: Value,
    bytes: String,
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

fn from_hex(text: &str) -> Vec<u8> {
    text.as_bytes()
        .chunks(2)
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

fn definitions() -> Option<BTreeMap<String, Definition>> {
    python::ask(&["definitions"], "").map(|text| serde_json::from_str(&text).unwrap())
}

/// The files of one kind: `msg`, `srv` or `action`.
fn files(kind: &str) -> BTreeSet<String> {
    std::fs::read_dir(format!("{}/{kind}", env!("CARGO_MANIFEST_DIR")))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// The text of a file, section by section: a service has two, an action three.
fn sections(kind: &str, file: &str) -> Vec<String> {
    let text =
        std::fs::read_to_string(format!("{}/{kind}/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    text.split("\n---\n").map(str::to_owned).collect()
}

/// The kinds of files, with the ends of the names of their sections.
const KINDS: [(&str, &[&str]); 3] = [
    ("msg", &[""]),
    ("srv", &["_Request", "_Response"]),
    ("action", &["_Goal", "_Result", "_Feedback"]),
];

/// A field's type as ROS 2 writes it, from what serde says.
fn interface_name(format: &Format) -> String {
    match format {
        Format::Bool => "bool".to_owned(),
        Format::U8 => "uint8".to_owned(),
        Format::U32 => "uint32".to_owned(),
        Format::U64 => "uint64".to_owned(),
        Format::I32 => "int32".to_owned(),
        Format::I64 => "int64".to_owned(),
        Format::F64 => "float64".to_owned(),
        Format::Str => "string".to_owned(),
        Format::Seq(element) => interface_name(element) + "[]",
        Format::TypeName(name) => match name.as_str() {
            "Duration" | "Time" => format!("builtin_interfaces/msg/{name}"),
            "Header" => format!("std_msgs/msg/{name}"),
            _ => format!("formation_msgs/msg/{name}"),
        },
        other => panic!("{other:?} is no type of a .msg file"),
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

#[test]
fn every_file_is_built_and_every_section_has_its_type() {
    let types: BTreeSet<String> = codec::all()
        .iter()
        .map(|codec| codec.name.to_owned())
        .collect();
    let mut found = BTreeSet::new();
    for (kind, ends) in KINDS {
        let files = files(kind);
        let embedded = wire::INTERFACES.iter().filter_map(|(name, _)| {
            let name = name.strip_prefix(&format!("formation_msgs/{kind}/"))?;
            Some(format!("{name}.{kind}"))
        });
        assert_eq!(files, embedded.collect::<BTreeSet<String>>());
        // CMake builds whatever lies in these folders.
        assert!(include_str!("../CMakeLists.txt").contains(&format!(" {kind}/*.{kind}")));
        for file in files {
            let name = file.strip_suffix(&format!(".{kind}")).unwrap();
            assert_eq!(sections(kind, &file).len(), ends.len(), "{file}");
            found.extend(ends.iter().map(|end| format!("{name}{end}")));
        }
    }
    assert_eq!(found, types);
}

#[test]
fn names_types_and_order_of_fields_agree() {
    let Some(definitions) = definitions() else {
        return;
    };
    assert_eq!(definitions.len(), codec::all().len());
    for codec in codec::all() {
        let name = codec.full_name();
        let of_file: Vec<(String, String)> = definitions[&name]
            .fields
            .iter()
            .map(|(field, kind, ..)| (field.clone(), kind.clone()))
            .collect();
        assert_eq!(
            rust_fields(&(codec.trace)(), codec.name),
            of_file,
            "{name}: Rust on the left, the file on the right"
        );
    }
}

macro_rules! constants {
    ($($type:ident: $($name:ident),+;)+) => {
        BTreeMap::from([$((
            codec::full_name::<wire::$type>(),
            BTreeMap::from([$((stringify!($name).to_owned(), i64::from(wire::$type::$name))),+]),
        )),+])
    };
}

#[test]
fn constants_agree() {
    let Some(definitions) = definitions() else {
        return;
    };
    let of_files: BTreeMap<String, BTreeMap<String, i64>> = definitions
        .into_iter()
        .map(|(name, definition)| (name, definition.constants))
        .filter(|(_, constants)| !constants.is_empty())
        .collect();
    let of_rust = constants! {
        Body: WHEREABOUTS_SEEN, WHEREABOUTS_ON_THE_WAY, WHEREABOUTS_HALTED, WHEREABOUTS_REMOVED,
            WHEREABOUTS_IN_BLOCK;
        DockingRequest: ACTION_DOCK, ACTION_UNDOCK;
        EvictionRecord: NONE;
        ModuleState:
            NONE, PHASE_LISTENING, PHASE_GATHERED, PHASE_PLANNING, PHASE_AGREEING, PHASE_WAITING,
            PHASE_MOVING, PHASE_SETTLED, PHASE_SPARE, PHASE_WAITING_FOR_QUORUM, PHASE_COMPUTING,
            SERVICE_ACTIVE, SERVICE_RETIRED, SERVICE_MOTION_FAILED, DRIVE_STANDING, DRIVE_MOVING, DRIVE_FOLDING,
            DRIVE_DISPLACED, DRIVE_LOST;
        PlannerParameters:
            ORDER_RANK, ORDER_SIZE_FIRST,
            D_MAX_UNBOUNDED, MOTION_AUTO, MOTION_PATHS, MOTION_STRAIGHT;
        Progress:
            STAGE_WAITING_FOR_TARGET, STAGE_GATHERING, STAGE_PLANNING, STAGE_AGREEING, STAGE_ACTING, STAGE_DONE;
        Roster: STAGE_GATHER, STAGE_PLAN;
        RosterMember: NONE;
        TargetConfiguration: BODY_SQUARE, BODY_CIRCLE;
        Verdict: OUTCOME_COMPLETE, OUTCOME_PARTIAL, OUTCOME_FAILED, OUTCOME_NOT_JUDGED;
    };
    assert_eq!(of_rust, of_files);
}

/// What a file states of its lists, as "At most N.": a bound in the type would have the type support of Fast DDS walk, and
/// reserve, the largest message, which takes seconds and gigabytes where bounded lists are nested.
fn stated_bounds(name: &str) -> BTreeMap<String, usize> {
    let (kind, file, section) = KINDS
        .iter()
        .flat_map(|&(kind, ends)| {
            let sections = ends.iter().enumerate();
            sections.map(move |(section, end)| (kind, end, section))
        })
        .filter_map(|(kind, end, section)| Some((kind, name.strip_suffix(end)?, section)))
        .map(|(kind, stem, section)| (kind, format!("{stem}.{kind}"), section))
        .find(|(kind, file, _)| files(kind).contains(file))
        .unwrap();
    sections(kind, &file)[section]
        .lines()
        .filter_map(|line| {
            let (declaration, comment) = line.split_once(" # ")?;
            let (_, bound) = comment.rsplit_once("At most ")?;
            let field = declaration.split_whitespace().nth(1)?;
            Some((field.to_owned(), bound.strip_suffix('.')?.parse().ok()?))
        })
        .collect()
}

#[test]
fn bounds_agree() {
    let Some(definitions) = definitions() else {
        return;
    };
    let of_files: BTreeSet<(String, Option<usize>, Option<usize>)> = definitions
        .iter()
        .flat_map(|(name, definition)| {
            let name = name.rsplit('/').next().unwrap_or_default();
            let stated = stated_bounds(name);
            definition
                .fields
                .iter()
                .filter(|(_, kind, ..)| kind.ends_with("[]") || kind == "string")
                .map(move |(field, _, list, string)| {
                    assert_eq!(
                        *list, None,
                        "{name}.{field}: a list with a bound in its type"
                    );
                    let list = stated.get(field).copied();
                    (format!("{name}.{field}"), list, *string)
                })
        })
        .collect();
    let list = |field: &str, bound| (field.to_owned(), Some(bound), None);
    let text = |field: &str, bound| (field.to_owned(), None, Some(bound));
    let of_rust = BTreeSet::from([
        list("Body.path_micro", bounds::PATH_NUMBERS_MAX),
        list("Heartbeat.misses", bounds::MODULES_MAX),
        list("Heartbeat.modules", bounds::MODULES_MAX),
        list("ModuleState.agreed_on", bounds::MODULES_MAX),
        list("ModuleState.bodies", bounds::MODULES_MAX),
        list("ModuleState.links", bounds::LINKS_MAX),
        list("ModuleState.listed_voters", bounds::MODULES_MAX),
        list("ModuleState.proposed_removals", bounds::MODULES_MAX),
        list("ModuleState.removed_voters", bounds::MODULES_MAX),
        list("ModuleState.refuted_removals", bounds::MODULES_MAX),
        list("ModuleState.waited_for", bounds::MODULES_MAX),
        list("ModuleStates.modules", bounds::MODULES_MAX),
        list("OperatorCommand.removals", bounds::MODULES_MAX),
        list(
            "PlannerParameters.policy_options",
            bounds::POLICY_OPTIONS_MAX,
        ),
        list("Progress.waiting_for", bounds::MODULES_MAX),
        list("Roster.bodies", bounds::MODULES_MAX),
        list("Roster.members", bounds::MODULES_MAX),
        list("Roster.listed_voters", bounds::MODULES_MAX),
        list("Roster.removed_voters", bounds::MODULES_MAX),
        list("Roster.voters", bounds::MODULES_MAX),
        list("RosterMember.links", bounds::LINKS_MAX),
        list("SpotClaim.detached", bounds::MODULES_MAX),
        list("SpotClaim.evictions", bounds::MODULES_MAX),
        list("SpotClaim.selections", bounds::SPOTS_MAX),
        list("SpotClaim.swaps", bounds::SPOTS_MAX),
        list("TargetConfiguration.allocation", bounds::MODULES_MAX),
        list("TargetConfiguration.detached", bounds::MODULES_MAX),
        list("TargetConfiguration.edges", bounds::EDGES_MAX),
        list("TargetConfiguration.voters", bounds::MODULES_MAX),
        list("TargetConfiguration.obstacles", bounds::OBSTACLES_MAX),
        list("TargetConfiguration.spots", bounds::SPOTS_MAX),
        list("Verdict.assignments", bounds::SPOTS_MAX),
        list("Verdict.blocked_spots", bounds::SPOTS_MAX),
        list("Verdict.open_spots", bounds::SPOTS_MAX),
        list("Verdict.unassigned_modules", bounds::MODULES_MAX),
        text("AddModule_Response.message", bounds::ANSWER_BYTES_MAX),
        text("DockingResult.reason", bounds::REASON_BYTES_MAX),
        text("FormConfiguration_Goal.scenario", bounds::NAME_BYTES_MAX),
        text("FormConfiguration_Result.message", bounds::ANSWER_BYTES_MAX),
        text("PlannerParameters.policy", bounds::NAME_BYTES_MAX),
        text("PolicyOption.key", bounds::NAME_BYTES_MAX),
        text("PolicyOption.value", bounds::NAME_BYTES_MAX),
        text("PushModule_Response.message", bounds::ANSWER_BYTES_MAX),
        text("QueryStatus_Response.target", bounds::NAME_BYTES_MAX),
        text("RemoveModule_Response.message", bounds::ANSWER_BYTES_MAX),
        text("RetireModule_Response.message", bounds::ANSWER_BYTES_MAX),
        text("StopFormation_Response.message", bounds::ANSWER_BYTES_MAX),
        text("TargetConfiguration.name", bounds::NAME_BYTES_MAX),
        text("Verdict.collision_reason", bounds::VIOLATION_BYTES_MAX),
        text("WithdrawTarget_Response.message", bounds::ANSWER_BYTES_MAX),
        (
            "Verdict.violations".to_owned(),
            Some(bounds::VIOLATIONS_MAX),
            Some(bounds::VIOLATION_BYTES_MAX),
        ),
    ]);
    assert_eq!(of_rust, of_files);
}

/// Publishers that leave out the version of the protocol speak the present one.
#[test]
fn messages_have_the_present_version_by_default() {
    let expected = format!("uint32 protocol_version {}", wire::PROTOCOL_VERSION);
    let texts = wire::INTERFACES.iter().map(|(_, text)| text);
    let versioned: Vec<_> = texts
        .filter(|text| text.contains("protocol_version"))
        .collect();
    assert_eq!(versioned.len(), 7);
    for text in versioned {
        assert!(text.contains(&expected), "{text}");
    }
}

/// The defaults that ROS 2 gives to fields that a publisher leaves out are the ones that we mean.
#[test]
fn defaults_agree() {
    let defaults = |text: &str| -> BTreeMap<String, f64> {
        text.lines()
            .filter_map(|line| {
                let content = line.split('#').next()?;
                let [_, name, default] = content.split_whitespace().collect::<Vec<_>>()[..] else {
                    return None;
                };
                let number = match default {
                    "false" => 0.0,
                    "true" => 1.0,
                    number => number.parse().ok()?,
                };
                Some((name.to_owned(), number))
            })
            .collect()
    };
    let file = include_str!("../msg/PlannerParameters.msg");
    let default = wire::PlannerParameters::default();
    assert!(file.contains(&format!("policy \"{}\"", default.policy)));
    assert!(default.policy_options.is_empty());
    let planner = serde_json::to_value(default).unwrap();
    let of_rust = planner
        .as_object()
        .unwrap()
        .iter()
        .filter(|(name, _)| !name.starts_with("policy"))
        .map(|(name, value)| {
            let number = value
                .as_f64()
                .or_else(|| value.as_bool().map(|flag| f64::from(u8::from(flag))));
            (name.clone(), number.unwrap())
        })
        .collect();
    assert_eq!(defaults(file), of_rust);
    let none = f64::from(wire::NONE);
    let unset = |names: &[&str]| {
        names
            .iter()
            .map(|&name| (name.to_owned(), none))
            .collect::<BTreeMap<_, _>>()
    };
    assert_eq!(
        defaults(include_str!("../msg/ModuleState.msg")),
        unset(&["configuration_id", "leader_id", "spot_id", "unit_id"])
    );
    assert_eq!(
        defaults(include_str!("../msg/RosterMember.msg")),
        unset(&["configuration_id", "leader_id", "pinned_spot_id"])
    );
    for (text, default) in [
        (
            include_str!("../msg/TargetConfiguration.msg"),
            wire::TargetConfiguration::default().module_size,
        ),
        (include_str!("../msg/ModuleStates.msg"), 1.0),
        (include_str!("../msg/Heartbeat.msg"), 1.0),
    ] {
        let stated = defaults(text)["module_size"];
        assert_eq!(stated.to_bits(), default.to_bits(), "{text}");
    }
    assert_eq!(
        defaults(include_str!("../msg/EvictionRecord.msg")),
        unset(&["to_spot_id"])
    );
}

#[test]
fn every_field_and_constant_is_explained() {
    for (kind, _) in KINDS {
        for file in files(kind) {
            let sections = sections(kind, &file);
            assert!(
                sections[0].starts_with("# "),
                "{file} does not say what it is"
            );
            let lines = sections.iter().flat_map(|section| section.lines());
            for line in lines.filter(|line| !line.trim().is_empty()) {
                let comment = line.split_once('#').map_or("", |(_, comment)| comment);
                let named = line.starts_with("uint32 NONE=") || line.starts_with("int32 D_MAX_");
                assert!(
                    named || comment.trim().len() >= 8,
                    "{file}: `{line}` lacks its comment"
                );
            }
        }
    }
}

#[test]
fn we_read_and_write_what_rosbags_writes() {
    let Some(lines) = python::ask(&["produce", "20260101", "40"], "") else {
        return;
    };
    let codecs: BTreeMap<String, Codec> = codec::all()
        .into_iter()
        .map(|codec| (codec.full_name(), codec))
        .collect();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for line in lines.lines() {
        let produced: Produced = serde_json::from_str(line).unwrap();
        let bytes = from_hex(&produced.bytes);
        let decoded = (codecs[&produced.type_name].decode)(&bytes)
            .unwrap_or_else(|error| panic!("{error} in {line}"));
        assert_eq!(decoded.value, produced.value, "{line}");
        assert_eq!(decoded.consumed, bytes.len(), "{line}");
        assert_eq!(to_hex(&decoded.bytes), produced.bytes, "{line}");
        *seen.entry(produced.type_name).or_default() += 1;
    }
    // Forty values of each type, in either byte order.
    assert!(seen.len() == codecs.len() && seen.values().all(|&count| count == 80));
}

#[test]
fn rosbags_reads_and_writes_what_we_write() {
    let samples = samples(40);
    let input = samples.iter().fold(String::new(), |mut text, sample| {
        let bytes = to_hex(&sample.bytes);
        writeln!(
            text,
            r#"{{"type": "{}", "bytes": "{bytes}"}}"#,
            sample.type_name
        )
        .unwrap();
        text
    });
    let Some(lines) = python::ask(&["consume"], &input) else {
        return;
    };
    let answers: Vec<Consumed> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(answers.len(), samples.len());
    let mut seen = BTreeSet::new();
    for (sample, answer) in samples.iter().zip(answers) {
        assert_eq!(answer.value, sample.value, "{}", sample.type_name);
        assert_eq!(answer.bytes, to_hex(&sample.bytes), "{}", sample.type_name);
        seen.insert(sample.type_name.clone());
    }
    let all: BTreeSet<String> = codec::all().iter().map(Codec::full_name).collect();
    assert_eq!(seen, all);
}
