"""The driver of launch_scripts/examples/drive_modules.py without ROS: the same robots, carried by CycloneDDS.

Usage:
    drive_modules.py --scenario FILE [--domain D] [--pose-source pose|odom] [--speed UNITS_PER_S]
                     [--clock-ahead S] [--deaf MODULE...] [--undockable MODULE...]

The clock that stamps the poses may be ahead of that of the machine. A deaf module publishes its pose and never moves; an
undockable one never answers docking requests. `push MODULE X Y` on the standard input is a hand that pushes a module by X and Y,
and `push all X Y` one that shoves all of them as a whole.
"""

import argparse
import math
import os
import pathlib
import queue
import sys
import threading
import time

from formation_dds import Session, domain_id

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "launch_scripts" / "examples"))

from interrupts import interrupted_once  # noqa: E402
from robot_model import Pose, Robot, start_poses  # noqa: E402

INTERVAL_S = 0.05


def read_pushes(pushes):
    for line in sys.stdin:
        _, modules, x, y = line.split()
        pushes.put((modules, float(x), float(y)))


class Driver:
    def __init__(self, session, module, robot, source, clock_ahead):
        self.session, self.module, self.robot, self.clock_ahead = session, module, robot, clock_ahead
        self.pose_type = "nav_msgs/msg/Odometry" if source == "odom" else "geometry_msgs/msg/PoseStamped"
        topic = f"module_{module}"
        self.poses = session.other_writer(f"{topic}/{source}", self.pose_type)
        self.results = session.other_writer(f"{topic}/docking_result", "formation_msgs/msg/DockingResult")
        self.goals = session.other_reader(f"{topic}/goal_pose", "geometry_msgs/msg/PoseStamped")
        self.requests = session.other_reader(f"{topic}/docking", "formation_msgs/msg/DockingRequest")

    def listen(self, now, is_deaf, is_undockable):
        for goal in self.goals.take(N=16):
            if goal.sample_info.valid_data and not is_deaf:
                position, orientation = goal.pose.position, goal.pose.orientation
                heading = 2.0 * math.atan2(orientation.z, orientation.w)
                echo = goal.header.stamp
                age = self.stamp_time() - (echo.sec + echo.nanosec * 1e-9)
                self.robot.handle_goal(now, Pose(position.x, position.y, heading), age)
        for request in self.requests.take(N=16):
            if not request.sample_info.valid_data or is_undockable:
                continue
            if self.robot.is_docked(now, request.request):
                answer = {"module_id": self.module, "request": request.request, "success": True}
                self.results.write(self.session.types.value("formation_msgs/msg/DockingResult", answer))

    def stamp_time(self):
        return time.time() + self.clock_ahead

    def publish_pose(self):
        pose = {
            "position": {"x": self.robot.pose.x, "y": self.robot.pose.y},
            "orientation": {
                "z": math.sin(self.robot.pose.theta / 2.0),
                "w": math.cos(self.robot.pose.theta / 2.0),
            },
        }
        if self.pose_type == "nav_msgs/msg/Odometry":
            pose = {"pose": pose}
        seconds, nanoseconds = divmod(int(self.stamp_time() * 1e9), 1_000_000_000)
        message = {"header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "map"}, "pose": pose}
        self.poses.write(self.session.types.value(self.pose_type, message))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--domain", type=domain_id, default=os.environ.get("ROS_DOMAIN_ID") or "0")
    parser.add_argument("--pose-source", choices=["pose", "odom"], default="pose")
    parser.add_argument("--speed", type=float, default=10.0)
    parser.add_argument("--clock-ahead", type=float, default=0.0)
    parser.add_argument("--deaf", type=int, nargs="*", default=[])
    parser.add_argument("--undockable", type=int, nargs="*", default=[])
    options = parser.parse_args()
    interrupted = interrupted_once()
    session = Session(options.domain)
    drivers = [
        Driver(
            session, module, Robot(pose, speed=options.speed, turn_rate=20.0), options.pose_source, options.clock_ahead
        )
        for module, pose in sorted(start_poses(options.scenario).items())
    ]
    pushes = queue.Queue()
    threading.Thread(target=read_pushes, args=[pushes], daemon=True).start()
    last = time.monotonic()
    while not interrupted.is_set():
        time.sleep(INTERVAL_S)
        now = time.monotonic()
        for driver in drivers:
            driver.listen(now, driver.module in options.deaf, driver.module in options.undockable)
            driver.robot.step(now, now - last)
            driver.publish_pose()
        while not pushes.empty():
            modules, x, y = pushes.get()
            for driver in drivers:
                if modules in ("all", str(driver.module)):
                    pose = driver.robot.pose
                    driver.robot.pose = Pose(pose.x + x, pose.y + y, pose.theta)
        last = now


if __name__ == "__main__":
    main()
