"""Requests to services, for the examples in this folder."""

import sys
import time

import rclpy

LIMIT_S = 10.0
REPEAT_S = 1.0
# A client of Fast DDS can find a server before the server has matched it. Fast DDS offers a request that was sent in
# between again after its heartbeat period, which is three seconds.
MATCH_S = 0.2


def ask(node, client, request):
    """The answer to a request, which is repeated until one comes."""
    if not client.wait_for_service(timeout_sec=LIMIT_S):
        sys.exit(f"no node serves {client.srv_name}: is it running, and RMW_IMPLEMENTATION the same?")
    time.sleep(MATCH_S)
    answers = []
    for _ in range(int(LIMIT_S / REPEAT_S)):
        answers.append(client.call_async(request))
        rclpy.spin_until_future_complete(node, answers[-1], timeout_sec=REPEAT_S)
        for answer in answers:
            if answer.done():
                return answer.result()
    sys.exit(f"{client.srv_name} did not answer within {LIMIT_S:.0f} s")
