"""What a laboratory does with a formation over Zenoh, by a client that others wrote: zenoh-ros2-sdk, with rosbags for CDR.

It is connected to every topic, service and action of the formation: it drives all modules but the last, forms the scenario by
the action, stops and resumes, and calls every service. Prints one JSON object for each thing done.

Usage: zenoh_lab.py PORT DOMAIN NAMESPACE SCENARIO AGENT

The router listens on PORT of loopback. SCENARIO is the file of a scenario whose modules have external drivers, but the last,
which the node AGENT hosts.
"""

import json
import math
import os
import pathlib
import re
import sys
import threading
import time
import traceback
import uuid

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_service_names_and_types, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile, QosReliability
from zenoh_ros2_sdk.session import ZenohSession

from service_definitions import INTERFACES, SERVICES

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "launch_scripts" / "examples"))

from robot_model import Pose, Robot, start_poses  # noqa: E402

LIMIT_S = 60.0
INTERVAL_S = 0.05
STANDARD = [
    "action_msgs/msg/GoalInfo",
    "action_msgs/msg/GoalStatusArray",
    "diagnostic_msgs/msg/DiagnosticArray",
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/msg/ParameterEvent",
    "rcl_interfaces/msg/SetParametersResult",
    "rcl_interfaces/msg/ListParametersResult",
    "rcl_interfaces/msg/ParameterDescriptor",
    "std_msgs/msg/Header",
    "tf2_msgs/msg/TFMessage",
    "unique_identifier_msgs/msg/UUID",
    "visualization_msgs/msg/MarkerArray",
]


def qualified(definition):
    """The same with the package before each type of the suite, which rosbags looks for in the wrong folder otherwise."""
    return re.sub(r"^(?=[A-Z]\w*(\[\])? \w+\s*(#|$))", "formation_msgs/", definition, flags=re.MULTILINE)


def did(what, **more):
    print(json.dumps({"did": what, **more}, default=str), flush=True)


class Interfaces:
    """The interfaces of the suite and the standard ones that it uses, and values of them."""

    def __init__(self, session):
        self.session = session
        lines = (INTERFACES / "type_hashes.txt").read_text(encoding="utf-8").splitlines()
        self.hashes = dict(line.split() for line in lines if not line.startswith("#"))
        jazzy = get_typestore(Stores.ROS2_JAZZY)
        for name in STANDARD:
            self.register(name, jazzy.generate_msgdef(name, ros_version=2)[0])
        for path in sorted((INTERFACES / "msg").glob("*.msg")):
            self.register(f"formation_msgs/msg/{path.stem}", path.read_text(encoding="utf-8"))
        self.services = {name: [qualified(part) for part in parts] for name, parts in SERVICES.items()}
        action = (INTERFACES / "action" / "FormConfiguration.action").read_text(encoding="utf-8")
        goal, result, feedback = qualified(action).split("\n---\n")
        identifier = "unique_identifier_msgs/UUID goal_id\n"
        action = "formation_msgs/action/FormConfiguration"
        self.services[f"{action}_SendGoal"] = (identifier + goal, "bool accepted\nbuiltin_interfaces/Time stamp")
        # The wire does not show that the result, and the feedback, are messages of their own.
        self.services[f"{action}_GetResult"] = (identifier, "int8 status\n" + result)
        self.register(f"{action}_FeedbackMessage", identifier + feedback)

    def register(self, name, definition):
        self.session.register_message_type(definition, name)
        store = self.session.store
        kept = self.session._registered_types[name]
        if name not in store.types:
            store.types[name] = store.types[kept]
            store.fielddefs[name] = store.fielddefs[kept]

    def value(self, name, /, **fields):
        """A message with these fields, and zeros elsewhere."""
        given = {key: self.blank(field) for key, field in self.session.store.fielddefs[name][1]}
        unknown = set(fields) - set(given)
        assert not unknown, f"{name} has no {unknown}"
        return self.session.store.types[name](**{**given, **fields})

    def blank(self, field):
        kind, of = field
        if kind == Nodetype.NAME:
            return self.value(of)
        if kind == Nodetype.BASE:
            return "" if of[0] == "string" else {"bool": False}.get(of[0], 0.0 if of[0].startswith("float") else 0)
        (inner, what), count = of
        if inner == Nodetype.BASE and what[0] != "string":
            return numpy.zeros(count if kind == Nodetype.ARRAY else 0, dtype=what[0])
        return [self.blank((inner, what)) for _ in range(count)] if kind == Nodetype.ARRAY else []


