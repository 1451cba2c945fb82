#!/usr/bin/env python3
"""Forms the target of a scenario: sends the goal, follows it, and prints the result. Ctrl-C cancels the goal, and the
modules then stand still. Ends with status 0 when the formation is as complete as the number of modules allows.

    python3 form_target.py --scenario figure1_ladder17 --expected-modules 17
"""

import argparse
import sys
import time

import rclpy
from action_msgs.msg import GoalStatus
from formation_msgs.action import FormConfiguration
from formation_msgs.msg import Progress
from interrupts import interrupted_once
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

STAGES = {
    Progress.STAGE_WAITING_FOR_TARGET: "waiting for a target",
    Progress.STAGE_GATHERING: "gathering",
    Progress.STAGE_PLANNING: "planning",
    Progress.STAGE_AGREEING: "agreeing",
    Progress.STAGE_ACTING: "acting",
    Progress.STAGE_DONE: "done",
}


def show(message):
    progress = message.feedback.progress
    stage = STAGES.get(progress.stage, "?")
    counts = f"joined {progress.joined}, planned {progress.planned}, settled {progress.settled} of {progress.to_fill}"
    print(f"{stage}: {counts}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", required=True, help="its name in the publisher's scenario folder")
    parser.add_argument("--expected-modules", type=int, default=0, help="how many modules take part; 0: not known")
    parser.add_argument("--namespace", default="/formation")
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    # Ctrl-C must leave the node alive, so that it can cancel its goal.
    interrupted_once(raises=True)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("form_target", namespace=options.namespace)
    client = ActionClient(node, FormConfiguration, "form_configuration")
    if not client.wait_for_server(timeout_sec=10.0):
        sys.exit("no node serves form_configuration: is target_publisher running, and RMW_IMPLEMENTATION the same?")
    # A client of Fast DDS can find the server before the server has matched it, and would then wait three seconds.
    time.sleep(0.2)
    goal = FormConfiguration.Goal(scenario=options.scenario, expected_modules=options.expected_modules)
    sent = client.send_goal_async(goal, feedback_callback=show)
    rclpy.spin_until_future_complete(node, sent, timeout_sec=10.0)
    handle = sent.result()
    if handle is None:
        sys.exit("form_configuration did not answer within 10 s")
    if not handle.accepted:
        sys.exit("the goal was not accepted")
    ended = handle.get_result_async()
    try:
        rclpy.spin_until_future_complete(node, ended)
    except KeyboardInterrupt:
        rclpy.spin_until_future_complete(node, handle.cancel_goal_async())
        rclpy.spin_until_future_complete(node, ended)
    response = ended.result()
    result: FormConfiguration.Result = response.result
    print(result.message)
    rclpy.try_shutdown()
    return 0 if response.status == GoalStatus.STATUS_SUCCEEDED else 1


if __name__ == "__main__":
    sys.exit(main())
