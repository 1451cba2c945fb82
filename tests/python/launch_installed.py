"""Runs a launch file of an installed package, and prints what becomes of its processes, one JSON object a line.

Usage:
    launch_installed.py PACKAGE FILE [NAME:=VALUE...]

AMENT_PREFIX_PATH says where packages are, as for `ros2 launch`, which cannot be installed with pip: this has as much of the
Python packages `launch` and `launch_ros` as our launch files use, and refuses whatever else they ask for. Programs and shares are
looked up as these do: in the installed package alone. SIGINT is passed on to every process, as `ros2 launch` does, although a
terminal has sent it to them already.
"""

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import types

import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory

# `ros2 launch` sends SIGTERM after this time, and SIGKILL after the same again.
PATIENCE_S = 5.0


def did(what, **fields):
    # Threads print as well, and must not do so within a line.
    line = json.dumps({"did": what, **fields})
    os.write(sys.stdout.fileno(), f"{line}\n".encode())


class Context:
    def __init__(self, arguments):
        self.arguments = arguments
        self.configurations = {}
        self.environment = dict(os.environ)
        self.handlers = []
        self.running = []
        self.lock = threading.Lock()
        self.is_ending = threading.Event()

    def start(self, action, name, command):
        process = subprocess.Popen(command, env=self.environment, stdin=subprocess.DEVNULL, stdout=sys.stderr)
        did("start", name=name, pid=process.pid, command=command)
        with self.lock:
            self.running.append((action, name, process))
        threading.Thread(target=self.wait, args=(action, name, process), daemon=True).start()

    def wait(self, action, name, process):
        code = process.wait()
        did("end", name=name, code=code)
        if self.is_ending.is_set():
            return
        for handler in self.handlers:
            if handler.target_action is action:
                for entity in handler.on_exit:
                    entity.execute(self)

    def signal_all(self, number):
        for _, _, process in self.running:
            if process.poll() is None:
                process.send_signal(number)

    def end(self):
        self.is_ending.set()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            self.signal_all(number)
            for _, _, process in self.running:
                try:
                    process.wait(PATIENCE_S)
                except subprocess.TimeoutExpired:
                    did("timeout", signal=number)
                    break
            else:
                return


def performed(value, context):
    """The text of something that may be a substitution."""
    return value.perform(context) if isinstance(value, LaunchConfiguration) else str(value)


class LaunchConfiguration:
    def __init__(self, name):
        self.name = name

    def perform(self, context):
        return context.configurations[self.name]


class ParameterValue:
    def __init__(self, value, value_type):
        self.value, self.value_type = value, value_type

    def perform(self, context):
        return self.value_type(performed(self.value, context))


class IfCondition:
    def __init__(self, predicate):
        self.predicate = predicate

    def evaluate(self, context):
        text = performed(self.predicate, context).strip().lower()
        if text not in ("true", "1", "false", "0"):
            raise ValueError(f"a condition is `{text}`, which is neither true nor false")
        return text in ("true", "1")


class Action:
    def __init__(self, condition=None):
        self.condition = condition

    def visit(self, context):
        if self.condition is None or self.condition.evaluate(context):
            for entity in self.execute(context) or []:
                entity.visit(context)


class DeclareLaunchArgument(Action):
    def __init__(self, name, default_value, description):
        super().__init__()
        self.name, self.default_value, self.description = name, default_value, description

    def execute(self, context):
        given = context.arguments | context.configurations
        context.configurations[self.name] = given.get(self.name, self.default_value)


class SetEnvironmentVariable(Action):
    def __init__(self, name, value):
        super().__init__()
        self.name, self.value = name, value

    def execute(self, context):
        context.environment[self.name] = performed(self.value, context)


class OpaqueFunction(Action):
    def __init__(self, function):
        super().__init__()
        self.function = function

    def execute(self, context):
        return self.function(context)


class Shutdown:
    def __init__(self, reason):
        self.reason = reason


