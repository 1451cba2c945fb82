#!/usr/bin/env bash
# Forms every shipped scenario TIMES times with real processes, and compares each result with the offline plan.
# Usage: tests/soak_formations.sh [TIMES], 10 by default. Needs a release build: `cargo build --release --workspace`.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
formation="${CARGO_TARGET_DIR:-$repository/target}/release/formation"
times="${1:-10}"
domain="${ROS_DOMAIN_ID:-77}"

# The plan that the processes agreed on and the offline plan must be equal in each of these keys.
keys='["assignments", "unassigned", "open_spots", "kept_links", "broken_links", "detached_modules", "evictions",
       "total_utility", "total_distance", "assembly_order"]'

different=0
for scenario in "$repository"/launch_scripts/scenarios/*.yaml; do
    name="$(basename "$scenario" .yaml)"
    plan="$("$formation" plan "$scenario" --json 2>/dev/null)"
    for ((turn = 1; turn <= times; turn++)); do
        status=0
        run="$("$formation" run "$scenario" --domain "$domain" --json 2>/dev/null)" || status=$?
        if ! PLAN="$plan" RUN="$run" STATUS="$status" NAME="$name" TURN="$turn" python3 - "$keys" <<'PYTHON'; then
import json, os, sys
name, turn, status = os.environ["NAME"], os.environ["TURN"], os.environ["STATUS"]
if status != "0" or not os.environ["RUN"]:
    sys.exit(f"{name} {turn}: exit status {status}")
plan, run = json.loads(os.environ["PLAN"]), json.loads(os.environ["RUN"])
unequal = [key for key in json.loads(sys.argv[1]) if plan[key] != run[key]]
if unequal:
    sys.exit(f"{name} {turn}: differs from the plan in {', '.join(unequal)}")
print(f"{name} {turn}: as planned, {run['verdict']}, joined {run['discovery_ms']} ms, planned {run['planning_ms']} ms")
PYTHON
            different=$((different + 1))
        fi
    done
done
echo "$different runs differ from the plan"
[ "$different" -eq 0 ]
