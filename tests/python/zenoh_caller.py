"""A client of one service over Zenoh that was written by others: eclipse-zenoh, with the certificate of a role.

Usage: zenoh_caller.py FILE ENDPOINT DOMAIN

Opens a session with the configuration in FILE at the router at ENDPOINT, calls `/formation/query_status`, and prints `answered`
or `no answer`.
"""

import json
import pathlib
import struct
import sys
import time

import zenoh

HASHES = pathlib.Path(__file__).resolve().parent.parent.parent / "msgs" / "type_hashes.txt"
TYPE = "formation_msgs/srv/QueryStatus"
WAIT_S = 5.0


def main():
    file, endpoint, domain = sys.argv[1:]
    lines = HASHES.read_text(encoding="utf-8").splitlines()
    type_hash = dict(line.split() for line in lines if not line.startswith("#"))[TYPE]
    config = zenoh.Config.from_file(file)
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    with zenoh.open(config) as session:
        # CDR, little endian; one request, its time, and the identifier of the client.
        request = bytes([0, 1, 0, 0, 1])
        attachment = struct.pack("<qqB16s", 1, time.time_ns(), 16, bytes(range(16)))
        replies = session.get(
            f"{domain}/formation/query_status/formation_msgs::srv::dds_::QueryStatus_/{type_hash}",
            payload=request,
            attachment=attachment,
            timeout=WAIT_S,
        )
        answered = any(reply.ok is not None for reply in replies)
    print("answered" if answered else "no answer")


if __name__ == "__main__":
    main()
