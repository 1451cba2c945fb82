"""What `ros2` tools do, through CycloneDDS, a DDS implementation that shares nothing with ours.

Usage:
    ros_tools.py graph NODE [--domain D] [--timeout S]
        prints the graph as JSON, once NODE and all endpoints that it owns were seen: {"nodes": [...], "endpoints": [...]}
    ros_tools.py gone NODE [--domain D] [--timeout S]
        waits until NODE was seen, prints a line, waits until it and its endpoints are gone, and prints how long that took
    ros_tools.py call NODE [--domain D] [--timeout S] [--timed]
        calls services by the mapping of CycloneDDS: lines of {"service": "...", "type": "...", "request": {...}} go in,
        replies come out; each request is sent as soon as the service is seen, as tools do; the name of a service is
        private to NODE, unless it begins with a slash; with --timed, prints {"seconds": S} in place of each reply
    ros_tools.py echo TOPIC TYPE [--domain D] [--timeout S] [--count N] [--latched]
        prints samples of TOPIC as they come; with --latched, those from before as well
"""

import argparse
import dataclasses
import json
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from formation_dds import Types, samples  # noqa: E402
from service_definitions import SERVICES  # noqa: E402

from cyclonedds.builtin import (  # noqa: E402
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import make_idl_struct, types  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402
from rosbags.typesys import get_types_from_msg  # noqa: E402

RELIABLE = Policy.Reliability.Reliable(duration(seconds=1))
INTERVAL_S = 0.01


class Graph:
    """What is known of nodes and endpoints."""

    def __init__(self, participant):
        node_types = Types()
        idl = node_types.get("rmw_dds_common/msg/ParticipantEntitiesInfo")
        qos = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(100))
        topic = Topic(participant, "ros_discovery_info", idl, qos=qos)
        self.discovery = DataReader(participant, topic, qos=qos)
        readers = {
            "participant": BuiltinDataReader(participant, BuiltinTopicDcpsParticipant),
            "subscription": BuiltinDataReader(participant, BuiltinTopicDcpsSubscription),
            "publisher": BuiltinDataReader(participant, BuiltinTopicDcpsPublication),
        }
        self.readers = {
            kind: (reader, ReadCondition(reader, ViewState.Any | InstanceState.Alive | SampleState.Any))
            for kind, reader in readers.items()
        }
        self.nodes_by_participant = {}

    def alive(self, kind):
        reader, condition = self.readers[kind]
        return reader.read(N=1000, condition=condition)

    def nodes(self):
        for sample in self.discovery.take(N=1000):
            if sample.sample_info.valid_data:
                self.nodes_by_participant[bytes(sample.gid.data)] = sample.node_entities_info_seq
        # As in ROS 2, the nodes of a participant go with it.
        alive = {sample.key.bytes for sample in self.alive("participant")}
        return [
            {
                "namespace": node.node_namespace,
                "name": node.node_name,
                "readers": sorted(bytes(gid.data).hex() for gid in node.reader_gid_seq),
                "writers": sorted(bytes(gid.data).hex() for gid in node.writer_gid_seq),
            }
            for participant, nodes in self.nodes_by_participant.items()
            if participant in alive
            for node in nodes
        ]

    def endpoints(self):
        found = []
        for kind in ("subscription", "publisher"):
            for sample in self.alive(kind):
                qos = sample.qos
                found.append(
                    {
                        "kind": kind,
                        "id": sample.key.bytes.hex(),
                        "topic": sample.topic_name,
                        "type": sample.type_name,
                        "reliable": isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable),
                        "transient_local": qos[Policy.Durability] == Policy.Durability.TransientLocal,
                    }
                )
        return found

    def of(self, name):
        """The node of this fully qualified name and its endpoints; None while any of them was not seen."""
        for node in self.nodes():
            if f"{node['namespace'].rstrip('/')}/{node['name']}" != name:
                continue
            owned = set(node["readers"]) | set(node["writers"])
            endpoints = [endpoint for endpoint in self.endpoints() if endpoint["id"] in owned]
            if len(endpoints) == len(owned):
                return {"node": node, "endpoints": endpoints}
        return None


def wait(arguments, what, attempt):
    """What `attempt` returns as soon as that is something."""
    deadline = time.monotonic() + arguments.timeout
    while True:
        found = attempt()
        if found:
            return found
        if time.monotonic() > deadline:
            name = what() if callable(what) else what
            sys.exit(f"{name} did not come within {arguments.timeout} s")
        time.sleep(INTERVAL_S)


def graph(arguments):
    known = Graph(DomainParticipant(arguments.domain))
    # A node announces its endpoints one by one, so the list is complete when nothing new came for a second.
    seen, since = None, time.monotonic()
    deadline = since + arguments.timeout
    while seen is None or time.monotonic() < since + 1.0:
        now = known.of(arguments.name)
        if now != seen:
            seen, since = now, time.monotonic()
        if time.monotonic() > deadline:
            sys.exit(f"{arguments.name} and all of its endpoints were not seen within {arguments.timeout} s")
        time.sleep(INTERVAL_S)
    prefix = seen["endpoints"][0]["id"][:24]
    owned = {endpoint["id"] for endpoint in seen["endpoints"]}
    seen["ownerless"] = [
        endpoint for endpoint in known.endpoints() if endpoint["id"][:24] == prefix and endpoint["id"] not in owned
    ]
    print(json.dumps(seen), flush=True)
    return 0


