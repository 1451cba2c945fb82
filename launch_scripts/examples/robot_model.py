"""Simple robots that follow the requests to a module's driver.

This file does not use ROS; the nodes next to it handle messages.

A real driver follows the same rules:

* it drives to the latest goal while goals arrive, and stops when none arrived for `PATIENCE_S`;
* it drops a goal that echoes the stamp of a pose of more than `ECHO_AGE_MAX_S` ago;
* it always publishes its pose, whether it moves or not;
* it answers every docking request, including one that it has answered before: requests repeat until they are answered.
"""

import dataclasses
import math
import pathlib

import yaml

# Goals repeat every 0.5 s unless `--heartbeat-s` says otherwise.
PATIENCE_S = 1.5
# A module counts as standing once its poses stay where they are for 0.5 s. A goal that waited must not set it off then.
ECHO_AGE_MAX_S = 0.4


@dataclasses.dataclass(frozen=True)
class Pose:
    """Metres, and radians counter-clockwise from the x axis."""

    x: float
    y: float
    theta: float = 0.0


def turn_between(start, end):
    """The smaller angle from one heading to another."""
    return math.remainder(end - start, math.tau)


class Robot:
    """One module: it drives straight to its goal at `speed`, turning meanwhile, and docks in `docking_s`."""

    def __init__(self, pose, speed=1.0, turn_rate=2.0, docking_s=0.2):
        self.pose = pose
        self.speed = speed
        self.turn_rate = turn_rate
        self.docking_s = docking_s
        self.goal = None
        self.goal_received = -math.inf
        self.request = None
        self.request_began = 0.0

    def handle_goal(self, now, goal, echo_age):
        """Takes a goal; it holds until the next one, or for `PATIENCE_S`. Returns whether it came in time.

        The header of a goal has the stamp of the last pose that the module received from this driver. `echo_age` is how long
        ago that was, by the clock that stamps the poses; the module's clock does not matter.
        """
        if not 0.0 <= echo_age <= ECHO_AGE_MAX_S:
            return False
        self.goal = goal
        self.goal_received = now
        return True

    def step(self, now, elapsed):
        """Moves for `elapsed` seconds, if there is a goal that still holds."""
        if self.goal is None or now - self.goal_received > PATIENCE_S:
            self.goal = None
            return
        path_x, path_y = self.goal.x - self.pose.x, self.goal.y - self.pose.y
        distance = math.hypot(path_x, path_y)
        share = min(1.0, self.speed * elapsed / distance) if distance > 0.0 else 0.0
        turn = turn_between(self.pose.theta, self.goal.theta)
        turn = math.copysign(min(abs(turn), self.turn_rate * elapsed), turn)
        self.pose = Pose(self.pose.x + path_x * share, self.pose.y + path_y * share, self.pose.theta + turn)

    def is_docked(self, now, request):
        """Whether a docking request, which may arrive many times, is carried out by now."""
        if self.request != request:
            self.request = request
            self.request_began = now
        return now - self.request_began >= self.docking_s


def start_poses(scenario_file):
    """Where the modules of a scenario stand at the start, by identifier. Scenarios are in units of `module_size` metres."""
    scenario = yaml.safe_load(pathlib.Path(scenario_file).read_text(encoding="utf-8"))
    if "modules" in scenario:
        raise ValueError(f"{scenario_file}: draws its modules; list them under `configurations` and `singletons`")
    size = float(scenario.get("module_size", 1.0))
    groups = [configuration["modules"] for configuration in scenario.get("configurations") or []]
    groups.append(scenario.get("singletons") or [])
    return {
        module["id"]: Pose(size * float(module["x"]), size * float(module["y"]), float(module.get("theta", 0.0)))
        for group in groups
        for module in group
    }
