"""The formation's topics through CycloneDDS, a DDS implementation that shares nothing with ours.

The types are made from the .msg files, as any other ROS 2 party would make them. Samples go in and out as JSON, one a
line, with the field names of the .msg files.

Usage:
    formation_dds.py take TOPIC [--type TYPE [--latched | --best-effort]] [--domain D] [--count N] [--timeout S]
                                                                         prints samples as they come
    formation_dds.py put TOPIC [--type TYPE] [--domain D]                publishes lines of its input until that ends
    formation_dds.py garble TOPIC [--domain D]                           publishes bytes that are no sample, likewise
The last two first print {"ready": true}.
"""

import argparse
import dataclasses
import json
import os
import pathlib
import re
import sys
import time

MESSAGES = pathlib.Path(__file__).resolve().parents[2] / "msgs" / "msg"
PACKAGE = "formation_msgs"
PROTOCOL_VERSION = int(re.search(
    r"uint32 protocol_version (\d+)", (MESSAGES / "TargetConfiguration.msg").read_text(encoding="utf-8"))[1])
NAMESPACE = "/formation"

# Type and whether late subscribers get the latest samples.
TOPICS = {
    "target": ("TargetConfiguration", True),
    "module_states": ("ModuleStates", True),
    "roster": ("Roster", True),
    "claims": ("SpotClaim", True),
    "evictions": ("Eviction", True),
    "heartbeats": ("Heartbeat", False),
    "verdict": ("Verdict", True),
}

# Loopback without multicast: participants are sought at the ports of the first ones, again every second. By default each port is
# sought once, at the start. RustDDS seeks participants 0 to 11 only, so as a later participant CycloneDDS would never meet
# a process that misses that one packet, or whose participant begins afterwards.
LOOPBACK_ONLY = """
<CycloneDDS><Domain>
  <General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>40</MaxAutoParticipantIndex>
    <SPDPInterval>1 s</SPDPInterval><InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""
os.environ.setdefault("CYCLONEDDS_URI", LOOPBACK_ONLY)

from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import make_idl_struct, types  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

BASES = {
    "bool": bool,
    "byte": types.uint8,
    "char": types.uint8,
    "int8": types.int8,
    "uint8": types.uint8,
    "uint32": types.uint32,
    "uint64": types.uint64,
    "int32": types.int32,
    "int64": types.int64,
    "float32": types.float32,
    "float64": types.float64,
    "string": str,
}


def domain_id(text):
    """A domain, read as ROS 2 reads ROS_DOMAIN_ID: as `strtoul` does with base 0."""
    digits = text.strip().removeprefix("+")
    base = 16 if digits[:2].lower() == "0x" else 8 if digits.startswith("0") else 10
    return int(digits, base)


class Types:
    """Classes for the package's messages, made when first asked for."""

    def __init__(self):
        self.definitions = dict(get_typestore(Stores.ROS2_JAZZY).fielddefs)
        for path in sorted(MESSAGES.glob("*.msg")):
            self.definitions.update(get_types_from_msg(path.read_text(), f"{PACKAGE}/msg/{path.stem}"))
        self.made = {}

    def add(self, name, text):
        """Defines a type, such as a section of an action."""
        ((_, self.definitions[name]),) = get_types_from_msg(text, name).items()

    def get(self, name):
        """The class of a type such as `formation_msgs/msg/Verdict`."""
        if name not in self.made:
            package, kind, base = name.split("/")
            _, fields = self.definitions[name]
            self.made[name] = make_idl_struct(
                base, f"{package}::{kind}::dds_::{base}_", {field: self.field(node) for field, node in fields}
            )
        return self.made[name]

    def field(self, node):
        kind, content = node
        if kind.name == "BASE":
            return BASES[content[0]]
        if kind.name == "NAME":
            return self.get(content)
        if kind.name == "SEQUENCE":
            return types.sequence[self.field(content[0])]
        if kind.name == "ARRAY":
            return types.array[self.field(content[0]), content[1]]
        raise ValueError(f"unexpected kind of field: {kind.name}")

    def value(self, name, raw):
        """A message of that type from JSON; fields that are left out are zero, empty or false, but for version and size."""
        _, fields = self.definitions[name]
        defaults = {"protocol_version": PROTOCOL_VERSION, "module_size": 1.0}
        raw = {field: defaults[field] for field, _ in fields if field in defaults} | raw
        unknown = set(raw) - {field for field, _ in fields}
        if unknown:
            raise ValueError(f"{name} has no field {', '.join(sorted(unknown))}")
        return self.get(name)(**{field: self.field_value(node, raw.get(field)) for field, node in fields})

    def field_value(self, node, raw):
        kind, content = node
        if kind.name == "BASE":
            zero = {"bool": False, "string": "", "float32": 0.0, "float64": 0.0}.get(content[0], 0)
            return zero if raw is None else raw
        if kind.name == "NAME":
            return self.value(content, raw or {})
        if kind.name == "ARRAY":
            return [self.field_value(content[0], entry) for entry in raw or [None] * content[1]]
        return [self.field_value(content[0], entry) for entry in raw or []]


