#!/usr/bin/env bash
# Simulates SEEDS runs of 5 to 40 modules with mixed faults, then searches all schedules of three modules up to a larger
# bound than the test command uses.
# Usage: tests/soak_simulation.sh [SEEDS], 10000 by default; the exit status is 1 if any run violates a promise.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$repository"
seeds="${1:-10000}"

cargo build --release --quiet -p launch_scripts
status=0
nice -n 5 "${CARGO_TARGET_DIR:-target}/release/formation" simulate --seeds "$seeds" --modules 5-40 --faults mixed || status=1
FORMATION_EXPLORE=large nice -n 5 cargo test --release --quiet -p formation_sim --test all -- exploration:: --nocapture || status=1
exit "$status"
