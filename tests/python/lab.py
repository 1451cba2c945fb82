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
    Edge,
    Eviction,
    Heartbeat,
    ModuleStates,
    Roster,
    Spot,
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

    def form(self, goal, cancel=False):
        client = ActionClient(self, FormConfiguration, "form_configuration")
        since = time.monotonic()
        self.wait(client.server_is_ready, "action server", since)
        time.sleep(0.2)
        since = time.monotonic()
        self.feedback = 0
        sent = client.send_goal_async(goal, feedback_callback=self.count_feedback)
        self.wait(sent.done, f"goal {goal.scenario or goal.target.name}", since)
        handle = sent.result()
        if not handle.accepted:
            print(json.dumps({"did": "refused", "scenario": goal.scenario}), flush=True)
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


def square():
    """A target of the laboratory's own: three rows of three spots."""
    spots = [Spot(id=1 + 3 * row + column, x=float(column), y=float(row)) for row in range(3) for column in range(3)]
    right = [Edge(first=1 + 3 * row + column, second=2 + 3 * row + column) for row in range(3) for column in range(2)]
    above = [Edge(first=spot, second=spot + 3) for spot in range(1, 7)]
    return TargetConfiguration(name="square", spots=spots, edges=right + above)


def main():
    namespace, agent, modules = sys.argv[1], sys.argv[2], int(sys.argv[3])
    rclpy.init()
    lab = Lab(namespace)
    lab.form(FormConfiguration.Goal(scenario="singletons_10", expected_modules=modules))
    lab.subscribe(TOPICS)
    lab.subscribe(SILENT)
    publishers = lab.get_publishers_info_by_topic("module_states")
    hashes = sorted({str(publisher.topic_type_hash) for publisher in publishers})
    print(json.dumps({"did": "type hashes", "found": hashes}), flush=True)
    status = lab.call(QueryStatus, "query_status", QueryStatus.Request(include_waiting=True))
    print(json.dumps({"did": "status", "target": status.target, "settled": status.progress.settled}), flush=True)
    for rejoin in (False, True):
        request = RetireModule.Request(module_id=3, rejoin=rejoin)
        answer = lab.call(RetireModule, f"{agent}/retire_module", request)
        print(json.dumps({"did": "rejoin" if rejoin else "retire", "success": answer.success}), flush=True)
    lab.form(FormConfiguration.Goal(target=square(), expected_modules=modules))
    status = lab.call(QueryStatus, "query_status", QueryStatus.Request())
    print(json.dumps({"did": "own status", "target": status.target, "settled": status.progress.settled}), flush=True)
    lab.form(FormConfiguration.Goal(scenario="no_such_scenario", expected_modules=modules))
    lab.form(FormConfiguration.Goal(scenario="undersupply", expected_modules=modules), cancel=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