class Session:
    """A participant in the formation's domain."""

    def __init__(self, domain, namespace=NAMESPACE):
        self.types = Types()
        self.participant = DomainParticipant(domain)
        self.namespace = namespace

    def topic(self, name):
        type_name, latched = TOPICS[name]
        if latched:
            policies = [Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal]
        else:
            policies = [Policy.Reliability.BestEffort, Policy.Durability.Volatile]
        qos = Qos(*policies, Policy.History.KeepLast(1000))
        idl = self.types.get(f"{PACKAGE}/msg/{type_name}")
        return Topic(self.participant, f"rt{self.namespace}/{name}", idl, qos=qos), qos

    def reader(self, name):
        topic, qos = self.topic(name)
        return DataReader(self.participant, topic, qos=qos)

    def writer(self, name):
        topic, qos = self.topic(name)
        return DataWriter(self.participant, topic, qos=qos)

    def other_topic(self, path, type_name, latched=False, best_effort=False):
        """A topic that is not in `TOPICS`, with the quality that ROS 2 has by default, latched, or best effort."""
        durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
        reliability = Policy.Reliability.BestEffort if best_effort else Policy.Reliability.Reliable(duration(seconds=1))
        qos = Qos(reliability, durability, Policy.History.KeepLast(1000))
        path = path if path.startswith("/") else f"{self.namespace}/{path}"
        return Topic(self.participant, f"rt{path}", self.types.get(type_name), qos=qos), qos

    def other_reader(self, path, type_name, latched=False, best_effort=False):
        topic, qos = self.other_topic(path, type_name, latched, best_effort)
        return DataReader(self.participant, topic, qos=qos)

    def other_writer(self, path, type_name, latched=False):
        topic, qos = self.other_topic(path, type_name, latched)
        return DataWriter(self.participant, topic, qos=qos)

    def message(self, name, raw):
        return self.types.value(f"{PACKAGE}/msg/{TOPICS[name][0]}", raw)


def samples(reader, timeout):
    """Valid samples as they come, until nothing came for `timeout` seconds."""
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        for sample in reader.take(N=64):
            if sample.sample_info.valid_data:
                yield sample
                deadline = time.monotonic() + timeout
        time.sleep(0.02)


def take(arguments):
    session = Session(arguments.domain)
    left = arguments.count
    if arguments.type:
        reader = session.other_reader(arguments.topic, arguments.type, arguments.latched, arguments.best_effort)
    else:
        reader = session.reader(arguments.topic)
    for sample in samples(reader, arguments.timeout):
        print(json.dumps(dataclasses.asdict(sample)), flush=True)
        left -= 1
        if left == 0:
            return 0
    print(f"{left} of {arguments.count} samples of {arguments.topic} did not come", file=sys.stderr)
    return 1


def put(arguments):
    session = Session(arguments.domain)
    if arguments.type:
        writer = session.other_writer(arguments.topic, arguments.type)
    else:
        writer = session.writer(arguments.topic)
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        sample = json.loads(line)
        message = session.types.value(arguments.type, sample) if arguments.type else session.message(arguments.topic, sample)
        writer.write(message)
    return 0


def garble(arguments):
    """Under the topic's type name, but with another type: a list of four thousand million entries that are not there."""
    session = Session(arguments.domain)
    base, _ = TOPICS[arguments.topic]
    name = f"{PACKAGE}::msg::dds_::{base}_"
    session.types.made[f"{PACKAGE}/msg/{base}"] = make_idl_struct("Garbage", name, {"length": types.uint32})
    writer = session.writer(arguments.topic)
    print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin:
        writer.write(session.types.get(f"{PACKAGE}/msg/{base}")(length=0xFFFFFFFF))
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["take", "put", "garble"])
    parser.add_argument("topic", help=f"one of {', '.join(sorted(TOPICS))}, or any other together with --type")
    parser.add_argument("--type", help="such as std_msgs/msg/String, for a topic of no fixed type")
    parser.add_argument("--latched", action="store_true", help="take only from publishers that keep their last samples")
    parser.add_argument("--best-effort", action="store_true", help="take from publishers that send nothing again as well")
    parser.add_argument("--domain", type=domain_id, default="0")
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=30.0)
    arguments = parser.parse_args()
    if arguments.type is None and arguments.topic not in TOPICS:
        parser.error(f"{arguments.topic} needs its --type")
    return {"take": take, "put": put, "garble": garble}[arguments.command](arguments)


if __name__ == "__main__":
    sys.exit(main())
