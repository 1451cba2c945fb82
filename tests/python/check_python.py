"""Holds the Python of the repository to what it uses: syntax, a linter, and interfaces that exist.

Follows values of message types through each file (from constructors, subscriptions, list fields, annotations, and calls
of the file's own functions) and reports every field, constant or keyword that its type does not have, and every topic,
service or action of the suite that is used with another type than it has. Types come from the interface files and, for
other packages, from rosbags.

Usage:
    check_python.py [FILE...]   all Python of the repository, if none is named
    check_python.py --self-test
"""

import ast
import compileall
import pathlib
import subprocess
import sys
import tempfile

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ["launch_scripts", "tests", "msgs", "experiments", "python", ".ci"]
USERS_OF_ROS = ["launch_scripts/examples", "launch_scripts/launch"]

# The types of the topics that the examples use, by the last part of the name.
TOPIC_TYPES = {
    "target": "formation_msgs/msg/TargetConfiguration",
    "module_states": "formation_msgs/msg/ModuleStates",
    "roster": "formation_msgs/msg/Roster",
    "claims": "formation_msgs/msg/SpotClaim",
    "evictions": "formation_msgs/msg/Eviction",
    "heartbeats": "formation_msgs/msg/Heartbeat",
    "verdict": "formation_msgs/msg/Verdict",
    "goal_pose": "geometry_msgs/msg/PoseStamped",
    "path": "nav_msgs/msg/Path",
    "pose": "geometry_msgs/msg/PoseStamped",
    "odom": "nav_msgs/msg/Odometry",
    "docking": "formation_msgs/msg/DockingRequest",
    "docking_result": "formation_msgs/msg/DockingResult",
}


# The same for services and actions.
SERVICE_TYPES = {
    "add_module": "formation_msgs/srv/AddModule",
    "push_module": "formation_msgs/srv/PushModule",
    "query_status": "formation_msgs/srv/QueryStatus",
    "retire_module": "formation_msgs/srv/RetireModule",
    "withdraw_target": "formation_msgs/srv/WithdrawTarget",
    "form_configuration": "formation_msgs/action/FormConfiguration",
}

# The sections of an interface file, by its kind.
SECTIONS = {"msg": [""], "srv": ["Request", "Response"], "action": ["Goal", "Result", "Feedback"]}


def load_definitions():
    """Fields and constants of every type, by full name; sections of services and actions are types of their own."""
    definitions = dict(get_typestore(Stores.ROS2_JAZZY).fielddefs)

    def define(name, text):
        definitions.update(get_types_from_msg(text, f"formation_msgs/msg/{name}"))

    for kind, sections in SECTIONS.items():
        for path in (ROOT / "msgs" / kind).glob(f"*.{kind}"):
            for section, text in zip(sections, path.read_text().split("\n---\n"), strict=True):
                define(f"{path.stem}_{section}" if section else path.stem, text)
            if kind == "action":
                feedback = f"formation_msgs/{path.stem}_Feedback feedback"
                define(f"{path.stem}_FeedbackMessage", f"unique_identifier_msgs/UUID goal_id\n{feedback}")
    return definitions


class Message(str):
    """The type of a message, by its full name."""


class ListOf(str):
    """The type of a list of messages, by the full name of its entries."""


class Class(str):
    """A message class itself, by its full name."""


class Interface(str):
    """A service or an action, by its full name."""

    def section(self, name):
        """The type of one of its sections, which counts as a message."""
        package, _, base = self.split("/")
        return f"{package}/msg/{base}_{name}"