class Lab:
    def __init__(self, port, domain, namespace):
        self.router = {"router_ip": "127.0.0.1", "router_port": port, "domain_id": domain}
        self.interfaces = Interfaces(ZenohSession.get_instance("127.0.0.1", port))
        self.namespace = namespace
        self.changed = threading.Condition()
        self.samples = {}
        self.endpoints = []

    def path(self, name):
        return name if name.startswith("/") else f"{self.namespace}/{name}"

    def subscribe(self, name, message, quality, handle=None, keep_as=None):
        def keep(sample):
            with self.changed:
                self.samples.setdefault(keep_as or name, []).append(sample)
                self.changed.notify_all()
            if handle:
                handle(sample)

        self.endpoints.append(
            ROS2Subscriber(
                topic=self.path(name),
                msg_type=message,
                callback=keep,
                type_hash=self.interfaces.hashes[message],
                qos=quality,
                **self.router,
            )
        )

    def publisher(self, name, message, quality):
        publisher = ROS2Publisher(
            topic=self.path(name),
            msg_type=message,
            type_hash=self.interfaces.hashes[message],
            qos=quality,
            **self.router,
        )
        self.endpoints.append(publisher)
        return publisher

    def wait(self, what, name, is_wanted=lambda sample: True):
        """The first sample of a topic that is wanted."""
        with self.changed:
            found = []

            def look():
                found[:] = [sample for sample in self.samples.get(name, []) if is_wanted(sample)][:1]
                return bool(found)

            if not self.changed.wait_for(look, LIMIT_S):
                sys.exit(f"{what}: nothing on {name} within {LIMIT_S:.0f} s")
        return found[0]

    def call(self, name, service, **fields):
        """The answer of a service, which may not be there yet."""
        request, response = self.interfaces.services[service]
        client = ROS2ServiceClient(
            service_name=self.path(name),
            srv_type=service,
            request_definition=request,
            response_definition=response,
            type_hash=self.interfaces.hashes[service],
            timeout=LIMIT_S,
            **self.router,
        )
        self.endpoints.append(client)
        filled = self.interfaces.value(client.request_store_type, **fields)
        deadline = time.monotonic() + LIMIT_S
        while time.monotonic() < deadline:
            # Without a server the call ends without an answer, and at once.
            answer = client.call(**vars(filled)) if client.querier.matching_status.matching else None
            if answer is not None:
                return answer
            time.sleep(INTERVAL_S)
        sys.exit(f"{name}: no answer within {LIMIT_S:.0f} s")


class Driver(threading.Thread):
    """The robots of some modules, as in tests/python/drive_modules.py; those after the fifth publish odometry."""

    def __init__(self, lab, poses):
        super().__init__(daemon=True)
        self.lock = threading.Lock()
        self.interfaces = lab.interfaces
        self.modules = {}
        reliable = QosProfile()
        for number, (module, pose) in enumerate(poses.items()):
            robot = Robot(pose, speed=4.0, turn_rate=20.0)
            source, message = [("pose", "geometry_msgs/msg/PoseStamped"), ("odom", "nav_msgs/msg/Odometry")][number >= 5]
            below = f"module_{module}"
            poses_out = lab.publisher(f"{below}/{source}", message, reliable)
            results = lab.publisher(f"{below}/docking_result", "formation_msgs/msg/DockingResult", reliable)
            self.modules[module] = (robot, poses_out, results)
            goal, request = self.on_goal(robot), self.on_request(module)
            lab.subscribe(f"{below}/goal_pose", "geometry_msgs/msg/PoseStamped", reliable, goal)
            lab.subscribe(f"{below}/docking", "formation_msgs/msg/DockingRequest", reliable, request)
            lab.subscribe(f"{below}/path", "nav_msgs/msg/Path", QosProfile(durability=QosDurability.TRANSIENT_LOCAL))

    def on_goal(self, robot):
        def handle(goal):
            position, orientation = goal.pose.position, goal.pose.orientation
            heading = 2.0 * math.atan2(orientation.z, orientation.w)
            echo = goal.header.stamp
            age = time.time() - (echo.sec + echo.nanosec * 1e-9)
            with self.lock:
                robot.handle_goal(time.monotonic(), Pose(position.x, position.y, heading), age)

        return handle

    def on_request(self, module):
        def handle(request):
            robot, _, results = self.modules[module]
            with self.lock:
                is_docked = robot.is_docked(time.monotonic(), request.request)
            if is_docked:
                answer = {"module_id": module, "request": request.request, "success": True}
                results.publish(**vars(self.interfaces.value("formation_msgs/msg/DockingResult", **answer)))

        return handle

    def pose_of(self, robot, message):
        value = self.interfaces.value(message)
        value.header.frame_id = "map"
        value.header.stamp.sec, value.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
        pose = value.pose.pose if message == "nav_msgs/msg/Odometry" else value.pose
        pose.position.x, pose.position.y = robot.pose.x, robot.pose.y
        pose.orientation.z, pose.orientation.w = math.sin(robot.pose.theta / 2.0), math.cos(robot.pose.theta / 2.0)
        return vars(value)

    def run(self):
        last = time.monotonic()
        while True:
            time.sleep(INTERVAL_S)
            now = time.monotonic()
            for robot, poses_out, _ in self.modules.values():
                with self.lock:
                    robot.step(now, now - last)
                    value = self.pose_of(robot, poses_out.msg_type)
                poses_out.publish(**value)
            last = now


