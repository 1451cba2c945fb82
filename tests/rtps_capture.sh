#!/usr/bin/env bash
# Forms Figure 1 with a process a module while tshark captures every packet, then sends two more: a good one to a port
# of another protocol, and one that is malformed on purpose, which shows that the dissector finds malformed ones. To be
# run in a network namespace of its own:
#
#     tests/rtps_capture.sh LAUNCHER SCENARIO CAPTURE_FILE DOMAIN
set -euo pipefail
launcher=$1 scenario=$2 file=$3 domain=$4

# await TEXT: until the captured packets contain it.
await() {
    for _ in $(seq 300); do
        if grep -qaF "$1" "$file" 2>/dev/null; then return; fi
        kill -0 "$capture" 2>/dev/null || break
        ${2:-true}
        sleep 0.1
    done
    cat "$file.log" >&2
    exit 3
}

# To the discard port, so that it belongs to no DDS domain.
probe() { printf 'is the capture running?' >/dev/udp/127.0.0.1/9 || true; }

# Up to 128 MiB of packets wait for a busy processor; by default 2 MiB do, and the rest is lost.
tshark -q -i lo -f udp -B 128 -w "$file" 2>"$file.log" &
capture=$!
trap 'kill -INT "$capture" 2>/dev/null || true' EXIT
# tshark announces the capture before it takes the first packet.
await 'is the capture running?' probe

"$launcher" run "$scenario" --domain "$domain" --speed 20 --timeout 90

# An RTPS header and a HEARTBEAT to the port of EtherNet/IP, which Linux may hand out to any process.
printf %b 'RTPS\x02\x04\x01\x12other port!!\x07\x01\x1c\x00\x00\x00\x00\x00\x00\x00\x00\xc2\x00\x00\x00\x00\x01\x00' \
    '\x00\x00\x00\x00\x00\x00\x01\x00\x00\x00\x01\x00\x00\x00' >/dev/udp/127.0.0.1/44818 || true
# An RTPS header and a DATA submessage that is shorter than its length field, to the port of the first participant.
port=$((7400 + 250 * domain + 10))
printf 'RTPS\x02\x04\x01\x12malformed!!!\x15\x05\x40\x00\x00\x00\x10\x00' >"/dev/udp/127.0.0.1/$port" || true
await 'malformed!!!'
kill -INT "$capture"
wait "$capture" || true
trap - EXIT
if grep -E '[1-9][0-9]* packets? dropped' "$file.log" >&2; then exit 3; fi
