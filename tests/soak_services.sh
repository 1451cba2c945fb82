#!/usr/bin/env bash
# Calls a service from fresh processes, CALLS of each kind: rclpy over Fast DDS that waits 0.2 s after it has found the
# service, the same that does not wait, and CycloneDDS. Each call must be answered. Prints the times.
# Usage: tests/soak_services.sh [CALLS], 100 by default.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export FORMATION_CALLS="${1:-100}"
cargo build --workspace --bins --locked
cargo test --package formation_tests --test all --locked -- \
    --ignored fresh_clients:: --nocapture 2>&1 |
    tee >(cat >&2) | grep "2 passed" >/dev/null || {
    # Cargo exits with 0 when the name matches no test, so the count is checked as well.
    echo "error: no test ran, or a call was not answered" >&2
    exit 1
}
