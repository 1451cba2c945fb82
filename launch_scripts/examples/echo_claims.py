#!/usr/bin/env python3
"""Prints which module claims which spot, and which module loses one, turn by turn.

    python3 echo_claims.py
"""

import sys

import rclpy
from formation_msgs.msg import EvictionRecord, SpotClaim
from interrupts import interrupted_once
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

# Claims that were made before the start of this program arrive as well.
TRANSIENT_LOCAL = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def described(claim):
    """One line for a claim."""
    pairs = ", ".join(f"module {pair.module_id} -> spot {pair.spot_id}" for pair in claim.selections)
    line = f"epoch {claim.epoch.number} turn {claim.turn}: module {claim.claimant_id} claims {pairs or 'nothing'}"
    for eviction in claim.evictions:
        dropped = eviction.to_spot_id == EvictionRecord.NONE
        where = "no spot" if dropped else f"spot {eviction.to_spot_id}"
        line += f"; module {eviction.evicted_module_id} leaves spot {eviction.from_spot_id} for {where}"
    if claim.detached:
        line += f"; detached: {', '.join(str(module) for module in claim.detached)}"
    if claim.swaps:
        swaps = ", ".join(f"module {pair.module_id} -> spot {pair.spot_id}" for pair in claim.swaps)
        line += f"; swapped after it: {swaps}"
    return line


class ClaimEcho(Node):
    """Prints claims."""

    def __init__(self):
        super().__init__("echo_claims", namespace="/formation")
        self.create_subscription(SpotClaim, "claims", self.handle_claim, TRANSIENT_LOCAL)

    def handle_claim(self, claim):
        print(described(claim), flush=True)


def main():
    interrupted = interrupted_once()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = ClaimEcho()
    while not interrupted.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
