//! Whatever stands on a command line or in a parameter file, it is taken or refused with a word, and nothing breaks.
//!
//! `FORMATION_FUZZ_CASES` says how many cases each test tries; `tests/soak_fuzz.sh` tries a million.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::time::Duration;

use clap::Parser;
use formation_model::MODULES_MAX;
use formation_node_support::ModuleList;
use module_agent::arguments::{AgentTiming, ModuleArguments, Motion};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use ros_runtime::arguments::RosArguments;
use ros_runtime::parameters::{Tunables, Tuned};
use ros_runtime::settings::Settings;

/// How many cases a test tries.
fn cases(usual: u32) -> ProptestConfig {
    let cases = std::env::var("FORMATION_FUZZ_CASES").ok();
    let cases = cases.map_or(usual, |cases| cases.parse().unwrap());
    ProptestConfig::with_cases(cases)
}

/// The arguments of an agent that say anything about modules, times and motion.
#[derive(Parser)]
struct Agent {
    #[command(flatten)]
    modules: ModuleArguments,
    #[command(flatten)]
    motion: Tuned<Motion>,
    #[command(flatten)]
    timing: Tuned<AgentTiming>,
}

fn value() -> impl Strategy<Value = String> {
    let odd = [
        "",
        " ",
        "0",
        "-0",
        "-1",
        "1e-300",
        "1e300",
        "inf",
        "-inf",
        "NaN",
        "0.001",
        "604800",
        "604801",
        "4294967295",
        "4294967296",
        "18446744073709551616",
        "0x10",
        "1_000",
        "\u{661}",
        "1-",
        "-5",
        "1-4294967294",
        "4-1",
        "1,1",
        ",",
        "1,2,3-9",
        "a:=b",
        ":=",
        "__ns:=",
        "/:=//",
        "{}",
        "~",
        "~/x",
        "rostopic://a",
        "[",
        "]",
        "!!binary x",
        "\u{0}",
        "*a",
        "&a [*a]",
        "{a: {b: {c: 1}}}",
    ];
    prop_oneof![
        4 => select(odd.to_vec()).prop_map(str::to_owned),
        1 => any::<f64>().prop_map(|number| number.to_string()),
        1 => any::<i64>().prop_map(|number| number.to_string()),
        1 => "\\PC{0,12}",
    ]
}

fn flag() -> impl Strategy<Value = String> {
    let flags = [
        "--module",
        "--modules",
        "--x",
        "--y",
        "--theta",
        "--link",
        "--configuration",
        "--leader",
        "--speed",
        "--heartbeat-s",
        "--suspicion-s",
        "--lease-s",
        "--convene-s",
        "--gather-s",
        "--gather-limit-s",
        "--stuck-s",
        "--motion-limit-s",
        "--epoch-interval-s",
        "--pose-interval-s",
        "--plan-only",
    ];
    select(flags.to_vec()).prop_map(str::to_owned)
}

fn ros_word() -> impl Strategy<Value = String> {
    let words = [
        "--ros-args",
        "--",
        "-r",
        "--remap",
        "-p",
        "--param",
        "--params-file",
        "--log-level",
        "-e",
        "--enclave",
        "--log-config-file",
        "--enable-rosout-logs",
        "--disable-stdout-logs",
        "--params-file=x",
        "--log-level=a:=b",
    ];
    prop_oneof![
        2 => select(words.to_vec()).prop_map(str::to_owned),
        1 => value(),
        1 => (value(), value()).prop_map(|(name, value)| format!("{name}:={value}")),
    ]
}

fn yaml_word() -> impl Strategy<Value = String> {
    let words = [
        "/**:\n",
        "  ros__parameters:\n",
        "    ",
        "a: ",
        "a.b: ",
        "[1, 2.0, x]",
        "{",
        "}",
        "[",
        "]",
        "- ",
        "\n",
        "1",
        "1.5",
        "true",
        "null",
        "\"",
        "'",
        "&a ",
        "*a",
        "!!set ",
        "18446744073709551615",
        ".nan",
        "? ",
        "\t",
        "\u{0}",
    ];
    select(words.to_vec()).prop_map(str::to_owned)
}

proptest! {
    #![proptest_config(cases(500))]

    #[test]
    fn times_that_are_taken_are_times(text in value()) {
        let argument = format!("--gather-limit-s={text}");
        let words = ["agent", "--module", "7", "--x", "1", "--y", "2", &argument];
        if let Ok(agent) = Agent::try_parse_from(words) {
            let time = agent.timing.0.0.gather_limit;
            prop_assert!(time >= Duration::from_millis(1) && time <= Duration::from_secs(604_800));
        }
    }

    #[test]
    fn lists_of_modules_are_bounded_distinct_and_ascending(parts in vec(value(), 0..6)) {
        if let Ok(list) = parts.join(",").parse::<ModuleList>() {
            prop_assert!((1..=MODULES_MAX).contains(&list.modules().len()));
            prop_assert!(list.modules().is_sorted_by(|one, other| one < other));
        }
    }

    #[test]
    fn agents_start_on_safe_times_or_not_at_all(pairs in vec((flag(), value()), 0..8)) {
        let words = pairs.iter().flat_map(|(flag, value)| [flag.as_str(), value.as_str()]);
        let base = ["agent", "--module", "7", "--x", "1", "--y", "2"];
        let Ok(agent) = Agent::try_parse_from(base.into_iter().chain(words)) else {
            return Ok(());
        };
        let AgentTiming(times) = agent.timing.0;
        if agent.timing.0.check().is_ok() {
            prop_assert!(times.heartbeat < times.lease && times.lease < times.suspicion);
        }
        if let Ok(hosted) = agent.modules.resolve(&mut Settings::default()) {
            prop_assert!(!hosted.modules.is_empty());
        }
    }

    #[test]
    fn arguments_for_ros_are_taken_or_refused(
        words in vec(ros_word(), 0..10),
        file in vec(yaml_word(), 0..30),
        bytes in vec(any::<u8>(), 0..8),
    ) {
        let text = file.concat();
        let arguments = ["agent", "--ros-args"].map(OsString::from).into_iter();
        let arguments = arguments.chain(words.into_iter().map(OsString::from));
        let arguments = arguments.chain([OsString::from_vec(bytes)]);
        if let Err(error) = RosArguments::extract(arguments, |_| Ok(text.clone())) {
            prop_assert!(!error.is_empty());
        }
    }
}
