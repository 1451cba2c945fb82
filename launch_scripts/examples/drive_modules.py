#!/usr/bin/env python3
"""Plays the robots of a scenario: for each module it drives to the goals, publishes the pose, and docks.

Start it in addition to modules that run with `--motion external`, in the same domain:

    python3 drive_modules.py --scenario figure1_ladder17.yaml

For your own robots keep the topics, and replace `robot_model.Robot` by your robot.
"""

import argparse
import math
import sys
import time

import rclpy
from formation_msgs.msg import DockingRequest, DockingResult
from geometry_msgs.msg import PoseStamped
from interrupts import interrupted_once
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from robot_model import Pose, Robot, start_poses


class ModuleDriver:
    """The topics of one module, and the robot behind them."""

    def __init__(self, node, module, robot, source):
        self.node = node
        self.module = module
        self.robot = robot
        prefix = f"module_{module}"
        if source == "odom":
            self.poses = node.create_publisher(Odometry, f"{prefix}/odom", 10)
        else:
            self.poses = node.create_publisher(PoseStamped, f"{prefix}/pose", 10)
        self.results = node.create_publisher(DockingResult, f"{prefix}/docking_result", 10)
        node.create_subscription(PoseStamped, f"{prefix}/goal_pose", self.handle_goal, 10)
        node.create_subscription(DockingRequest, f"{prefix}/docking", self.handle_request, 10)

    def handle_goal(self, message):
        position, orientation = message.pose.position, message.pose.orientation
        goal = Pose(position.x, position.y, 2.0 * math.atan2(orientation.z, orientation.w))
        echo = message.header.stamp
        age = self.node.stamp_time() - (echo.sec + echo.nanosec * 1e-9)
        if not self.robot.handle_goal(time.monotonic(), goal, age):
            self.node.get_logger().warning(f"dropped a goal of module {self.module}, which echoes a pose of {age:.2f} s ago")

    def handle_request(self, message):
        if not self.robot.is_docked(time.monotonic(), message.request):
            # The request repeats until it is answered.
            return
        what = "docked to" if message.action == DockingRequest.ACTION_DOCK else "undocked from"
        self.node.get_logger().info(f"module {self.module} {what} module {message.other_module_id}")
        result = DockingResult(module_id=self.module, request=message.request, success=True)
        result.header.stamp = self.node.get_clock().now().to_msg()
        self.results.publish(result)

    def step(self, elapsed, frame_id):
        self.robot.step(time.monotonic(), elapsed)
        message = self.poses.msg_type()
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.header.frame_id = frame_id
        # An odometry message holds its pose together with a covariance.
        pose = message.pose.pose if isinstance(message, Odometry) else message.pose
        pose.position.x = self.robot.pose.x
        pose.position.y = self.robot.pose.y
        pose.orientation.z = math.sin(self.robot.pose.theta / 2.0)
        pose.orientation.w = math.cos(self.robot.pose.theta / 2.0)
        self.poses.publish(message)


class Drivers(Node):
    """The drivers of all modules of a scenario."""

    def __init__(self, options):
        super().__init__("drive_modules", namespace=options.namespace)
        self.frame_id = options.frame_id
        self.drivers = [
            ModuleDriver(self, module, Robot(pose, speed=options.speed), options.pose_source)
            for module, pose in sorted(start_poses(options.scenario).items())
        ]
        self.last_step = time.monotonic()
        self.create_timer(1.0 / options.rate, self.step)

    def stamp_time(self):
        """The present time by the clock that stamps the poses, in seconds."""
        return self.get_clock().now().nanoseconds * 1e-9

    def step(self):
        elapsed = time.monotonic() - self.last_step
        self.last_step += elapsed
        for driver in self.drivers:
            driver.step(elapsed, self.frame_id)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", required=True, help="the scenario file whose modules are driven")
    parser.add_argument("--namespace", default="/formation")
    parser.add_argument("--pose-source", choices=["pose", "odom"], default="pose")
    parser.add_argument("--frame-id", default="map", help="the frame of the poses")
    parser.add_argument("--speed", type=float, default=1.0, help="metres a second")
    parser.add_argument("--rate", type=float, default=20.0, help="poses a second")
    arguments = rclpy.utilities.remove_ros_args(sys.argv)
    options = parser.parse_args(arguments[1:])
    interrupted = interrupted_once()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = Drivers(options)
    while not interrupted.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
