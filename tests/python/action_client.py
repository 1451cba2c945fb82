"""A client of the action FormConfiguration through CycloneDDS, a DDS implementation that shares nothing with ours.

It does what the clients of ROS 2 do: sends a goal, asks for its result at once, and listens to feedback and status.

Usage:
    action_client.py ACTION [--domain D] [--timeout S]
        lines of {"goal": GOAL}, {"cancel": ID} and {"result": ID} go in, where an empty ID means all goals;
        {"accepted": ..., "goal": ID}, {"feedback": ..., "goal": ID}, {"statuses": {ID: STATUS}},
        {"cancelled": [ID...], "return_code": ...} and {"result": ..., "status": ..., "goal": ID} come out
"""

import argparse
import dataclasses
import json
import queue
import sys
import threading
import time
import uuid

from ros_tools import INTERVAL_S, RELIABLE, Client, Graph, wait
from formation_dds import Types
from service_definitions import INTERFACES, SERVICES

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

NAME = "formation_msgs/action/FormConfiguration"
GOAL, RESULT, FEEDBACK = (INTERFACES / "action" / "FormConfiguration.action").read_text().split("\n---\n")

# What rosidl makes of an action, as the design article on actions has it.
ID = "unique_identifier_msgs/UUID goal_id\n"
SERVICES[f"{NAME}_SendGoal"] = (
    f"{ID}formation_msgs/FormConfiguration_Goal goal",
    "bool accepted\nbuiltin_interfaces/Time stamp",
)
SERVICES[f"{NAME}_GetResult"] = (ID, "int8 status\nformation_msgs/FormConfiguration_Result result")


def raw_id(text):
    return {"uuid": list(bytes.fromhex(text)) if text else [0] * 16}


def text_id(goal_id):
    return bytes(goal_id["uuid"]).hex()


def report(**content):
    print(json.dumps(content), flush=True)


class ActionClient:
    """The client's ends of the action."""

    def __init__(self, participant, action):
        types = Types()
        for section, text in (("Goal", GOAL), ("Result", RESULT), ("Feedback", FEEDBACK)):
            types.add(f"formation_msgs/msg/FormConfiguration_{section}", text)
        types.add(f"{NAME}_FeedbackMessage", f"{ID}formation_msgs/FormConfiguration_Feedback feedback")

        def client(part, name):
            return Client(participant, types, f"{action}/_action/{part}", name)

        def reader(part, name, durability):
            qos = Qos(RELIABLE, durability, Policy.History.KeepLast(1000))
            return DataReader(participant, Topic(participant, f"rt{action}/_action/{part}", types.get(name), qos=qos), qos=qos)

        self.goals = client("send_goal", f"{NAME}_SendGoal")
        self.cancellations = client("cancel_goal", "action_msgs/srv/CancelGoal")
        self.results = client("get_result", f"{NAME}_GetResult")
        self.feedback = reader("feedback", f"{NAME}_FeedbackMessage", Policy.Durability.Volatile)
        self.statuses = reader("status", "action_msgs/msg/GoalStatusArray", Policy.Durability.TransientLocal)
        # The goal that each request is about.
        self.asked = {}

    def is_served(self, known):
        return all(client.is_served(known) for client in (self.goals, self.cancellations, self.results))

    def execute(self, order):
        if "goal" in order:
            goal = uuid.uuid4().hex
            self.asked["goal", self.goals.send({"goal_id": raw_id(goal), "goal": order["goal"]})] = goal
        elif "cancel" in order:
            self.cancellations.send({"goal_info": {"goal_id": raw_id(order["cancel"])}})
        else:
            self.ask_for_result(order["result"])

    def ask_for_result(self, goal):
        self.asked["result", self.results.send({"goal_id": raw_id(goal)})] = goal

    def listen(self):
        for number, reply in self.goals.taken():
            goal = self.asked.pop(("goal", number))
            report(accepted=reply["accepted"], goal=goal)
            if reply["accepted"]:
                self.ask_for_result(goal)
        for _, reply in self.cancellations.taken():
            cancelled = [text_id(info["goal_id"]) for info in reply["goals_canceling"]]
            report(cancelled=cancelled, return_code=reply["return_code"])
        for sample in self.feedback.take(N=100):
            if sample.sample_info.valid_data:
                feedback = dataclasses.asdict(sample)
                report(feedback=feedback["feedback"], goal=text_id(feedback["goal_id"]))
        for sample in self.statuses.take(N=100):
            if sample.sample_info.valid_data:
                statuses = dataclasses.asdict(sample)["status_list"]
                report(statuses={text_id(one["goal_info"]["goal_id"]): one["status"] for one in statuses})
        for number, reply in self.results.taken():
            report(result=reply["result"], status=reply["status"], goal=self.asked.pop(("result", number)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action")
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--timeout", type=float, default=30.0)
    arguments = parser.parse_args()
    participant = DomainParticipant(arguments.domain)
    known, client = Graph(participant), ActionClient(participant, arguments.action)
    wait(arguments, arguments.action, lambda: client.is_served(known))
    orders = queue.SimpleQueue()

    def read():
        for line in sys.stdin:
            orders.put(json.loads(line))
        orders.put(None)

    threading.Thread(target=read, daemon=True).start()
    while True:
        while not orders.empty():
            order = orders.get()
            if order is None:
                return 0
            client.execute(order)
        client.listen()
        time.sleep(INTERVAL_S)


if __name__ == "__main__":
    sys.exit(main())
