"""One service call of a fresh process, by rclpy: prints {"seconds": S}, from the request to its answer, or null without one.

Usage: one_call.py NAMESPACE WAIT_S

The request is sent WAIT_S seconds after the service was found.
"""

import json
import sys
import time

import rclpy
from formation_msgs.srv import QueryStatus

LIMIT_S = 10.0


def main():
    namespace, wait_s = sys.argv[1], float(sys.argv[2])
    rclpy.init()
    node = rclpy.create_node("one_call")
    client = node.create_client(QueryStatus, f"{namespace}/query_status")
    if not client.wait_for_service(timeout_sec=30.0):
        sys.exit("the service was not found within 30 s")
    time.sleep(wait_s)
    start = time.monotonic()
    answer = client.call_async(QueryStatus.Request(include_waiting=True))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=LIMIT_S)
    seconds = round(time.monotonic() - start, 4) if answer.done() else None
    print(json.dumps({"seconds": seconds}), flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
