#!/usr/bin/env python3
"""Takes a module out of the formation, or back into it, by a request to the agent that hosts it.

    python3 retire_module.py --agent module_4 --module 4
    python3 retire_module.py --agent module_4 --module 4 --rejoin
"""

import argparse
import sys

import rclpy
from ask import ask
from formation_msgs.srv import RetireModule
from interrupts import interrupted_once
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agent", required=True, help="the node that hosts the module, such as module_4")
    parser.add_argument("--module", type=int, required=True)
    parser.add_argument("--rejoin", action="store_true", help="take it back instead")
    parser.add_argument("--namespace", default="/formation")
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    interrupted_once(raises=True)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("retire_module", namespace=options.namespace)
    client = node.create_client(RetireModule, f"{options.agent}/retire_module")
    request = RetireModule.Request(module_id=options.module, rejoin=options.rejoin)
    try:
        response: RetireModule.Response = ask(node, client, request)
    except KeyboardInterrupt:
        return 130
    print(response.message)
    rclpy.try_shutdown()
    return 0 if response.success else 1


if __name__ == "__main__":
    sys.exit(main())
