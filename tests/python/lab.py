"""What a laboratory does with a formation by rclpy: subscribes to all topics, forms targets by the action, calls the services.

Prints one JSON object for each thing done, with how long its first answer took: {"did": ..., "seconds": ..., ...}.

Usage: lab.py NAMESPACE AGENT MODULES
"""

import json
import sys
import time

import rclpy
from formation_msgs.action import FormConfiguration
from formation_msgs.msg import (
    Eviction,
    Heartbeat,
    ModuleStates,
    Roster,
    SpotClaim,
    TargetConfiguration,
    Verdict,
)
from formation_msgs.srv import QueryStatus, RetireModule
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LIMIT_S = 40.0
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
TOPICS = {
    "module_states": (ModuleStates, LATCHED),
    "heartbeats": (Heartbeat, BEST_EFFORT),
    "target": (TargetConfiguration, LATCHED),
    "roster": (Roster, LATCHED),
    "claims": (SpotClaim, LATCHED),
    "verdict": (Verdict, LATCHED),
}
# Not every formation needs an eviction, so no sample is awaited.
SILENT = {"evictions": (Eviction, LATCHED)}


class Lab(Node):
    def __init__(self, namespace):
        super().__init__("lab", namespace=namespace)
        self.received = {}
        self.feedback = 0

    def wait(self, is_done, what, since):
        while not is_done():
            if time.monotonic() - since > LIMIT_S:
                sys.exit(f"{what}: nothing within {LIMIT_S:.0f} s")
            rclpy.spin_once(self, timeout_sec=0.02)
        print(json.dumps({"did": what, "seconds": round(time.monotonic() - since, 3)}), flush=True)

    def subscribe(self, topics):
        for name, (kind, quality) in topics.items():
            since = time.monotonic()
            self.create_subscription(
                kind, name, lambda sample, name=name: self.received.setdefault(name, sample), quality
            )
            if topics is TOPICS:
                self.wait(lambda name=name: name in self.received, f"first sample of {name}", since)

    def form(self, scenario, modules, cancel=False):
        client = ActionClient(self, FormConfiguration, "form_configuration")
        since = time.monotonic()
        self.wait(client.server_is_ready, "action server", since)
        time.sleep(0.2)
        since = time.monotonic()
        goal = FormConfiguration.Goal(scenario=scenario, expected_modules=modules)
        self.feedback = 0
        sent = client.send_goal_async(goal, feedback_callback=self.count_feedback)
        self.wait(sent.done, f"goal {scenario}", since)
        handle = sent.result()
        if not handle.accepted:
            print(json.dumps({"did": "refused", "scenario": scenario}), flush=True)
            return
        ended = handle.get_result_async()
        if cancel:
            self.wait(lambda: self.feedback > 0, "feedback", time.monotonic())
            since = time.monotonic()
            cancelled = handle.cancel_goal_async()
            self.wait(cancelled.done, "cancellation", since)
            print(json.dumps({"did": "cancelled", "goals": len(cancelled.result().goals_canceling)}), flush=True)
        since = time.monotonic()
        self.wait(ended.done, "end", since)
        print(json.dumps({"did": "result", "status": ended.result().status, "feedback": self.feedback}), flush=True)
        client.destroy()

    def count_feedback(self, _):
        self.feedback += 1

    def call(self, kind, name, request):
        client = self.create_client(kind, name)
        since = time.monotonic()
        self.wait(client.service_is_ready, f"server of {name}", since)
        time.sleep(0.2)
        since = time.monotonic()
        answer = client.call_async(request)
        self.wait(answer.done, f"answer of {name}", since)
        return answer.result()


def main():
    namespace, agent, modules = sys.argv[1], sys.argv[2], int(sys.argv[3])
    rclpy.init()
    lab = Lab(namespace)
    lab.form("singletons_10", modules)
    lab.subscribe(TOPICS)
    lab.subscribe(SILENT)
    status = lab.call(QueryStatus, "query_status", QueryStatus.Request(include_waiting=True))
    print(json.dumps({"did": "status", "target": status.target, "settled": status.progress.settled}), flush=True)
    for rejoin in (False, True):
        request = RetireModule.Request(module_id=3, rejoin=rejoin)
        answer = lab.call(RetireModule, f"{agent}/retire_module", request)
        print(json.dumps({"did": "rejoin" if rejoin else "retire", "success": answer.success}), flush=True)
    lab.form("no_such_scenario", modules)
    lab.form("undersupply", modules, cancel=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
