#!/usr/bin/env python3
"""Adds a module to a running formation, and waits until it has a spot or stands by as a spare.

A module announces itself; no other module needs an argument or a request. The formation gives the module an open spot,
else it stands by. Without --agent this program starts a process for the module, which Ctrl-C ends again; with --agent a
running process hosts the module.

    python3 add_module.py --module 18 --x 2.5 --y 3.0
    python3 add_module.py --module 18 --x 2.5 --y 3.0 --agent module_4
"""

import argparse
import subprocess
import sys

import rclpy
from ask import ask
from formation_msgs.msg import ModuleState, ModuleStates
from formation_msgs.srv import AddModule
from interrupts import interrupted_once
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

TRANSIENT_LOCAL = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ModuleObserver(Node):
    """Keeps the latest state of one module."""

    def __init__(self, module, namespace):
        super().__init__("add_module", namespace=namespace)
        self.module = module
        self.state = None
        self.create_subscription(ModuleStates, "module_states", self.handle_states, TRANSIENT_LOCAL)

    def handle_states(self, sample):
        for state in sample.modules:
            if state.module_id == self.module:
                self.state = state

    def is_placed(self):
        return self.state is not None and self.state.phase in (ModuleState.PHASE_SETTLED, ModuleState.PHASE_SPARE)


def start_process(options):
    """Starts a process for the module."""
    command = [options.program, "--module", str(options.module), "--namespace", options.namespace]
    # The arguments of the program are in units, those of the service in metres.
    size = options.module_size
    command += [f"--x={options.x / size}", f"--y={options.y / size}", f"--theta={options.theta}"]
    command += ["--ros-args", "-p", f"module_size:={size}"]
    return subprocess.Popen(command)


def ask_agent(observer, options):
    """Requests a running agent to host the module."""
    client = observer.create_client(AddModule, f"{options.agent}/add_module")
    request = AddModule.Request(module_id=options.module, x=options.x, y=options.y, theta=options.theta)
    response: AddModule.Response = ask(observer, client, request)
    print(response.message, flush=True)
    if not response.success:
        sys.exit(1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--module", type=int, required=True, help="the new module's identifier")
    parser.add_argument("--x", type=float, required=True, help="in metres")
    parser.add_argument("--y", type=float, required=True, help="in metres")
    parser.add_argument("--theta", type=float, default=0.0)
    parser.add_argument("--module-size", type=float, default=1.0, help="the size of the modules, in metres")
    parser.add_argument("--namespace", default="/formation")
    parser.add_argument("--agent", help="the node of a running agent that is to host the module, such as module_4")
    parser.add_argument("--program", default="module_agent", help="the program, if it is not on the PATH")
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    interrupted_once(raises=True)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    observer = ModuleObserver(options.module, options.namespace)
    process = None
    try:
        if options.agent:
            ask_agent(observer, options)
        else:
            process = start_process(options)
        while not observer.is_placed() and (process is None or process.poll() is None):
            rclpy.spin_once(observer, timeout_sec=0.5)
        if observer.is_placed():
            settled = observer.state.phase == ModuleState.PHASE_SETTLED
            where = f"settled on spot {observer.state.spot_id}" if settled else "is a spare"
            print(f"module {options.module} {where}", flush=True)
        while process is not None and process.poll() is None:
            rclpy.spin_once(observer, timeout_sec=0.5)
    except KeyboardInterrupt:
        pass
    finally:
        if process is not None:
            process.terminate()
        rclpy.try_shutdown()
    return 0 if process is None else process.wait()


if __name__ == "__main__":
    sys.exit(main())
