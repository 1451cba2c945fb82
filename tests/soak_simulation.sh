#!/usr/bin/env bash
# Simulates SEEDS runs of 5 to 40 modules with mixed faults, and SEEDS of 2 to 12 each with hostile ones, with churn, with
# pushes, with localisation that jumps, and with machines that are suspended. Then it searches all schedules of three modules
# up to a larger bound than the test command uses, and runs what that command leaves out because it takes minutes: storms of
# restarts, the larger model of majorities, the seeds that show each deliberate bug, motion plans of many sizes, and their stops.
# Usage: tests/soak_simulation.sh [SEEDS], 10000 by default; the exit status is 1 if any run violates a promise.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$repository"
seeds="${1:-10000}"

cargo build --release --quiet -p formation
status=0
nice -n 5 "${CARGO_TARGET_DIR:-target}/release/formation" simulate --seeds "$seeds" --modules 5-40 --faults mixed || status=1
for faults in hostile churn carried lost suspended hosts; do
  nice -n 5 "${CARGO_TARGET_DIR:-target}/release/formation" simulate --seeds "$seeds" --modules 2-12 --faults "$faults" || status=1
done
FORMATION_EXPLORE=large nice -n 5 cargo test --release --quiet -p formation_sim_with_bugs --test all -- exploration:: --nocapture || status=1
nice -n 5 cargo test --release --quiet -p formation_sim --test all -- --ignored agreement_model:: --nocapture || status=1
nice -n 5 cargo test --release --quiet -p formation_sim_with_bugs --test all -- --ignored stores:: mutations:: --nocapture || status=1
nice -n 5 cargo test --release --quiet -p formation_motion --test all -- --ignored motion_ --nocapture || status=1
exit "$status"
