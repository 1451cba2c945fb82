#!/usr/bin/env bash
# Two machines, network namespaces here, one of which gains an interface, or loses its link for a moment or for a minute: each must
# form. Then observers of other vendors that are up first: each must discover eight agents that start at once, twenty times. At
# last participants that join right after a change, fifty times: each must get the present target and verdict only.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cargo build --workspace --bins --locked
for tests in "several_machines:: 3" "observers:: 2" "late_joiners:: 2"; do
    read -r name count <<<"$tests"
    cargo test --package formation_tests --test all --locked -- \
        --ignored "$name" --test-threads 1 2>&1 |
        tee >(cat >&2) | grep "$count passed" >/dev/null || {
        # Cargo exits with 0 when the name matches no test, so the count is checked as well.
        echo "error: a test of $name did not run, or failed" >&2
        exit 1
    }
done
