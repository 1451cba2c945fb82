"""A peer that sends false messages to a formation, through CycloneDDS, in the names of the live modules that it observes.

It publishes MESSAGES messages, RATE of them a second, of each kind in turn: claims out of turn, claims for other modules and
for modules that do not exist, identifiers that no module has, lists longer than any formation, poses that are no number,
epochs that are over or far away, and heartbeats in the names of live modules. At the end it prints one line of JSON: how
many of each kind it sent.

With --silent it takes part for the same time and publishes nothing, to measure what a harmless peer costs.

With --stranger it publishes few messages, each of which could have a lasting effect: the roster of a module that does not
exist, with a quorum basis of such modules; a target of the highest revision there is, and a command to stop of the highest
revision. It prints {"forged": ...}. For each identifier that it then reads from its input, it is that module for a second: in
a run from the distant future, and in one that starts within the hour. Then it prints {"squatted": ...} and is silent.

Usage:
    hostile_peer.py [--domain D] [--messages M] [--rate R] [--silent | --stranger]
"""

import argparse
import dataclasses
import itertools
import json
import math
import sys
import time

from formation_dds import Session, samples

NONE = 0xFFFFFFFF
LISTENING, GATHERED, SETTLED, ACTIVE = 1, 2, 7, 1
STAGE_PLAN = 2
# Modules that do not exist.
STRANGER, OTHERS = 9_000, list(range(9_100, 9_105))
# A list with more entries than any message may have, and one as long as is allowed.
TOO_MANY, MANY = 10_001, 10_000
# Huge messages in all, of each kind: they fill the network, not the point that is made.
HUGE_MAX = 10


class Liar:
    """The formation that the peer observes, and the false messages that it makes from that."""

    def __init__(self, session):
        self.session = session
        self.writers = {topic: session.writer(topic) for topic in ["claims", "heartbeats", "module_states", "roster"]}
        self.target_writer = session.writer("target")
        self.sent = {}
        self.living = {}
        self.epoch = {"number": 1, "convener": 1}
        self.target = None
        self.plan = None

    def observe(self, patience):
        """Learns which modules are live, the epoch, and the target."""
        for sample in samples(self.session.reader("module_states"), patience):
            for state in sample.modules:
                self.living[state.module_id] = state.incarnation
        for sample in samples(self.session.reader("roster"), patience):
            if sample.epoch.number >= self.epoch["number"]:
                self.epoch = {"number": sample.epoch.number, "convener": sample.epoch.convener}
                self.plan = sample if sample.stage == STAGE_PLAN else self.plan
        for sample in samples(self.session.reader("target"), patience):
            self.target = {"revision": sample.revision, "expected": sample.expected_modules}

    def say(self, kind, topic, raw):
        writer = self.target_writer if topic == "target" else self.writers[topic]
        writer.write(self.session.message(topic, raw))
        self.sent[kind] = self.sent.get(kind, 0) + 1

    def claim(self, number, **changes):
        ids = sorted(self.living)
        module = ids[number % len(ids)]
        claim = {
            "epoch": self.epoch,
            "turn": number % 16,
            "claimant_id": module,
            "incarnation": self.living[module],
            "selections": [{"spot_id": 1, "module_id": module}],
        }
        return claim | changes

    def heartbeat(self, number, **changes):
        ids = sorted(self.living)
        module = ids[number % len(ids)]
        beat = {
            "module_id": module,
            "incarnation": self.living[module],
            "sequence": 1_000_000 + number,
            "uptime": {"sec": 1_000 + number, "nanosec": 0},
            "epoch": self.epoch,
            "phase": SETTLED,
        }
        return {"modules": [beat | changes]}

    def state(self, number, **changes):
        ids = sorted(self.living)
        module = ids[number % len(ids)]
        state = {
            "module_id": module,
            "incarnation": self.living[module],
            "sequence": 1_000_000 + number,
            "epoch": self.epoch,
            "phase": GATHERED,
            "service": ACTIVE,
            "configuration_id": NONE,
            "leader_id": NONE,
            "spot_id": NONE,
            "unit_id": NONE,
        }
        return {"modules": [state | changes]}

    def lies(self):
        """Every kind of false message in turn, without end: its name, its topic, and its content."""
        marks = [{"module_id": module, "sequence": 1} for module in range(MANY)]
        selections = [{"spot_id": spot, "module_id": spot} for spot in range(TOO_MANY)]
        beats = self.heartbeat(0)["modules"] * TOO_MANY
        kinds = [
            ("claim_out_of_turn", "claims", lambda n: self.claim(n)),
            ("claim_for_others", "claims", lambda n: self.claim(
                n, evictions=[{"evicted_module_id": 2, "by_module_id": 1, "from_spot_id": 1, "to_spot_id": NONE}],
                detached=sorted(self.living))),
            ("claim_of_no_module", "claims", lambda n: self.claim(n, claimant_id=9_000 + n % 50)),
            ("claim_of_an_old_epoch", "claims", lambda n: self.claim(
                n, claimant_id=9_000 + n % 50, epoch={"number": 1, "convener": 0})),
            ("claim_of_a_far_epoch", "claims", lambda n: self.claim(
                n, claimant_id=9_000 + n % 50, epoch={"number": 2**60, "convener": 3})),
            ("heartbeat_of_the_living", "heartbeats", lambda n: self.heartbeat(n)),
            ("heartbeat_of_a_later_run", "heartbeats", lambda n: self.heartbeat(n, incarnation=2**63)),
            ("heartbeat_of_an_earlier_run", "heartbeats", lambda n: self.heartbeat(n, incarnation=1)),
            ("heartbeat_of_no_module", "heartbeats", lambda n: self.heartbeat(
                n, module_id=100_000 + n, epoch={"number": 0, "convener": 0})),
            ("state_of_the_living", "module_states", lambda n: self.state(n)),
            ("state_of_no_module", "module_states", lambda n: self.state(n, module_id=100_000 + n, phase=1)),
            ("pose_that_is_no_number", "module_states", lambda n: self.state(n, x=math.nan)),
            ("pose_without_end", "module_states", lambda n: self.state(n, y=math.inf)),
            ("roster_of_an_old_epoch", "roster", lambda n: {"epoch": {"number": 1, "convener": 0}, "stage": 1}),
            ("roster_of_the_convener", "roster", lambda n: {
                "epoch": {"number": self.epoch["number"] + n, "convener": min(self.living)}, "stage": 1}),
            ("another_target", "target", lambda n: {
                "revision": self.target["revision"], "expected_modules": self.target["expected"],
                "header": {"frame_id": "map"}, "spots": [{"id": 1, "x": float(n), "y": 0.0, "theta": 0.0}],
                "planner": {"d_max": -1, "weight_loc": 1.0, "weight_dock": 0.1, "weight_undock": 0.05}}),
        ]
        huge = [
            ("huge_claim", "claims", lambda n: self.claim(n, selections=selections)),
            ("huge_state_of_no_module", "module_states", lambda n: self.state(
                n, module_id=200_000 + n, waited_for=marks, agreed_on=marks)),
            ("huge_heartbeat", "heartbeats", lambda n: {"modules": beats}),
        ]
        for number in itertools.count():
            yield from ((kind, topic, make(number)) for kind, topic, make in kinds)
            if number < HUGE_MAX:
                yield from ((kind, topic, make(number)) for kind, topic, make in huge)


