//! What the design articles of ROS 2 say, row by row: "ROS Command Line Arguments" (arguments), "Remapping Names"
//! (remapping) and "Topic and Service name mapping to DDS" (names).

use std::ffi::OsString;
use std::io;
use std::path::Path;

use ros2_client::ParameterValue;

use super::*;
use crate::arguments::Namespace;

/// What is asked of a node that was started so.
enum Ask {
    /// The fully qualified name of its topic.
    Topic(&'static str),
    /// The fully qualified name of its service.
    Service(&'static str),
    /// Its own fully qualified name.
    Node,
    /// The value of a parameter.
    Parameter(&'static str),
    /// Its own arguments, without those for ROS 2.
    Own,
    /// The level of a logger, and whether lines go to `/rosout` and to the console.
    Log(&'static str),
}
use Ask::{Log, Node, Own, Parameter, Service, Topic};

/// The node in question: it calls itself `camera` in `/ns`, unless the row says otherwise.
const NODE: &str = "camera";
const NAMESPACE: &str = "/ns";

struct Row {
    /// What the command line says behind the program's name.
    line: &'static str,
    ask: Ask,
    /// The answer, or, after `error: `, a part of the error.
    answer: &'static str,
}

const fn row(line: &'static str, ask: Ask, answer: &'static str) -> Row {
    Row { line, ask, answer }
}

const NAMES: [Row; 27] = [
    // A name is absolute, relative or private.
    row("", Topic("/foo"), "/foo"),
    row("", Topic("foo"), "/ns/foo"),
    row("", Topic("foo/bar"), "/ns/foo/bar"),
    row("", Topic("~/foo"), "/ns/camera/foo"),
    row("", Topic("~"), "/ns/camera"),
    row("", Service("~/get_parameters"), "/ns/camera/get_parameters"),
    // What stands in braces is substituted.
    row("", Topic("{node}/foo"), "/ns/camera/foo"),
    row("", Topic("/{node}/foo"), "/camera/foo"),
    row("", Topic("{ns}/foo"), "/ns/foo"),
    row("", Topic("{namespace}/foo_{node}"), "/ns/foo_camera"),
    row("--ros-args -r __ns:=/", Topic("{ns}/foo"), "/foo"),
    row("", Topic("{robot}/foo"), "error: knows no `{robot}`"),
    row("", Topic("{node/foo"), "error: without its counterpart"),
    row("", Topic("node}/foo"), "error: without its counterpart"),
    // What no name may be.
    row("", Topic(""), "error: must not be empty"),
    row("", Topic("/"), "error: must not be empty"),
    row("", Topic("foo/"), "error: must not end with `/`"),
    row("", Topic("foo//bar"), "error: two slashes in a row"),
    row("", Topic("foo__bar"), "error: two underscores in a row"),
    row(
        "",
        Topic("2foo"),
        "error: begin with a digit, but `2foo` does",
    ),
    row(
        "",
        Topic("foo/2bar"),
        "error: begin with a digit, but `2bar` does",
    ),
    row("", Topic("foo2/_bar"), "/ns/foo2/_bar"),
    row("", Topic("foo bar"), "error: has ` `"),
    row("", Topic("foo-bar"), "error: has `-`"),
    row(
        "",
        Topic("~foo"),
        "error: `~` must come first and be followed by `/`",
    ),
    row("", Topic("foo/~"), "error: `~` must come first"),
    row("--ros-args -r a:=/b/{node}", Topic("a"), "/b/camera"),
];

const REMAPPING: [Row; 33] = [
    // Both sides are made fully qualified first.
    row("--ros-args -r foo:=bar", Topic("foo"), "/ns/bar"),
    row("--ros-args --remap foo:=bar", Topic("foo"), "/ns/bar"),
    row("--ros-args -r foo:=bar", Topic("/ns/foo"), "/ns/bar"),
    row("--ros-args -r foo:=bar", Topic("/foo"), "/foo"),
    row("--ros-args -r foo:=bar", Service("foo"), "/ns/bar"),
    row("--ros-args -r /ns/foo:=/other", Topic("foo"), "/other"),
    row(
        "--ros-args -r /ns/bar:=/ns/foo",
        Topic("barista"),
        "/ns/barista",
    ),
    row("--ros-args -r foo:=/foo/bar", Topic("foo"), "/foo/bar"),
    row("--ros-args -r /foo/bar:=foo", Topic("/foo/bar"), "/ns/foo"),
    row("--ros-args -r ~/foo:=foo", Topic("~/foo"), "/ns/foo"),
    row("--ros-args -r foo:=~/foo", Topic("foo"), "/ns/camera/foo"),
    // A scheme restricts a rule to topics or services.
    row("--ros-args -r rostopic://foo:=bar", Topic("foo"), "/ns/bar"),
    row(
        "--ros-args -r rostopic://foo:=bar",
        Service("foo"),
        "/ns/foo",
    ),
    row(
        "--ros-args -r rosservice:///ns/foo:=bar",
        Service("foo"),
        "/ns/bar",
    ),
    row(
        "--ros-args -r rosservice://foo:=bar",
        Topic("foo"),
        "/ns/foo",
    ),
    row(
        "--ros-args -r rosparam://foo:=bar",
        Topic("foo"),
        "error: only `rostopic://`",
    ),
    row(
        "--ros-args -r foo:=rostopic://bar",
        Topic("foo"),
        "error: takes no `rostopic://`",
    ),
    // A rule may be for one node of the process.
    row("--ros-args -r camera:foo:=bar", Topic("foo"), "/ns/bar"),
    row("--ros-args -r lidar:foo:=bar", Topic("foo"), "/ns/foo"),
    row(
        "--ros-args -r camera:rostopic://foo:=bar",
        Topic("foo"),
        "/ns/bar",
    ),
    row(
        "--ros-args -r 2camera:foo:=bar",
        Topic("foo"),
        "error: before `:`",
    ),
    // The first rule that fits holds, and is not applied twice; naming the node gives no precedence.
    row(
        "--ros-args -r foo:=first -r foo:=second",
        Topic("foo"),
        "/ns/first",
    ),
    row(
        "--ros-args -r foo:=bar -r bar:=baz",
        Topic("foo"),
        "/ns/bar",
    ),
    row(
        "--ros-args -r camera:foo:=first -r foo:=second",
        Topic("foo"),
        "/ns/first",
    ),
    row(
        "--ros-args -r foo:=first -r camera:foo:=second",
        Topic("foo"),
        "/ns/first",
    ),
    // Wildcards are in the article, but not in ROS 2.
    row(
        "--ros-args -r /foo/*:=/bar",
        Topic("/foo/bar"),
        "error: has `*`",
    ),
    // The node's name and namespace.
    row(
        "--ros-args -r __ns:=/new/space",
        Topic("foo"),
        "/new/space/foo",
    ),
    row("--ros-args -r __node:=left", Topic("~/foo"), "/ns/left/foo"),
    row("--ros-args -r __name:=left", Node, "/ns/left"),
    row(
        "--ros-args -r camera:__node:=left -r left:__ns:=/l",
        Node,
        "/l/left",
    ),
    row(
        "--ros-args -r __ns:=/first -r __ns:=/second",
        Node,
        "/first/camera",
    ),
    row(
        "--ros-args -r __ns:=relative",
        Node,
        "error: the namespace must begin with `/`",
    ),
    row(
        "--ros-args -r __node:=a/b",
        Node,
        "error: the node's name must consist of",
    ),
];

/// The file that the design article works through, for this node, and a nested one.
const FILE: &str = "
/ns/camera:
    ros__parameters:
        my_int: 1
        my_int: 2
        another_int: 1
        my_float: 1.0
        another_float: 1.0
/ns/camera:
    ros__parameters:
        another_int: 2
/**:
    ros__parameters:
        my_int: 3
        global_int: 1
";
const NESTED: &str = "
ns:
  camera: {ros__parameters: {lens: {zoom: 2}, words: [a, b], mixed: [1, 2.5], gone: 1}}
/ns/*: {ros__parameters: {one_level: true}}
/*: {ros__parameters: {another_level: true}}
/ns/**: {ros__parameters: {below: true, gone: 2}}
lidar: {ros__parameters: {other: true}}
";

const ARGUMENTS: [Row; 47] = [
    // Which arguments are meant for ROS 2.
    row("--speed 2", Own, "--speed 2"),
    row("a --ros-args -r foo:=bar -- b", Own, "a b"),
    row("a --ros-args", Own, "a"),
    row("--ros-args -- a", Own, "a"),
    row("--ros-args -r a:=b -- x --ros-args -r c:=d", Own, "x"),
    row(
        "--ros-args -r a:=b -- x --ros-args -r c:=d",
        Topic("c"),
        "/ns/d",
    ),
    row("--ros-args --ros-args -r a:=b", Topic("a"), "/ns/b"),
    row("foo:=bar", Own, "error: must stand behind `--ros-args -r`"),
    // What is not known is not ignored.
    row(
        "--ros-args --remp a:=b",
        Own,
        "error: did you mean `--remap`?",
    ),
    row(
        "--ros-args --parms-file x",
        Own,
        "error: did you mean `--params-file`?",
    ),
    row(
        "--ros-args --disable-rosout-log",
        Own,
        "error: did you mean `--disable-rosout-logs`?",
    ),
    row(
        "--ros-args foo:=bar",
        Own,
        "error: unknown argument `foo:=bar`",
    ),
    row("--ros-args -r", Own, "error: `-r` needs a value"),
    row(
        "--ros-args -r foo",
        Own,
        "error: must have the form `from:=to`",
    ),
    row(
        "--ros-args -p foo",
        Own,
        "error: must have the form `name:=value`",
    ),
    row("--ros-args --enclave /foo/bar", Own, "error: not supported"),
    row(
        "--ros-args --log-config-file x",
        Own,
        "error: has no meaning here",
    ),
    row(
        "--ros-args --params-file none.yaml",
        Own,
        "error: parameter file none.yaml: ",
    ),
    // Values are YAML.
    row("--ros-args -p a:=test", Parameter("a"), "String(\"test\")"),
    row("--ros-args --param a:=1", Parameter("a"), "Integer(1)"),
    row("--ros-args -p a:=1.0", Parameter("a"), "Double(1.0)"),
    row("--ros-args -p a:=true", Parameter("a"), "Boolean(true)"),
    row("--ros-args -p a:='1'", Parameter("a"), "String(\"1\")"),
    row(
        "--ros-args -p a:=[1,2]",
        Parameter("a"),
        "IntegerArray([1, 2])",
    ),
    row("--ros-args -p a.b:=x", Parameter("a.b"), "String(\"x\")"),
    row("--ros-args -p a:=", Own, "error: has no value"),
    row("--ros-args -p a:=[1,b]", Own, "error: values of one type"),
    // What names the node prevails; among equals the rightmost does.
    row(
        "--ros-args -p camera:a:=1 -p a:=2",
        Parameter("a"),
        "Integer(1)",
    ),
    row("--ros-args -p a:=1 -p a:=2", Parameter("a"), "Integer(2)"),
    row("--ros-args -p lidar:a:=1", Parameter("a"), "none"),
    row(
        "--ros-args --params-file article.yaml",
        Parameter("my_int"),
        "Integer(2)",
    ),
    row(
        "--ros-args --params-file article.yaml",
        Parameter("another_int"),
        "Integer(2)",
    ),
    row(
        "--ros-args --params-file article.yaml",
        Parameter("global_int"),
        "Integer(1)",
    ),
    row(
        "--ros-args -p camera:global_int:=2 -p my_float:=2.0 --params-file article.yaml -p my_float:=3.0",
        Parameter("my_float"),
        "Double(1.0)",
    ),
    row(
        "--ros-args -p camera:global_int:=2 --params-file article.yaml",
        Parameter("global_int"),
        "Integer(2)",
    ),
    row(
        "--ros-args --params-file article.yaml -p camera:another_float:=2.0",
        Parameter("another_float"),
        "Double(2.0)",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("lens.zoom"),
        "Integer(2)",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("mixed"),
        "DoubleArray([1.0, 2.5])",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("one_level"),
        "Boolean(true)",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("another_level"),
        "none",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("gone"),
        "Integer(1)",
    ),
    row(
        "--ros-args --params-file nested.yaml",
        Parameter("other"),
        "none",
    ),
    row(
        "--ros-args -r __ns:=/x --params-file nested.yaml",
        Parameter("below"),
        "none",
    ),
    // Logging.
    row(
        "--ros-args --log-level debug",
        Log("ns.camera"),
        "Some(Debug) true true",
    ),
    row(
        "--ros-args --log-level ns:=WARN --log-level info",
        Log("ns.camera"),
        "Some(Warn) true true",
    ),
    row(
        "--ros-args --log-level nscam:=WARN --disable-rosout-logs",
        Log("ns.camera"),
        "None false true",
    ),
    row(
        "--ros-args --disable-stdout-logs --disable-rosout-logs --enable-rosout-logs --disable-external-lib-logs",
        Log("x"),
        "None true false",
    ),
];

fn read(path: &Path) -> io::Result<String> {
    match path.to_str() {
        Some("article.yaml") => Ok(FILE.to_owned()),
        Some("nested.yaml") => Ok(NESTED.to_owned()),
        _ => Err(io::ErrorKind::NotFound.into()),
    }
}

fn answered(row: &Row) -> Result<String, String> {
    let words = row.line.split_whitespace().map(OsString::from);
    let words = std::iter::once(OsString::from("program")).chain(words);
    let (own, ros) = RosArguments::extract(words, read)?;
    let namespace: Namespace = NAMESPACE.parse()?;
    let node = ros.remaps.identity(NODE, &namespace);
    let name = |resource, name| ros.remaps.resolve(resource, name, &node);
    match row.ask {
        Topic(topic) => name(Resource::Topic, topic),
        Service(service) => name(Resource::Service, service),
        Node => Ok(node.fully_qualified()),
        Parameter(parameter) => Ok(ros.parameters.of_node(&node).get(parameter).map_or_else(
            || "none".to_owned(),
            |assignment| format!("{:?}", assignment.value),
        )),
        Own => {
            let words: Vec<_> = own[1..].iter().map(|word| word.to_string_lossy()).collect();
            Ok(words.join(" "))
        }
        Log(logger) => {
            let log = &ros.log;
            Ok(format!(
                "{:?} {} {}",
                log.level_of(logger),
                log.rosout,
                log.console
            ))
        }
    }
}

#[test]
fn arguments_and_names_are_those_of_the_design_articles() {
    let rows: Vec<&Row> = NAMES.iter().chain(&REMAPPING).chain(&ARGUMENTS).collect();
    assert!(rows.len() >= 60);
    let wrong: Vec<String> = rows
        .into_iter()
        .filter_map(|row| {
            let answer = answered(row);
            let is_right = match (&answer, row.answer.strip_prefix("error: ")) {
                (Ok(answer), None) => answer == row.answer,
                (Err(error), Some(part)) => error.contains(part),
                _ => false,
            };
            (!is_right).then(|| format!("{}: expected {}, got {answer:?}", row.line, row.answer))
        })
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn a_file_without_a_word_for_the_node_is_noticed() {
    let words = ["program", "--ros-args", "--params-file", "nested.yaml"].map(OsString::from);
    let (_, ros) = RosArguments::extract(words, read).unwrap();
    let node = |name, namespace: &str| ros.remaps.identity(name, &namespace.parse().unwrap());
    assert!(
        ros.parameters
            .files_without(&node("camera", "/ns"))
            .is_empty()
    );
    let deep = node("camera", "/elsewhere/deep");
    assert_eq!(
        ros.parameters.files_without(&deep),
        [Path::new("nested.yaml")]
    );
}

#[test]
fn a_value_keeps_its_type() {
    let words = ["program", "--ros-args", "-p", "a:=[]"].map(OsString::from);
    let (_, ros) = RosArguments::extract(words, read).unwrap();
    let node = ros.remaps.identity(NODE, &Namespace::default());
    assert_eq!(
        ros.parameters.of_node(&node)["a"].value,
        ParameterValue::StringArray(Vec::new())
    );
}
