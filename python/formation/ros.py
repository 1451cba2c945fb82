"""Real formations: announce a target, follow it to its verdict, remove and add modules.

::

    from formation import ros

    with ros.Formation() as live:               # namespace /formation
        live.announce(scenario)
        verdict = live.wait_for_verdict(timeout_s=120)

Needs rclpy and ``formation_msgs``, built from ``msgs`` in a ROS 2 workspace; both are imported when a :class:`Formation` is made.
Messages are in metres; this module converts the units of scenarios.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any
from collections.abc import Callable, Iterator

from .errors import FormationError
from .scenarios import Scenario

__all__ = ["Formation", "RosError", "State", "Verdict"]


class RosError(FormationError):
    """A node did not answer in time, or refused a request; the message says which, and why."""


@dataclass(frozen=True)
class Verdict:
    """The verifier's judgement of a formation.

    Attributes:
        outcome: ``COMPLETE``, ``PARTIAL`` or ``FAILED``.
        filled, spots: How many spots are filled, of how many.
        assignments: The spot of each module.
        violations: What is wrong, one sentence each.
        collision_free: Whether no bodies overlapped.
    """

    outcome: str
    filled: int
    spots: int
    assignments: dict[int, int] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)
    collision_free: bool = False


@dataclass(frozen=True)
class State:
    """A module, by its own report.

    Attributes:
        module: The module.
        phase: What it does, such as ``moving``, ``settled`` or ``spare``.
        x, y, theta: Its pose, in metres and radians.
        spot: The spot that the plan gives it; ``None`` without one.
    """

    module: int
    phase: str
    x: float
    y: float
    theta: float
    spot: int | None


class Formation:
    """A node that announces targets and listens.

    Args:
        namespace: The namespace of the formation.
        session: The session of its programs, which ``formation run`` prints.
        context: An rclpy context that is already initialised; otherwise one of its own is made, and shut down by :meth:`close`.
    """

    def __init__(self, namespace: str = "/formation", *, session: int = 0, context: Any = None) -> None:
        import rclpy
        from formation_msgs.msg import ModuleStates, TargetConfiguration
        from formation_msgs.msg import Verdict as VerdictMessage
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._session = session
        self._states: dict[int, Any] = {}
        self._verdicts: list[Any] = []
        self._owned = None
        if context is None:
            self._owned = context = rclpy.context.Context()
            rclpy.init(context=context)
        self._node = Node("formation_python", namespace=namespace, context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        last = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        many = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._target = self._node.create_publisher(TargetConfiguration, "target", last)
        self._node.create_subscription(ModuleStates, "module_states", self._take_states, many)
        self._node.create_subscription(VerdictMessage, "verdict", self._take_verdict, many)

    def announce(self, scenario: Scenario, *, expected_modules: int = 0, timeout_s: float = 10.0) -> None:
        """Announce the target of a scenario, with the planner's parameters; modules begin at once.

        Args:
            expected_modules: How many modules take part; 0 if not known.
            timeout_s: How long to wait for the first listener.

        Raises:
            RosError: nobody listens.
        """
        message = _announcement(scenario, self._session, expected_modules)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._verdicts.clear()
        # Fast DDS may send the first sample before every subscription is matched, and repeats it after three seconds only.
        self._spin_until(lambda: self._target.get_subscription_count() > 0, timeout_s, "no node listens to `target`")
        self._target.publish(message)
        self._spin_for(1.0)
        self._target.publish(message)

    def wait_for_verdict(self, timeout_s: float = 120.0) -> Verdict:
        """Wait for the first verdict since :meth:`announce`.

        Raises:
            RosError: there is none in time: is a verifier running?
        """
        self._spin_until(lambda: self._verdicts, timeout_s, f"no verdict within {timeout_s} s: is a verifier running?")
        return _verdict(self._verdicts[-1])

    def follow(self, timeout_s: float = 120.0) -> Iterator[dict[int, State]]:
        """Yield the states of all modules whenever one changes, until the verdict.

        Raises:
            RosError: there is no verdict in time.
        """
        end = time.monotonic() + timeout_s
        shown: dict[int, State] = {}
        while not self._verdicts:
            left = end - time.monotonic()
            if left <= 0:
                raise RosError(f"no verdict within {timeout_s} s: is a verifier running?")
            self._executor.spin_once(timeout_sec=min(left, 0.1))
            states = {module: _state(state) for module, state in sorted(self._states.items())}
            if states != shown:
                shown = states
                yield states

    def remove(self, module: int, *, timeout_s: float = 20.0) -> str:
        """Report that the robot of a dead module was taken away, so that it blocks no spot; what the target publisher answers.

        Raises:
            RosError: the publisher refuses, as heartbeats of the module arrive, or does not answer.
        """
        from formation_msgs.srv import RemoveModule

        return self._ask(RemoveModule, "remove_module", RemoveModule.Request(module_id=module), timeout_s)

    def add(
        self, module: int, x: float, y: float, theta: float = 0.0, *, agent: str, timeout_s: float = 20.0
    ) -> str:
        """Let a running process of modules host one more; what it answers.

        Args:
            x, y, theta: Where its robot stands, in metres and radians.
            agent: The node of the process, such as ``module_4``.

        Raises:
            RosError: the process refuses, or does not answer.
        """
        from formation_msgs.srv import AddModule

        request = AddModule.Request(module_id=module, x=float(x), y=float(y), theta=float(theta))
        return self._ask(AddModule, f"{agent}/add_module", request, timeout_s)

    def close(self) -> None:
        """Leave the graph. The target that was announced stays in force for those who know it."""
        self._executor.shutdown()
        self._node.destroy_node()
        if self._owned is not None:
            self._owned.try_shutdown()

    def __enter__(self) -> Formation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, kind: Any, name: str, request: Any, timeout_s: float) -> str:
        end = time.monotonic() + timeout_s
        client = self._node.create_client(kind, name)
        try:
            self._spin_until(client.service_is_ready, timeout_s, f"no node serves `{name}`")
            # A client of Fast DDS can find a server before the server has matched it, and would wait three seconds.
            self._spin_for(0.2)
            answer = client.call_async(request)
            left = max(end - time.monotonic(), 0.1)
            self._spin_until(answer.done, left, f"`{name}` did not answer within {timeout_s} s")
            response = answer.result()
        finally:
            self._node.destroy_client(client)
        if not response.success:
            raise RosError(response.message)
        return response.message

    def _spin_until(self, is_done: Callable[[], Any], timeout_s: float, otherwise: str) -> None:
        end = time.monotonic() + timeout_s
        while not is_done():
            if time.monotonic() >= end:
                raise RosError(otherwise)
            self._executor.spin_once(timeout_sec=0.05)

    def _spin_for(self, duration_s: float) -> None:
        end = time.monotonic() + duration_s
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)

    def _take_states(self, sample: Any) -> None:
        for state in sample.modules:
            known = self._states.get(state.module_id)
            # Samples of earlier runs may arrive late: the latest state of the latest run holds.
            if known is None or (state.incarnation, state.sequence) > (known.incarnation, known.sequence):
                self._states[state.module_id] = state

    def _take_verdict(self, verdict: Any) -> None:
        if self._session in (0, verdict.session):
            self._verdicts.append(verdict)


def _announcement(scenario: Scenario, session: int, expected_modules: int) -> Any:
    """The message for a scenario."""
    from formation_msgs.msg import Area, Edge, Spot, TargetConfiguration

    data = scenario.to_dict()
    target = data["target"]
    # Scenarios are in units, messages in metres.
    size = float(data.get("module_size", 1.0))
    message = TargetConfiguration(name=scenario.name, session=session, expected_modules=expected_modules)
    message.header.frame_id = target["frame_id"]
    # The highest revision holds, so later announcements replace this one.
    message.revision = int(time.time() * 1000)
    message.module_size = size
    message.body_width = size * float(data.get("body_width", 0.9))
    message.spots = [
        Spot(id=spot["id"], x=size * spot["x"], y=size * spot["y"], theta=spot["theta"]) for spot in target["spots"]
    ]
    message.edges = [Edge(first=first, second=second) for first, second in target["edges"]]

    def area(box: dict[str, float]) -> Any:
        return Area(**{side: size * float(box[side]) for side in ("x", "y", "width", "height")})

    message.obstacles = [area(box) for box in data.get("obstacles", [])]
    if "arena" in data:
        message.arena = area(data["arena"])
    _set_planner(message.planner, scenario)
    return message


def _set_planner(message: Any, scenario: Scenario) -> None:
    """Sets the planner's parameters of a message to those of a scenario, all of which :meth:`Scenario.to_dict` lists."""
    from formation_msgs.msg import PolicyOption

    planner = scenario.to_dict()["planner"]
    message.policy = planner["policy"]
    message.order = getattr(message, f"ORDER_{planner['order'].upper()}")
    message.d_max = message.D_MAX_UNBOUNDED if planner["d_max"] is None else min(planner["d_max"], 2**31 - 1)
    for name, weight in planner["weights"].items():
        setattr(message, f"weight_{name}", float(weight))
    message.cut_price = float(planner["cut_price"])
    message.spread = float(planner["spread"])
    message.exact_finish = planner["exact_finish"]
    message.keep_all_spots = planner["keep_all_spots"]
    options = scenario._native.policy_options()
    message.policy_options = [PolicyOption(key=key, value=value) for key, value in options]


def _verdict(message: Any) -> Verdict:
    kind = type(message)
    outcomes = {getattr(kind, name): name[len("OUTCOME_") :] for name in dir(kind) if name.startswith("OUTCOME_")}
    return Verdict(
        outcome=outcomes.get(message.outcome, "FAILED"),
        filled=message.filled_spots,
        spots=message.spots,
        assignments={pair.module_id: pair.spot_id for pair in message.assignments},
        violations=list(message.violations),
        collision_free=message.collision_free,
    )


def _state(message: Any) -> State:
    kind = type(message)
    phases = {getattr(kind, name): name[len("PHASE_") :].lower() for name in dir(kind) if name.startswith("PHASE_")}
    return State(
        module=message.module_id,
        phase=phases.get(message.phase, "unknown"),
        x=message.x,
        y=message.y,
        theta=message.theta,
        spot=None if message.spot_id == message.NONE else message.spot_id,
    )
