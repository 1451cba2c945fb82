"""Joins late, again and again: which samples of the latched topics `target` and `verdict` does each new participant get?

Prints {"ready": true}. For each line of its input it makes a new participant, waits until both topics gave it a sample, and a
second more. It prints `target`, the names of the targets that it got, `verdict`, the stamps of the verdicts, and `volatile`, the
names of the targets since the last line that a volatile subscriber got, which is there from the start.

Usage: late_joiner.py (fast | cyclone) DOMAIN
"""

import json
import sys
import time

TOPICS = ("target", "verdict")
LIMIT_S = 20.0
MORE_S = 1.0


def said(topic, sample):
    stamp = sample.header.stamp
    return sample.name if topic == "target" else {"sec": stamp.sec, "nanosec": stamp.nanosec}


def collect(poll):
    """What `poll` gives, which returns pairs of a topic and a sample, waiting for 20 ms at most."""
    got = {topic: [] for topic in TOPICS}
    since, complete = time.monotonic(), None
    while True:
        now = time.monotonic()
        if complete is None and all(got.values()):
            complete = now
        if now > since + LIMIT_S or complete is not None and now > complete + MORE_S:
            return got
        for topic, sample in poll():
            got[topic].append(said(topic, sample))


class Fast:
    """rclpy."""

    def __init__(self, domain):
        self.domain = domain
        self.standing = self.join("standing", ("target",), volatile=True)

    def join(self, name, topics, volatile=False):
        """A node of a participant of its own: its context, its executor, and the samples that it gets."""
        import rclpy
        from formation_msgs.msg import TargetConfiguration, Verdict
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile

        context = rclpy.Context()
        rclpy.init(context=context, domain_id=self.domain)
        node = rclpy.create_node(name, context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        arrived = []
        durability = DurabilityPolicy.VOLATILE if volatile else DurabilityPolicy.TRANSIENT_LOCAL
        kinds = {"target": TargetConfiguration, "verdict": Verdict}
        for topic in topics:
            node.create_subscription(
                kinds[topic],
                f"/formation/{topic}",
                lambda sample, topic=topic: arrived.append((topic, sample)),
                QoSProfile(depth=100, durability=durability),
            )
        return context, node, executor, arrived

    def taken(self, executor, arrived):
        executor.spin_once(timeout_sec=0.01)
        new = arrived.copy()
        arrived.clear()
        return new

    def volatile(self):
        _, _, executor, arrived = self.standing
        return self.taken(executor, arrived)

    def late(self):
        import rclpy

        context, node, executor, arrived = self.join("late_joiner", TOPICS)
        yield lambda: self.taken(executor, arrived)
        node.destroy_node()
        rclpy.shutdown(context=context)


class Cyclone:
    """CycloneDDS."""

    def __init__(self, domain):
        import formation_dds

        self.domain = domain
        self.session = formation_dds.Session
        self.standing = self.session(domain).other_reader("target", "formation_msgs/msg/TargetConfiguration")

    def taken(self, readers):
        time.sleep(0.01)
        return [
            (topic, sample) for topic, reader in readers.items() for sample in reader.take(N=64) if sample.sample_info.valid_data
        ]

    def volatile(self):
        return self.taken({"target": self.standing})

    def late(self):
        session = self.session(self.domain)
        readers = {topic: session.reader(topic) for topic in TOPICS}
        yield lambda: self.taken(readers)


def main():
    vendor = {"fast": Fast, "cyclone": Cyclone}[sys.argv[1]](int(sys.argv[2]))
    since_last = []

    def poll(taken):
        since_last.extend(said(topic, sample) for topic, sample in vendor.volatile())
        return taken()

    print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin:
        for taken in vendor.late():
            got = collect(lambda taken=taken: poll(taken))
        print(json.dumps(got | {"volatile": since_last}), flush=True)
        since_last.clear()


main()
