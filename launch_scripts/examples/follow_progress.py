#!/usr/bin/env python3
"""Follows a formation until the verifier has judged it: how many modules are in which phase, then the verdict.

Ends with status 0 when the formation is complete, or as complete as the number of modules allows.

    python3 follow_progress.py
"""

import collections
import sys

import rclpy
from formation_msgs.msg import ModuleState, ModuleStates, Verdict
from interrupts import interrupted_once
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

TRANSIENT_LOCAL = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)

PHASES = {
    ModuleState.PHASE_LISTENING: "listening",
    ModuleState.PHASE_GATHERED: "gathered",
    ModuleState.PHASE_COMPUTING: "computing its plan",
    ModuleState.PHASE_PLANNING: "planning",
    ModuleState.PHASE_AGREEING: "agreeing",
    ModuleState.PHASE_WAITING: "waiting",
    ModuleState.PHASE_MOVING: "moving",
    ModuleState.PHASE_SETTLED: "settled",
    ModuleState.PHASE_SPARE: "spare",
    ModuleState.PHASE_WAITING_FOR_QUORUM: "waiting for a quorum",
}
OUTCOMES = {
    Verdict.OUTCOME_COMPLETE: "COMPLETE",
    Verdict.OUTCOME_PARTIAL: "PARTIAL",
    Verdict.OUTCOME_FAILED: "FAILED",
    Verdict.OUTCOME_NOT_JUDGED: "NOT_JUDGED",
}


class Follower(Node):
    """Keeps the latest state of every module."""

    def __init__(self):
        super().__init__("follow_progress", namespace="/formation")
        self.states = {}
        self.shown = None
        self.verdict = None
        self.create_subscription(ModuleStates, "module_states", self.handle_states, TRANSIENT_LOCAL)
        self.create_subscription(Verdict, "verdict", self.handle_verdict, TRANSIENT_LOCAL)

    def handle_states(self, sample):
        for state in sample.modules:
            known = self.states.get(state.module_id)
            # Samples of earlier runs may arrive late: the latest state of the latest run holds.
            if known is None or (state.incarnation, state.sequence) > (known.incarnation, known.sequence):
                self.states[state.module_id] = state
        counts = collections.Counter(PHASES.get(state.phase, "?") for state in self.states.values())
        line = ", ".join(f"{count} {phase}" for phase, count in sorted(counts.items()))
        if line != self.shown:
            self.shown = line
            print(line, flush=True)

    def handle_verdict(self, verdict):
        print(f"{OUTCOMES.get(verdict.outcome, '?')}: {verdict.filled_spots} of {verdict.spots} spots are filled")
        for violation in verdict.violations:
            print(f"  {violation}")
        self.verdict = verdict


def main():
    interrupted = interrupted_once()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    follower = Follower()
    while follower.verdict is None and not interrupted.is_set():
        rclpy.spin_once(follower, timeout_sec=0.1)
    rclpy.try_shutdown()
    if follower.verdict is None:
        return 130
    statuses = {Verdict.OUTCOME_FAILED: 1, Verdict.OUTCOME_NOT_JUDGED: 3}
    return statuses.get(follower.verdict.outcome, 0)


if __name__ == "__main__":
    sys.exit(main())
