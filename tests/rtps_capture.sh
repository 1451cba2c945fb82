#!/usr/bin/env bash
# Forms Figure 1 with a process a module while tshark captures every packet, then sends one packet that is malformed on
# purpose, so that whoever looks for malformed ones can see that they are found. Needs a network namespace of its own:
#
#     unshare -rn tests/rtps_capture.sh LAUNCHER SCENARIO CAPTURE_FILE DOMAIN
set -euo pipefail
launcher=$1 scenario=$2 file=$3 domain=$4

PATH="$PATH:/usr/sbin:/sbin"
ip link set lo up multicast on

log="$file.log"
tshark -q -i lo -f udp -w "$file" 2>"$log" &
capture=$!
trap 'kill -INT "$capture" 2>/dev/null || true' EXIT
for _ in $(seq 300); do
    grep -q "Capture started\|Capturing on" "$log" && break
    kill -0 "$capture" 2>/dev/null || { cat "$log" >&2; exit 3; }
    sleep 0.1
done
# The first packets after the announcement may still be missed.
sleep 0.5

"$launcher" run "$scenario" --domain "$domain" --speed 20 --timeout 90

# An RTPS header and a DATA submessage that ends long before it says, to the port of the first participant.
port=$((7400 + 250 * domain + 10))
printf 'RTPS\x02\x04\x01\x12malformed!!!\x15\x05\x40\x00\x00\x00\x10\x00' >"/dev/udp/127.0.0.1/$port" || true
sleep 0.5
kill -INT "$capture"
wait "$capture" || true
trap - EXIT
