"""Joins late, again and again: which samples of the latched topics `target` and `verdict` does each new participant get?

Prints {"ready": true}. For each line of its input it makes a new participant, waits until both topics gave it a sample, and a second
more, and prints `target`, the names of the targets that it got, and `verdict`, the stamps of the verdicts.

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


def fast(domain):
    import rclpy
    from formation_msgs.msg import TargetConfiguration, Verdict
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("late_joiner", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    arrived = []
    for topic, kind in zip(TOPICS, (TargetConfiguration, Verdict)):
        quality = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(
            kind, f"/formation/{topic}", lambda sample, topic=topic: arrived.append((topic, sample)), quality
        )

    def poll():
        executor.spin_once(timeout_sec=0.02)
        new = arrived.copy()
        arrived.clear()
        return new

    got = collect(poll)
    node.destroy_node()
    rclpy.shutdown(context=context)
    return got


def cyclone(domain):
    import formation_dds

    session = formation_dds.Session(domain)
    readers = {topic: session.reader(topic) for topic in TOPICS}

    def poll():
        time.sleep(0.02)
        return [
            (topic, sample) for topic, reader in readers.items() for sample in reader.take(N=64) if sample.sample_info.valid_data
        ]

    return collect(poll)


def main():
    join, domain = {"fast": fast, "cyclone": cyclone}[sys.argv[1]], int(sys.argv[2])
    print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin:
        print(json.dumps(join(domain)), flush=True)


main()
