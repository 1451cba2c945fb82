#!/usr/bin/env python3
"""Adds a module to a running formation: starts its process, and waits until it has a spot or stands by as a spare.

A module announces itself; nobody has to be told. If a spot is open it is given one, else it stands by.

    python3 add_module.py --module 18 --x 2.5 --y 3.0
"""

import argparse
import subprocess
import sys

import rclpy
from formation_msgs.msg import ModuleState, ModuleStates
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watch(Node):
    """Waits for one module."""

    def __init__(self, module, namespace):
        super().__init__("add_module", namespace=namespace)
        self.module = module
        self.state = None
        self.create_subscription(ModuleStates, "module_states", self.hear_states, LATCHED)

    def hear_states(self, sample):
        for state in sample.modules:
            if state.module_id == self.module:
                self.state = state

    def is_placed(self):
        return self.state is not None and self.state.phase in (ModuleState.PHASE_SETTLED, ModuleState.PHASE_SPARE)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--module", type=int, required=True, help="the new module's identifier")
    parser.add_argument("--x", type=float, required=True)
    parser.add_argument("--y", type=float, required=True)
    parser.add_argument("--theta", type=float, default=0.0)
    parser.add_argument("--namespace", default="/formation")
    parser.add_argument("--program", default="module_agent", help="the program, if it is not on the PATH")
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    rclpy.init(args=sys.argv)
    command = [options.program, "--module", str(options.module), "--namespace", options.namespace]
    command += [f"--x={options.x}", f"--y={options.y}", f"--theta={options.theta}"]
    agent = subprocess.Popen(command)
    watch = Watch(options.module, options.namespace)
    try:
        told = False
        while agent.poll() is None:
            rclpy.spin_once(watch, timeout_sec=0.5)
            if watch.is_placed() and not told:
                settled = watch.state.phase == ModuleState.PHASE_SETTLED
                where = f"settled on spot {watch.state.spot_id}" if settled else "is a spare"
                print(f"module {options.module} {where}; Ctrl-C takes it away again", flush=True)
                told = True
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        agent.terminate()
        rclpy.try_shutdown()
    return agent.wait()


if __name__ == "__main__":
    sys.exit(main())