def gone(arguments):
    known = Graph(DomainParticipant(arguments.domain))
    found = wait(arguments, arguments.name, lambda: known.of(arguments.name))
    prefix = found["endpoints"][0]["id"][:24]
    print(json.dumps({"seen": len(found["endpoints"])}), flush=True)
    began = time.monotonic()

    def left():
        nodes = (f"{node['namespace'].rstrip('/')}/{node['name']}" for node in known.nodes())
        endpoints = (endpoint["topic"] for endpoint in known.endpoints() if endpoint["id"].startswith(prefix))
        return [node for node in nodes if node == arguments.name] + list(endpoints)

    wait(arguments, lambda: f"the end of {', '.join(left())}", lambda: not left())
    print(json.dumps({"gone_after_s": time.monotonic() - began}), flush=True)
    return 0


class Client:
    """Calls one service as rmw_cyclonedds does: a header of client and sequence number stands before the data."""

    def __init__(self, participant, interfaces, service, name):
        request, response = SERVICES[name]
        package, package_part, base = name.split("/")
        self.interfaces = interfaces
        self.fields = {}
        for kind, text in (("Request", request), ("Response", response)):
            ((_, self.fields[kind]),) = get_types_from_msg(text, f"{package}/msg/{base}_{kind}").values()
        qos = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(10))

        def topic(prefix, suffix, kind):
            idl = make_idl_struct(
                f"{base}_{kind}",
                f"{package}::{package_part}::dds_::{base}_{kind}_",
                {
                    "header_client": types.uint64,
                    "header_sequence": types.int64,
                    **{field: interfaces.field(node) for field, node in self.fields[kind]},
                },
            )
            return Topic(participant, f"{prefix}{service}{suffix}", idl, qos=qos), idl

        request_topic, self.request = topic("rq", "Request", "Request")
        reply_topic, _ = topic("rr", "Reply", "Response")
        self.replies = DataReader(participant, reply_topic, qos=qos)
        self.requests = DataWriter(participant, request_topic, qos=qos)
        self.topics = {request_topic.name: "subscription", reply_topic.name: "publisher"}
        # The client chooses this number; no other node reads it.
        self.client, self.sequence = 0x1122334455667788, 0

    def is_served(self, known):
        served = {(endpoint["topic"], endpoint["kind"]) for endpoint in known.endpoints()}
        return served.issuperset(self.topics.items())

    def send(self, raw):
        """Sends a request and returns its number."""
        self.sequence += 1
        fields = self.fields["Request"]
        values = {field: self.interfaces.field_value(node, raw.get(field)) for field, node in fields}
        self.requests.write(self.request(header_client=self.client, header_sequence=self.sequence, **values))
        return self.sequence

    def taken(self):
        """The replies that came in: the number of the request, and what was answered."""
        replies = []
        for sample in self.replies.take(N=10):
            if sample.sample_info.valid_data and sample.header_client == self.client:
                reply = dataclasses.asdict(sample)
                fields = {key: value for key, value in reply.items() if not key.startswith("header_")}
                replies.append((sample.header_sequence, fields))
        return replies

    def call(self, arguments, raw):
        sequence = self.send(raw)
        ((answered, reply),) = wait(arguments, "a reply", self.taken)
        if answered != sequence:
            sys.exit(f"asked as number {sequence}, answered as number {answered}")
        return reply


def call(arguments):
    participant = DomainParticipant(arguments.domain)
    known, interfaces, clients = Graph(participant), Types(), {}
    for line in sys.stdin:
        order = json.loads(line)
        name = order["service"]
        service = name if name.startswith("/") else f"{arguments.name}/{name}"
        if service not in clients:
            clients[service] = Client(participant, interfaces, service, order["type"])
        wait(arguments, service, lambda: clients[service].is_served(known))
        start = time.monotonic()
        reply = clients[service].call(arguments, order["request"])
        seconds = round(time.monotonic() - start, 4)
        print(json.dumps({"seconds": seconds} if arguments.timed else reply), flush=True)
    return 0


def echo(arguments):
    interfaces = Types()
    participant = DomainParticipant(arguments.domain)
    durability = Policy.Durability.TransientLocal if arguments.latched else Policy.Durability.Volatile
    qos = Qos(RELIABLE, durability, Policy.History.KeepLast(1000))
    topic = Topic(participant, f"rt{arguments.name}", interfaces.get(arguments.type), qos=qos)
    left = arguments.count
    for sample in samples(DataReader(participant, topic, qos=qos), arguments.timeout):
        print(json.dumps(dataclasses.asdict(sample)), flush=True)
        left -= 1
        if left == 0:
            return 0
    print(f"{left} of {arguments.count} samples of {arguments.name} did not come", file=sys.stderr)
    return 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["graph", "gone", "call", "echo"])
    parser.add_argument("name")
    parser.add_argument("type", nargs="?")
    parser.add_argument("--latched", action="store_true")
    parser.add_argument("--timed", action="store_true")
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=30.0)
    arguments = parser.parse_args()
    return {"graph": graph, "gone": gone, "call": call, "echo": echo}[arguments.command](arguments)


if __name__ == "__main__":
    sys.exit(main())