class EmitEvent(Action):
    def __init__(self, event):
        super().__init__()
        self.event = event

    def execute(self, context):
        did("shutdown", reason=self.event.reason)
        context.is_ending.set()


class OnProcessExit:
    def __init__(self, target_action, on_exit):
        self.target_action, self.on_exit = target_action, on_exit


class RegisterEventHandler(Action):
    def __init__(self, event_handler, condition=None):
        super().__init__(condition)
        self.event_handler = event_handler

    def execute(self, context):
        context.handlers.append(self.event_handler)


class PythonLaunchDescriptionSource:
    def __init__(self, path):
        self.path = path


class LaunchDescription:
    def __init__(self, entities):
        self.entities = entities

    def visit(self, context):
        for entity in self.entities:
            entity.visit(context)


class IncludeLaunchDescription(Action):
    def __init__(self, source, launch_arguments):
        super().__init__()
        self.source, self.launch_arguments = source, launch_arguments

    def execute(self, context):
        for name, value in self.launch_arguments:
            context.configurations[name] = performed(value, context)
        return [described(self.source.path)]


class Node(Action):
    def __init__(self, package, executable, name=None, namespace=None, arguments=(), parameters=(), output="log", condition=None):
        super().__init__(condition)
        self.package, self.executable, self.name, self.namespace = package, executable, name, namespace
        self.arguments, self.parameters = arguments, parameters

    def execute(self, context):
        program = pathlib.Path(get_package_prefix(self.package), "lib", self.package, self.executable)
        if not os.access(program, os.X_OK) or not program.is_file():
            raise FileNotFoundError(f"executable '{self.executable}' not found on the libexec directory '{program.parent}'")
        command = [str(program), *(performed(word, context) for word in self.arguments), "--ros-args"]
        full_name = "/**"
        if self.name is not None:
            command += ["-r", f"__node:={self.name}"]
        if self.namespace is not None:
            namespace = performed(self.namespace, context)
            command += ["-r", f"__ns:={namespace}"]
            full_name = f"{namespace}/{self.name}"
        for parameters in self.parameters:
            values = {
                name: value.perform(context) if isinstance(value, ParameterValue) else value for name, value in parameters.items()
            }
            with tempfile.NamedTemporaryFile("w", prefix="launch_params_", delete=False) as file:
                yaml.dump({full_name: {"ros__parameters": values}}, file)
            command += ["--params-file", file.name]
        context.start(self, self.executable, command)


MODULES = {
    "launch": [LaunchDescription],
    "launch.actions": [
        DeclareLaunchArgument,
        EmitEvent,
        IncludeLaunchDescription,
        OpaqueFunction,
        RegisterEventHandler,
        SetEnvironmentVariable,
    ],
    "launch.conditions": [IfCondition],
    "launch.event_handlers": [OnProcessExit],
    "launch.events": [Shutdown],
    "launch.launch_description_sources": [PythonLaunchDescriptionSource],
    "launch.substitutions": [LaunchConfiguration],
    "launch_ros": [],
    "launch_ros.actions": [Node],
    "launch_ros.parameter_descriptions": [ParameterValue],
}


def described(path):
    """What a launch file describes."""
    scope = {"__file__": str(path), "__name__": "launch_file"}
    exec(compile(pathlib.Path(path).read_text(encoding="utf-8"), str(path), "exec"), scope)
    return scope["generate_launch_description"]()


def main():
    package, name, *given = sys.argv[1:]
    for module, classes in MODULES.items():
        sys.modules[module] = types.ModuleType(module)
        vars(sys.modules[module]).update({one.__name__: one for one in classes})
    found = sorted(pathlib.Path(get_package_share_directory(package)).rglob(name))
    if len(found) != 1:
        sys.exit(f"the share of {package} has {len(found)} files {name}")
    context = Context(dict(argument.split(":=", 1) for argument in given))
    signal.signal(signal.SIGINT, lambda *_: context.is_ending.set())
    description = described(found[0])
    try:
        description.visit(context)
        did("launched")
        context.is_ending.wait()
    finally:
        context.end()


if __name__ == "__main__":
    main()
