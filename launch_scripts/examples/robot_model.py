"""Robots that do what a module's driver is asked to do. No ROS in here: the nodes beside this file carry the messages.

A real driver keeps to the same rules:

* it goes to the latest goal while goals keep coming, and stops when none came for `PATIENCE_S`;
* it tells its pose all the time, whether it moves or not;
* it answers every docking request, also one that it has answered before, since requests repeat until they are answered.
"""

import dataclasses
import math
import pathlib

import yaml

# Goals repeat every 0.5 s unless `--heartbeat-s` says otherwise.
PATIENCE_S = 1.5


@dataclasses.dataclass(frozen=True)
class Pose:
    """Metres, and radians counter-clockwise from the x axis."""

    x: float
    y: float
    theta: float = 0.0


def turn_between(start, end):
    """The shorter way from one heading to another."""
    return math.remainder(end - start, math.tau)


class Robot:
    """One module: it drives straight to its goal at `speed`, turning on the way, and docks in `docking_s`."""

    def __init__(self, pose, speed=1.0, turn_rate=2.0, docking_s=0.2):
        self.pose = pose
        self.speed = speed
        self.turn_rate = turn_rate
        self.docking_s = docking_s
        self.goal = None
        self.goal_heard = -math.inf
        self.request = None
        self.request_began = 0.0

    def hear_goal(self, now, goal):
        """Takes a goal; it holds until the next one, or for `PATIENCE_S`."""
        self.goal = goal
        self.goal_heard = now

    def step(self, now, elapsed):
        """Moves for `elapsed` seconds, if there is a goal that still holds."""
        if self.goal is None or now - self.goal_heard > PATIENCE_S:
            self.goal = None
            return
        way_x, way_y = self.goal.x - self.pose.x, self.goal.y - self.pose.y
        way = math.hypot(way_x, way_y)
        share = min(1.0, self.speed * elapsed / way) if way > 0.0 else 0.0
        turn = turn_between(self.pose.theta, self.goal.theta)
        turn = math.copysign(min(abs(turn), self.turn_rate * elapsed), turn)
        self.pose = Pose(self.pose.x + way_x * share, self.pose.y + way_y * share, self.pose.theta + turn)

    def is_docked(self, now, request):
        """Whether a docking request, which may be heard many times, is carried out by now."""
        if self.request != request:
            self.request = request
            self.request_began = now
        return now - self.request_began >= self.docking_s


def start_poses(scenario_file):
    """Where the modules of a scenario stand at the start, by identifier."""
    scenario = yaml.safe_load(pathlib.Path(scenario_file).read_text(encoding="utf-8"))
    groups = [configuration["modules"] for configuration in scenario.get("configurations") or []]
    groups.append(scenario.get("singletons") or [])
    return {
        module["id"]: Pose(float(module["x"]), float(module["y"]), float(module.get("theta", 0.0)))
        for group in groups
        for module in group
    }
