#!/usr/bin/env bash
# Kills agents at random moments, over repeated formations with spares, until KILLS of them have died; each formation must
# end without a hole. Tells how long each took to recover, the median and the worst.
# Usage: tests/soak_kills.sh [KILLS [FIRST_SEED]], 50 and 1 by default. Each formation takes five kills and one seed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export FORMATION_KILLS="${1:-50}" FORMATION_SEED="${2:-1}"
cargo build --workspace --bins --locked
cargo test --package formation_tests --test faults --locked -- \
    --ignored --exact kills::many_kills_at_random_moments_leave_no_hole --nocapture 2>&1 |
    tee >(cat >&2) | grep "1 passed" >/dev/null || {
    # A name that no test has would otherwise pass in silence.
    echo "error: no kills, or not all of them were mended" >&2
    exit 1
}
