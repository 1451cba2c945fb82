#!/usr/bin/env bash
# Two machines, network namespaces here, one of which gains an interface, or loses its link for a moment or for a minute. Each must form.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cargo build --workspace --bins --locked
cargo test --package formation_tests --test all --locked -- \
    --ignored several_machines:: --test-threads 1 2>&1 |
    tee >(cat >&2) | grep "3 passed" >/dev/null || {
    # Cargo exits with 0 when the name matches no test, so the count is checked as well.
    echo "error: no test ran, or a machine was lost" >&2
    exit 1
}
