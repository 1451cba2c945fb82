"""Starts the processes of a scenario as ROS 2 nodes.

    ros2 launch formation_launch formation.launch.py scenario:=figure1_ladder17
    ros2 launch formation_launch formation.launch.py scenario:=/path/to/mine.yaml visualiser:=true motion:=external

A module is one process, and a configuration's leader a `leader_agent`, as with `formation run`. Unlike there, the
processes run until Ctrl-C, unless `shutdown_on_verdict` says otherwise.
"""

import os

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = "formation_launch"

ARGUMENTS = {
    "scenario": ("figure1_ladder17", "name of a scenario that ships with the package, or the path of a file"),
    "namespace": ("/formation", "namespace of all nodes and topics"),
    "domain": (os.environ.get("ROS_DOMAIN_ID", "0"), "DDS domain, 0 to 232"),
    "modules_per_process": ("1", "how many modules a process hosts"),
    "motion": ("simulated", "who moves the modules: simulated or external"),
    "speed": ("1.0", "speed of simulated modules, in units a second"),
    "session": ("0", "session of all nodes: messages of another session are refused"),
    "state_dir": ("", "directory in which agents keep what they agreed on; empty for none"),
    "record": ("", "file (MCAP) into which all topics are recorded; empty for none"),
    "visualiser": ("false", "whether to publish markers and transforms for RViz and Foxglove"),
    "rviz": ("false", "whether to start RViz as well"),
    "time_limit_s": ("600.0", "after this many seconds the verifier calls the formation failed"),
    "shutdown_on_verdict": ("false", "whether everything ends once the verifier has judged"),
    "log_level": ("info", "debug, info, warn, error or fatal"),
}


def scenario_path(name):
    """The file of a scenario, given by path or by the name of one that ships with the package."""
    if os.path.isfile(name):
        return os.path.abspath(name)
    path = os.path.join(get_package_share_directory(PACKAGE), "scenarios", f"{name}.yaml")
    if not os.path.isfile(path):
        raise FileNotFoundError(f"scenario: there is no file `{name}` and no `{path}`")
    return path


def modules_of(scenario):
    """All modules ascending, and those that the file names as leaders."""
    if drawn := scenario.get("modules"):
        count = sum(symbol.isalnum() for symbol in drawn["map"])
        return sorted(drawn.get("ids") or range(1, count + 1)), set()
    configurations = scenario.get("configurations") or []
    modules = [module["id"] for configuration in configurations for module in configuration["modules"]]
    modules += [module["id"] for module in scenario.get("singletons") or []]
    leaders = {configuration["leader"] for configuration in configurations if "leader" in configuration}
    return sorted(modules), leaders


def processes(modules, leaders, modules_per_process):
    """The program, node name and module list of each process."""
    for first in range(0, len(modules), modules_per_process):
        hosted = modules[first : first + modules_per_process]
        if len(hosted) == 1:
            program = "leader_agent" if hosted[0] in leaders else "module_agent"
            yield program, f"module_{hosted[0]}", ["--module", str(hosted[0])]
        else:
            listed = ",".join(str(module) for module in hosted)
            yield "module_agent", f"modules_{hosted[0]}_to_{hosted[-1]}", ["--modules", listed]


def launch_setup(context):
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    path = scenario_path(value["scenario"])
    with open(path, encoding="utf-8") as file:
        content = yaml.safe_load(file)
    modules, leaders = modules_of(content)
    module_size = float(content.get("module_size", 1.0))
    modules_per_process = int(value["modules_per_process"])
    if modules_per_process < 1:
        raise ValueError(f"modules_per_process: must be at least 1, got {modules_per_process}")

    def node(program, name, arguments):
        return Node(
            package=PACKAGE,
            executable=program,
            name=name,
            namespace=value["namespace"],
            arguments=[*arguments, "--log-level", value["log_level"]],
            parameters=[{"session": int(value["session"]), "module_size": module_size}],
            output="screen",
        )

    scenario = ["--scenario", path]
    # Goals that are sent later need a verdict as well.
    ends = value["shutdown_on_verdict"].lower() in ("true", "1")
    time_limit = ["--time-limit-s", value["time_limit_s"]]
    verifier = node("verifier", "verifier", time_limit if ends else [*time_limit, "--keep-watching"])
    motion = ["--motion", value["motion"], "--speed", value["speed"]]
    memory = ["--state-dir", value["state_dir"]] if value["state_dir"] else []
    agents = [
        node(program, name, [*hosted, *scenario, *motion, *memory])
        for program, name, hosted in processes(modules, leaders, modules_per_process)
    ]
    # Without files nobody remembers anything after a restart, and named voters would all be needed.
    voters = ["--voters", ",".join(str(module) for module in modules)] if memory else []
    publisher = node(
        "target_publisher", "target_publisher", [*scenario, "--expected-modules", str(len(modules)), *voters]
    )
    # Drivers speak with their modules over topics of each module, of which a recorder takes those of 100.
    driven = value["motion"] == "external"
    listed = ["--modules", ",".join(str(module) for module in modules[:100])] if driven else []
    recorders = [node("recorder", "recorder", [value["record"], *listed])] if value["record"] else []
    # The recorder and the verifier come first, so that they receive all messages, and the target last.
    return [
        *recorders,
        verifier,
        *agents,
        publisher,
        RegisterEventHandler(
            OnProcessExit(target_action=verifier, on_exit=[EmitEvent(event=Shutdown(reason="there is a verdict"))]),
            condition=IfCondition(value["shutdown_on_verdict"]),
        ),
    ]


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    visualiser = Node(
        package=PACKAGE,
        executable="visualiser",
        name="visualiser",
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"session": ParameterValue(LaunchConfiguration("session"), value_type=int)}],
        condition=IfCondition(LaunchConfiguration("visualiser")),
        output="screen",
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", os.path.join(get_package_share_directory(PACKAGE), "rviz", "formation.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    domain = SetEnvironmentVariable("ROS_DOMAIN_ID", LaunchConfiguration("domain"))
    return LaunchDescription([*arguments, domain, OpaqueFunction(function=launch_setup), visualiser, rviz])