class Action:
    """The action of the formation, by the services and topics of which it consists."""

    def __init__(self, lab):
        self.lab = lab
        self.name = "form_configuration/_action"
        self.type = "formation_msgs/action/FormConfiguration"

    def send(self, **goal):
        identifier = numpy.frombuffer(uuid.uuid4().bytes, dtype=numpy.uint8)
        goal_id = self.lab.interfaces.value("unique_identifier_msgs/msg/UUID", uuid=identifier)
        answer = self.lab.call(f"{self.name}/send_goal", f"{self.type}_SendGoal", goal_id=goal_id, **goal)
        return goal_id, bool(answer.accepted)

    def result(self, goal_id):
        return self.lab.call(f"{self.name}/get_result", f"{self.type}_GetResult", goal_id=goal_id)

    def cancel(self, goal_id):
        goal = self.lab.interfaces.value("action_msgs/msg/GoalInfo", goal_id=goal_id)
        return self.lab.call(f"{self.name}/cancel_goal", "action_msgs/srv/CancelGoal", goal_info=goal)


def subscribe_to_all(lab):
    latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL)
    best_effort = QosProfile(reliability=QosReliability.BEST_EFFORT)
    ours = {
        "target": "TargetConfiguration",
        "module_states": "ModuleStates",
        "roster": "Roster",
        "claims": "SpotClaim",
        "evictions": "Eviction",
        "commands": "OperatorCommand",
        "verdict": "Verdict",
    }
    for name, message in ours.items():
        lab.subscribe(name, f"formation_msgs/msg/{message}", latched)
    lab.subscribe("heartbeats", "formation_msgs/msg/Heartbeat", best_effort)
    lab.subscribe("markers", "visualization_msgs/msg/MarkerArray", latched)
    lab.subscribe("/tf", "tf2_msgs/msg/TFMessage", QosProfile())
    lab.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", latched)
    lab.subscribe("/rosout", "rcl_interfaces/msg/Log", latched)
    lab.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", QosProfile())
    lab.subscribe("/parameter_events", "rcl_interfaces/msg/ParameterEvent", QosProfile())
    action = "form_configuration/_action"
    lab.subscribe(f"{action}/feedback", "formation_msgs/action/FormConfiguration_FeedbackMessage", QosProfile())
    lab.subscribe(f"{action}/status", "action_msgs/msg/GoalStatusArray", latched)


def form(lab, action, scenario, modules):
    """Forms the scenario, with a stop and its end on the way."""
    goal_id, accepted = action.send(scenario=scenario, expected_modules=modules)
    did("goal", accepted=accepted)
    lab.wait("a module moves", "module_1/goal_pose")
    for resume in (False, True):
        answer = lab.call("stop_formation", "formation_msgs/srv/StopFormation", resume=resume)
        did("resume" if resume else "stop", success=bool(answer.success))
        lab.wait(
            "all heartbeats show the command",
            "heartbeats",
            lambda sample, resume=resume: all(
                entry.stop.revision > 0 and entry.stop.stopped != resume for entry in sample.modules
            ),
        )
    result = action.result(goal_id)
    did("result", status=int(result.status), outcome=int(result.verdict.outcome), message=result.message)


def use_parameters(lab, node):
    """Calls each service of parameters of a node."""
    kinds = "rcl_interfaces/srv"
    listed = lab.call(f"{node}/list_parameters", f"{kinds}/ListParameters").result.names
    did("list_parameters", names=listed)
    names = ["heartbeat_s", "stuck_s"]
    kept = lab.call(f"{node}/get_parameters", f"{kinds}/GetParameters", names=names).values
    did("get_parameters", values=[value.double_value for value in kept])
    types = lab.call(f"{node}/get_parameter_types", f"{kinds}/GetParameterTypes", names=names).types
    did("get_parameter_types", types=[int(kind) for kind in types])
    described = lab.call(f"{node}/describe_parameters", f"{kinds}/DescribeParameters", names=names).descriptors
    did("describe_parameters", names=[one.name for one in described], texts=[one.description for one in described])
    for name, value in (("set_parameters", 11.0), ("set_parameters_atomically", 12.0)):
        kind = lab.interfaces.value("rcl_interfaces/msg/ParameterValue", type=3, double_value=value)
        parameter = lab.interfaces.value("rcl_interfaces/msg/Parameter", name="stuck_s", value=kind)
        service = "SetParameters" if name == "set_parameters" else "SetParametersAtomically"
        answer = lab.call(f"{node}/{name}", f"{kinds}/{service}", parameters=[parameter])
        results = answer.results if name == "set_parameters" else [answer.result]
        did(name, successful=[bool(one.successful) for one in results])
        lab.wait(
            "the change is an event",
            "/parameter_events",
            lambda sample, value=value: any(one.value.double_value == value for one in sample.changed_parameters),
        )


