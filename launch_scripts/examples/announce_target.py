#!/usr/bin/env python3
"""Announces the target of a scenario, as `target_publisher` does, and keeps it for nodes that start later.

    python3 announce_target.py --scenario figure1_ladder17.yaml
"""

import argparse
import pathlib
import sys
import time

import rclpy
import yaml
from formation_msgs.msg import Area, Edge, Spot, TargetConfiguration
from interrupts import interrupted_once
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

TRANSIENT_LOCAL = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def area_of(box, size):
    """A box, which scenarios have in units."""
    return Area(
        x=size * float(box["x"]), y=size * float(box["y"]),
        width=size * float(box["width"]), height=size * float(box["height"]))


def announcement(scenario, options):
    """The message for a scenario; planner parameters that the scenario leaves out keep the defaults of the message."""
    target = scenario["target"]
    message = TargetConfiguration(name=scenario.get("name", ""), expected_modules=options.expected_modules)
    message.session = options.session
    message.header.frame_id = target.get("frame_id", "map")
    # Scenarios are in units, messages in metres.
    size = message.module_size = float(scenario.get("module_size", 1.0))
    message.body = ["square", "circle"].index(scenario.get("body", "square"))
    message.body_width = size * float(scenario.get("body_width", 0.9))
    # The highest revision holds, so later announcements replace this one.
    message.revision = int(time.time() * 1000)
    message.obstacles = [area_of(box, size) for box in scenario.get("obstacles") or []]
    if "arena" in scenario:
        message.arena = area_of(scenario["arena"], size)
    message.spots = [
        Spot(id=spot["id"], x=size * float(spot["x"]), y=size * float(spot["y"]), theta=float(spot.get("theta", 0.0)))
        for spot in target["spots"]
    ]
    message.edges = [Edge(first=first, second=second) for first, second in target.get("edges", [])]
    return message


class Announcer(Node):
    """Publishes one target, at the start and once more after a second.

    Fast DDS may send the first sample before a subscription is matched, and offers it again after three seconds only.
    """

    def __init__(self, options):
        super().__init__("announce_target", namespace=options.namespace)
        scenario = yaml.safe_load(pathlib.Path(options.scenario).read_text(encoding="utf-8"))
        self.message = announcement(scenario, options)
        self.message.header.stamp = self.get_clock().now().to_msg()
        self.publisher = self.create_publisher(TargetConfiguration, "target", TRANSIENT_LOCAL)
        self.publisher.publish(self.message)
        self.timer = self.create_timer(1.0, self.publish_again)
        self.get_logger().info(f"announced `{self.message.name}` with {len(self.message.spots)} spots; Ctrl-C ends")

    def publish_again(self):
        self.publisher.publish(self.message)
        self.timer.cancel()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--expected-modules", type=int, default=0, help="how many modules take part; 0: not known")
    parser.add_argument("--session", type=int, default=0, help="the session of the agents, which `formation run` prints")
    parser.add_argument("--namespace", default="/formation")
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    interrupted = interrupted_once()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = Announcer(options)
    while not interrupted.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