class Checker:
    """Checks one file."""

    def __init__(self, definitions, path, source):
        self.definitions = definitions
        self.path = path
        self.tree = ast.parse(source, str(path))
        self.faults = set()
        self.classes = {}
        # What is known of parameters and attributes, found on the way; passes repeat until nothing new is.
        self.parameters = {}
        self.attributes = {}
        self.functions = [
            node for node in ast.walk(self.tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        ]

    def fault(self, node, text):
        self.faults.add(f"{self.path}:{node.lineno}: {text}")

    def check(self):
        for node in ast.walk(self.tree):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.endswith((".msg", ".srv", ".action")):
                package, _, kind = node.module.rpartition(".")
                if package == "rclpy":
                    continue
                for alias in node.names:
                    name = f"{package}/{kind}/{alias.name}"
                    known = Class(name) if kind == "msg" else Interface(name)
                    first = name if kind == "msg" else known.section(SECTIONS[kind][0])
                    if first in self.definitions:
                        self.classes[alias.asname or alias.name] = known
                    else:
                        self.fault(node, f"there is no {'message' if kind == 'msg' else kind} {name}")
        for _ in range(5):
            known = (len(self.parameters), len(self.attributes))
            self.block(self.tree.body, {})
            for function in self.functions:
                scope = {
                    argument.arg: self.parameters[function, argument.arg]
                    for argument in function.args.args
                    if (function, argument.arg) in self.parameters
                }
                self.block(function.body, scope)
            if known == (len(self.parameters), len(self.attributes)):
                break
        return sorted(self.faults)

    def block(self, statements, scope):
        for statement in statements:
            self.statement(statement, scope)

    def statement(self, node, scope):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            return
        if isinstance(node, ast.ClassDef):
            self.block(node.body, {})
            return
        if isinstance(node, ast.Assign):
            value = self.visit(node.value, scope)
            for target in node.targets:
                self.bind(target, value, node.value, scope)
            return
        if isinstance(node, ast.AnnAssign):
            kind = self.visit(node.annotation, scope)
            self.bind(node.target, Message(kind) if isinstance(kind, Class) else None, node.value, scope)
            return
        if isinstance(node, ast.For):
            self.bind(node.target, self.entry(self.visit(node.iter, scope)), None, scope)
            self.block(node.body + node.orelse, scope)
            return
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.stmt):
                self.statement(child, scope)
            elif isinstance(child, ast.expr):
                self.visit(child, scope)
            else:
                self.block([part for part in ast.iter_child_nodes(child) if isinstance(part, ast.stmt)], scope)

    def bind(self, target, value, source, scope):
        if isinstance(target, ast.Tuple) and isinstance(source, ast.Tuple):
            for part, origin in zip(target.elts, source.elts, strict=True):
                self.bind(part, self.visit(origin, scope), origin, scope)
        elif isinstance(target, ast.Name):
            scope.pop(target.id, None)
            if value is not None:
                scope[target.id] = value
        elif isinstance(target, ast.Attribute):
            self.visit(target, scope)
            if isinstance(target.value, ast.Name) and target.value.id == "self" and value is not None:
                self.attributes.setdefault(target.attr, value)

    def entry(self, kind):
        return Message(kind) if isinstance(kind, ListOf) else None

    def visit(self, node, scope):
        """The type of an expression, as far as it is a message; checks everything within."""
        if isinstance(node, ast.Name):
            if node.id in scope:
                return scope[node.id]
            return self.classes.get(node.id)
        if isinstance(node, ast.Attribute):
            return self.attribute(node, self.visit(node.value, scope))
        if isinstance(node, ast.Call):
            return self.call(node, scope)
        if isinstance(node, ast.Lambda):
            self.visit(node.body, dict(scope))
            return None
        if isinstance(node, ast.IfExp):
            kinds = [self.visit(part, scope) for part in (node.test, node.body, node.orelse)]
            return kinds[1] if kinds[1] == kinds[2] else None
        if isinstance(node, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
            inner = dict(scope)
            for generator in node.generators:
                self.bind(generator.target, self.entry(self.visit(generator.iter, inner)), None, inner)
                for condition in generator.ifs:
                    self.visit(condition, inner)
            parts = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
            for part in parts:
                self.visit(part, inner)
            return None
        if isinstance(node, ast.Subscript):
            self.visit(node.slice, scope)
            return self.entry(self.visit(node.value, scope))
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self.visit(child, scope)
        return None

    def attribute(self, node, kind):
        if isinstance(kind, Interface):
            section = kind.section(node.attr)
            if section in self.definitions:
                return Class(section)
            self.fault(node, f"{kind} has no section `{node.attr}`")
            return None
        if isinstance(kind, Message | Class):
            constants, fields = self.definitions[kind]
            if isinstance(kind, Class):
                if node.attr not in {name for name, *_ in constants}:
                    self.fault(node, f"{kind} has no constant `{node.attr}`")
                return None
            for name, (sort, content) in fields:
                if name == node.attr:
                    if sort.name == "NAME":
                        return Message(content)
                    nested = sort.name in ("SEQUENCE", "ARRAY") and content[0][0].name == "NAME"
                    return ListOf(content[0][1]) if nested else None
            if node.attr not in {name for name, *_ in constants}:
                self.fault(node, f"{kind} has no field `{node.attr}`")
            return None
        if isinstance(node.value, ast.Name) and node.value.id == "self":
            return self.attributes.get(node.attr)
        return None

    def call(self, node, scope):
        called = self.visit(node.func, scope)
        arguments = [self.visit(argument, scope) for argument in node.args]
        for keyword in node.keywords:
            self.visit(keyword.value, scope)
        if isinstance(called, Class):
            fields = {name for name, _ in self.definitions[called][1]}
            for keyword in node.keywords:
                if keyword.arg not in fields:
                    self.fault(node, f"{called} has no field `{keyword.arg}`")
            return Message(called)
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", None)
        if name in ("create_publisher", "create_subscription") and arguments and isinstance(arguments[0], Class):
            self.endpoint(node, arguments[0])
            if name == "create_subscription":
                self.callback(node.args[2], arguments[0], scope)
        elif name in ("create_client", "ActionClient") and any(isinstance(kind, Interface) for kind in arguments):
            position = next(index for index, kind in enumerate(arguments) if isinstance(kind, Interface))
            self.service(node, node.args[position + 1], arguments[position])
        elif name == "send_goal_async" and arguments and isinstance(arguments[0], Message):
            for keyword in node.keywords:
                if keyword.arg == "feedback_callback":
                    self.callback(keyword.value, f"{arguments[0].removesuffix('_Goal')}_FeedbackMessage", scope)
        else:
            self.pass_on(name, arguments)
        return None

    def pass_on(self, name, arguments):
        """Notes what the functions of that name are called with."""
        for function in self.functions:
            parameters = [argument.arg for argument in function.args.args if argument.arg != "self"]
            for parameter, kind in zip(parameters, arguments, strict=False):
                if function.name == name and kind is not None:
                    self.parameters.setdefault((function, parameter), kind)

    def callback(self, function, kind, scope):
        if isinstance(function, ast.Lambda):
            self.visit(function.body, {**scope, function.args.args[0].arg: Message(kind)})
        elif isinstance(function, ast.Attribute | ast.Name):
            name = function.attr if isinstance(function, ast.Attribute) else function.id
            self.pass_on(name, [Message(kind)])

    def endpoint(self, node, kind):
        self.named(node, node.args[1], "topic", TOPIC_TYPES, kind)

    def service(self, node, name, kind):
        self.named(node, name, "service or action", SERVICE_TYPES, kind)

    def named(self, node, name, what, types, kind):
        """Whether something of that name has this type."""
        if isinstance(name, ast.JoinedStr) and isinstance(name.values[-1], ast.Constant):
            name = name.values[-1]
        if not isinstance(name, ast.Constant):
            self.fault(node, f"the name of a {what} must be written where it is used")
            return
        last = name.value.rsplit("/", 1)[-1]
        if last not in types:
            self.fault(node, f"the suite has no {what} `{last}`")
        elif types[last] != kind:
            self.fault(node, f"`{last}` carries {types[last]}, not {kind}")


def check_interfaces(paths):
    definitions = load_definitions()
    return [fault for path in paths for fault in Checker(definitions, path, path.read_text()).check()]


def check_style(paths):
    faults = []
    with tempfile.TemporaryDirectory() as cache:
        sys.pycache_prefix = cache
        for path in paths:
            if not compileall.compile_file(path, quiet=1, force=True):
                faults.append(f"{path} does not compile")
    linter = [sys.executable, "-m", "ruff", "check", "--no-cache", "--quiet", "--config", str(ROOT / "ruff.toml")]
    result = subprocess.run([*linter, *map(str, paths)], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        faults.append(f"{result.stdout}{result.stderr}")
    return faults


MISTAKES = {
    "launch_scripts/examples/announce_target.py": [
        ("message.spots = [", "message.places = [", "has no field `places`"),
        ("theta=float", "heading=float", "has no field `heading`"),
        ("message.header.frame_id", "message.header.frame", "has no field `frame`"),
        ("import Area, Edge,", "import Area, Edges,", "there is no message formation_msgs/msg/Edges"),
        ('"target", TRANSIENT_LOCAL', '"targets", TRANSIENT_LOCAL', "no topic `targets`"),
    ],
    "launch_scripts/examples/echo_claims.py": [
        ("pair.module_id", "pair.module", "has no field `module`"),
        ("eviction.to_spot_id", "eviction.to_spot", "has no field `to_spot`"),
        ("EvictionRecord.NONE", "EvictionRecord.NOTHING", "has no constant `NOTHING`"),
        ('"claims"', '"verdict"', "carries formation_msgs/msg/Verdict"),
    ],
    "launch_scripts/examples/follow_progress.py": [
        ("state.sequence", "state.number", "has no field `number`"),
        ("verdict.violations", "verdict.faults", "has no field `faults`"),
        ("follower.verdict is None", "follower.verdict is None", None),
    ],
    "launch_scripts/examples/form_target.py": [
        ("scenario=options", "name=options", "has no field `name`"),
        ("FormConfiguration.Goal(", "FormConfiguration.Request(", "has no section `Request`"),
        ("message.feedback.progress", "message.progress", "has no field `progress`"),
        ("progress.settled", "progress.arrived", "has no field `arrived`"),
        ("print(result.message)", "print(result.text)", "has no field `text`"),
        ('"form_configuration"', '"form"', "no service or action `form`"),
        ("action import FormConfiguration", "action import Form", "there is no action formation_msgs/action/Form"),
    ],
    "launch_scripts/examples/retire_module.py": [
        ("module_id=options", "module=options", "has no field `module`"),
        ("print(response.message)", "print(response.text)", "has no field `text`"),
        ("}/retire_module", "}/add_module", "carries formation_msgs/srv/AddModule"),
        ("srv import RetireModule", "srv import Retire", "there is no srv formation_msgs/srv/Retire"),
    ],
    "launch_scripts/examples/drive_modules.py": [
        ("message.pose.position", "message.position", "has no field `position`"),
        ("message.other_module_id", "message.other_id", "has no field `other_id`"),
        ("success=True", "succeeded=True", "has no field `succeeded`"),
    ],
}


def self_test():
    """Each mistake must be found, and nothing where there is none."""
    definitions = load_definitions()
    missed = []
    for name, mistakes in MISTAKES.items():
        path = ROOT / name
        source = path.read_text()
        for right, wrong, expected in mistakes:
            if right not in source:
                missed.append(f"{name} does not hold `{right}` any more")
                continue
            faults = Checker(definitions, path, source.replace(right, wrong)).check()
            found = not faults if expected is None else any(expected in fault for fault in faults)
            if not found:
                missed.append(f"{name}: `{wrong}` gives {faults}")
    return missed


def main():
    if sys.argv[1:] == ["--self-test"]:
        faults = self_test()
    else:
        paths = [pathlib.Path(name).resolve() for name in sys.argv[1:]]
        paths = paths or sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
        users = [path for path in paths if any(path.is_relative_to(ROOT / folder) for folder in USERS_OF_ROS)]
        faults = check_style(paths) + check_interfaces(users)
        print(f"{len(paths)} files checked, {len(users)} of them against the interfaces")
    print("\n".join(faults), file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