def main():
    port, domain, namespace, scenario, agent = sys.argv[1:]
    lab = Lab(int(port), int(domain), namespace)
    poses = dict(sorted(start_poses(scenario).items()))
    last = max(poses)
    subscribe_to_all(lab)
    Driver(lab, {module: pose for module, pose in poses.items() if module != last}).start()
    action = Action(lab)
    commands = lab.publisher("commands", "formation_msgs/msg/OperatorCommand", QosProfile())
    targets = lab.publisher("target", "formation_msgs/msg/TargetConfiguration", QosProfile())
    did("connected")

    form(lab, action, pathlib.Path(scenario).stem, len(poses))
    status = lab.call("query_status", "formation_msgs/srv/QueryStatus", include_waiting=True)
    did("query_status", target=status.target, settled=int(status.progress.settled))
    use_parameters(lab, agent)
    spare = {"module_id": last + 1, "x": 40.0, "y": 40.0}
    did("add_module", success=bool(lab.call(f"{agent}/add_module", "formation_msgs/srv/AddModule", **spare).success))
    retire = {"module_id": last + 1, "rejoin": False}
    answer = lab.call(f"{agent}/retire_module", "formation_msgs/srv/RetireModule", **retire)
    did("retire_module", success=bool(answer.success))
    gone = {"module_id": last + 2, "incarnation": 1}
    answer = lab.call("remove_module", "formation_msgs/srv/RemoveModule", **gone)
    did("remove_module", success=bool(answer.success))

    # The first target once more, moved by three units: an announcement of the client's own.
    target = lab.wait("the target", "target", lambda sample: not sample.withdrawn)
    answer = lab.call("withdraw_target", "formation_msgs/srv/WithdrawTarget", revision=0)
    did("withdraw_target", success=bool(answer.success))
    withdrawn = lab.wait("the withdrawal", "target", lambda sample: sample.withdrawn)
    target.revision = withdrawn.revision + 1
    target.name = "moved"
    for spot in target.spots:
        spot.x += 3.0
    targets.publish(**vars(target))
    moved = lab.wait("a roster for it", "roster", lambda sample: sample.target.name == "moved")
    did("target", name=moved.target.name)
    verdict = lab.wait("a verdict on it", "verdict", lambda sample: sample.epoch.number >= moved.epoch.number)
    did("verdict", outcome=int(verdict.outcome))

    goal_id, _ = action.send(scenario="undersupply", expected_modules=len(poses))
    identifier = bytes(goal_id.uuid)
    lab.wait(
        "feedback",
        "form_configuration/_action/feedback",
        lambda sample: bytes(sample.goal_id.uuid) == identifier,
    )
    did("cancel", goals=len(action.cancel(goal_id).goals_canceling), status=int(action.result(goal_id).status))

    with lab.changed:
        known = max(entry.stop.revision for sample in lab.samples["heartbeats"] for entry in sample.modules)
    stop = lab.interfaces.value("formation_msgs/msg/Stop", revision=known + 1, stopped=True)
    command = {"protocol_version": 9, "session": 0, "stop": stop}
    commands.publish(**vars(lab.interfaces.value("formation_msgs/msg/OperatorCommand", **command)))
    lab.wait(
        "all heartbeats show it",
        "heartbeats",
        lambda sample: all(entry.stop.stopped and entry.stop.revision > known for entry in sample.modules),
    )
    did("command")

    # The SDK finds the caches of topics in the root namespace only, so this is the one that a late subscriber can have.
    latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL)
    lab.subscribe("/rosout", "rcl_interfaces/msg/Log", latched, keep_as="late")
    did("late", message=lab.wait("a line that was logged before", "late").msg)
    did("topics", types=dict(get_topic_names_and_types(**lab.router)))
    did("services", types=dict(get_service_names_and_types(**lab.router)))
    did("received", topics={name: len(samples) for name, samples in lab.samples.items()})


def run():
    """Ends the process as soon as the script does: the threads of the SDK would keep it."""
    status = 0
    try:
        main()
    except SystemExit as end:
        status = 1
        print(end, file=sys.stderr)
    except BaseException:
        status = 1
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    run()
