"""A client of the suite over Zenoh that was written by others: zenoh-ros2-sdk, with rosbags for CDR.

Usage: zenoh_peer.py PORT DOMAIN NAMESPACE

Connects to the router on PORT of loopback, receives a latched topic and a topic of best effort, calls a service, and lists the
endpoints that it sees. Prints one JSON object.
"""

import json
import pathlib
import sys
import threading

from zenoh_ros2_sdk import ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_service_names_and_types, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile, QosReliability
from zenoh_ros2_sdk.session import ZenohSession

MSGS = pathlib.Path(__file__).resolve().parent.parent.parent / "msgs"
WAIT_S = 20.0
LOG = """builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line"""


def text(kind, name):
    return (MSGS / kind / f"{name}.{kind}").read_text(encoding="utf-8")


def hashes():
    lines = (MSGS / "type_hashes.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split() for line in lines if not line.startswith("#"))


def first_sample(topic, message, definition, quality, router):
    """The first sample of a topic, as the SDK decodes it."""
    arrived = threading.Event()
    samples = []

    def keep(sample):
        samples.append(sample)
        arrived.set()

    subscriber = ROS2Subscriber(
        topic=topic,
        msg_type=message,
        callback=keep,
        msg_definition=definition,
        type_hash=hashes()[message],
        qos=quality,
        **router,
    )
    arrived.wait(WAIT_S)
    subscriber.close()
    return samples[0] if samples else None


def main():
    port, domain, namespace = sys.argv[1:]
    router = {"router_ip": "127.0.0.1", "router_port": int(port), "domain_id": int(domain)}
    session = ZenohSession.get_instance("127.0.0.1", int(port))
    session.register_message_type("int32 sec\nuint32 nanosec", "builtin_interfaces/msg/Time")
    session.register_message_type("int32 sec\nuint32 nanosec", "builtin_interfaces/msg/Duration")
    session.register_message_type("builtin_interfaces/Time stamp\nstring frame_id", "std_msgs/msg/Header")
    for nested in sorted(path.stem for path in (MSGS / "msg").glob("*.msg")):
        session.register_message_type(text("msg", nested), f"formation_msgs/msg/{nested}")
    heartbeats = QosProfile(reliability=QosReliability.BEST_EFFORT)
    message = "formation_msgs/msg/Heartbeat"
    heartbeat = first_sample(f"{namespace}/heartbeats", message, text("msg", "Heartbeat"), heartbeats, router)
    # The SDK finds the caches of topics in the root namespace only.
    latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL)
    line = first_sample("/rosout", "rcl_interfaces/msg/Log", LOG, latched, router)
    request, response = text("srv", "StopFormation").split("\n---\n")
    client = ROS2ServiceClient(
        service_name=f"{namespace}/stop_formation",
        srv_type="formation_msgs/srv/StopFormation",
        request_definition=request,
        response_definition=response,
        type_hash=hashes()["formation_msgs/srv/StopFormation"],
        timeout=WAIT_S,
        **router,
    )
    answer = client.call(resume=False)
    topics = dict(get_topic_names_and_types(**router))
    services = dict(get_service_names_and_types(**router))
    print(
        json.dumps(
            {
                "heartbeat": heartbeat is not None and len(heartbeat.modules),
                "log": line is not None and line.msg,
                "answer": answer is not None and [bool(answer.success), answer.message],
                "topics": topics,
                "services": services,
            },
            default=str,
        )
    )


if __name__ == "__main__":
    main()