def forge(liar):
    """Publishes what could keep the modules from all later epochs, targets and commands."""
    epoch = {"number": liar.epoch["number"] + 5, "convener": STRANGER}
    stop = {"revision": 2**64 - 1, "stopped": True}
    run = {"module_id": STRANGER, "incarnation": 1}
    member = run | {"service": ACTIVE, "configuration_id": NONE, "leader_id": NONE, "pinned_spot_id": NONE}
    roster = dataclasses.asdict(liar.plan) | {
        "epoch": epoch,
        "members": [member],
        "bodies": [],
        "voters": OTHERS, "removed_voters": [], "listed_voters": [],
    }
    target = dataclasses.asdict(liar.plan.target)
    for number in range(1, 5):
        uptime = {"sec": number, "nanosec": 0}
        beat = run | {"phase": LISTENING, "sequence": number, "uptime": uptime, "epoch": epoch, "stop": stop}
        liar.say("heartbeat", "heartbeats", {"modules": [beat]})
        if number == 2:
            liar.say("roster", "roster", roster)
            liar.say("target", "target", target | {"revision": 2**64 - 1, "spots": target["spots"][:1], "edges": []})
        time.sleep(0.2)


def squat(liar, module):
    """Sends heartbeats of a module for a second."""
    soon = int(time.time() * 1_000_000) + 3_600_000_000
    for number in range(1, 5):
        for incarnation in [2**63, soon]:
            beat = {"module_id": module, "incarnation": incarnation, "phase": LISTENING, "sequence": number}
            liar.say("squatter", "heartbeats", {"modules": [beat | {"uptime": {"sec": number, "nanosec": 0}}]})
        time.sleep(0.25)


def stranger(liar):
    while not liar.plan:
        liar.observe(0.5)
    forge(liar)
    print(json.dumps({"forged": liar.sent}), flush=True)
    for line in sys.stdin:
        squat(liar, int(line))
        print(json.dumps({"squatted": int(line)}), flush=True)
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--messages", type=int, default=10_000)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--silent", action="store_true")
    parser.add_argument("--stranger", action="store_true")
    arguments = parser.parse_args()
    liar = Liar(Session(arguments.domain))
    deadline = time.monotonic() + 20
    while not (liar.living and liar.target) and time.monotonic() < deadline:
        liar.observe(0.5)
    if not (liar.living and liar.target):
        print("no formation was observed", file=sys.stderr)
        return 1
    if arguments.stranger:
        return stranger(liar)
    print(json.dumps({"observed": sorted(liar.living)}), flush=True)
    began = time.monotonic()
    for count, (kind, topic, raw) in enumerate(itertools.islice(liar.lies(), arguments.messages)):
        due = began + count / arguments.rate
        wait = due - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        if not arguments.silent:
            liar.say(kind, topic, raw)
    took = time.monotonic() - began
    print(json.dumps({"sent": liar.sent, "total": sum(liar.sent.values()), "seconds": round(took, 2)}), flush=True)
    # What is on its way is let arrive.
    time.sleep(1.0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
