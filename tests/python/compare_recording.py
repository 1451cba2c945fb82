"""Compares a recording with what CycloneDDS, another vendor's DDS, received meanwhile, and one reader of MCAP with another.

Usage:
    compare_recording.py --domain D [--modules N]
        takes the bytes of every sample on the formation's topics, and on those of the modules 1 to N, and prints
        {"ready": true}. Then a line of its input names the recording (MCAP). It reads that with the package `mcap` and with
        `rosbags`, and prints for each topic of it: `recorded` (samples in the file), `by_rosbags` (how many of them rosbags
        reads with the same bytes), `reencoded` (how many rosbags encodes to the same bytes again, by the definition in the
        file), `received` (samples that CycloneDDS took), `only_recorded` and `only_received` (samples whose bytes the other
        side does not have), and `reliable`
"""

import argparse
import collections
import json
import pathlib
import sys
import threading

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from formation_dds import NAMESPACE, TOPICS, Session, samples  # noqa: E402

from mcap.reader import make_reader  # noqa: E402
from rosbags.rosbag2 import Reader  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

# After this long without a sample, what was sent before has arrived.
QUIET_S = 1.0


# Of one module; the type, and whether late subscribers get the latest samples.
MODULE_TOPICS = {
    "goal_pose": ("geometry_msgs/msg/PoseStamped", False),
    "path": ("nav_msgs/msg/Path", True),
    "docking": ("formation_msgs/msg/DockingRequest", False),
    "pose": ("geometry_msgs/msg/PoseStamped", False),
    "odom": ("nav_msgs/msg/Odometry", False),
    "docking_result": ("formation_msgs/msg/DockingResult", False),
}


class Raw:
    """A sample as it arrived."""

    def __init__(self, data):
        self.data = bytes(data)


class RawType:
    """Stands for the type of a reader, and does not decode."""

    @staticmethod
    def deserialize(data):
        return Raw(data)

    @staticmethod
    def deserialize_key(data):
        """Of the end of a publisher, which is no sample."""


def raw_reader(session, name):
    if name in TOPICS:
        reader = session.reader(name)
    else:
        reader = session.other_reader(name, *MODULE_TOPICS[name.split("/")[1]])
    reader._topic.data_type = RawType
    return reader


def take(reader, received, stopped):
    while not stopped.is_set():
        for sample in samples(reader, QUIET_S):
            received[sample.data] += 1


def by_mcap(path):
    """The bytes of the samples of each topic."""
    recorded = collections.defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        header = reader.get_header()
        assert header.profile == "ros2", header
        counts = reader.get_summary().statistics.channel_message_counts
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr"), channel
            assert message.publish_time <= message.log_time, message
            recorded[channel.topic].append(message.data)
        assert sum(counts.values()) == sum(map(len, recorded.values())), counts
    return recorded


def by_rosbags(path):
    """The same, with those that its encoder makes again, and whether the publishers of the topic are reliable."""
    store = get_typestore(Stores.EMPTY)
    topics = {}
    with Reader(path) as reader:
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            (quality,) = connection.ext.offered_qos_profiles
            topics[connection.topic] = {"reliable": quality.reliability.name == "RELIABLE", "data": [], "reencoded": 0}
        for connection, _, data in reader.messages():
            topic = topics[connection.topic]
            topic["data"].append(bytes(data))
            message = store.deserialize_cdr(data, connection.msgtype)
            topic["reencoded"] += bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(data)
    return topics


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--modules", type=int, default=0)
    arguments = parser.parse_args()
    session = Session(arguments.domain)
    names = [*TOPICS, *(f"module_{id}/{name}" for id in range(1, arguments.modules + 1) for name in MODULE_TOPICS)]
    received = {name: collections.Counter() for name in names}
    stopped = threading.Event()
    readers = [(raw_reader(session, name), received[name]) for name in names]
    threads = [threading.Thread(target=take, args=(*reader, stopped)) for reader in readers]
    for thread in threads:
        thread.start()
    print(json.dumps({"ready": True}), flush=True)
    path = pathlib.Path(sys.stdin.readline().strip())
    stopped.set()
    for thread in threads:
        thread.join()
    result = {}
    rosbags = by_rosbags(path)
    for topic, recorded in by_mcap(path).items():
        other = rosbags[topic]
        taken = received[topic.removeprefix(f"{NAMESPACE}/")]
        counted = collections.Counter(recorded)
        result[topic] = {
            "recorded": len(recorded),
            "by_rosbags": (counted & collections.Counter(other["data"])).total(),
            "reencoded": other["reencoded"],
            "reliable": other["reliable"],
            "received": taken.total(),
            "only_recorded": (counted - taken).total(),
            "only_received": (taken - counted).total(),
        }
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
