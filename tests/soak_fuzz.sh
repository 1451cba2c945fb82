#!/usr/bin/env bash
# Tries CASES of everything that reads bytes from outside: messages, scenario files, arguments and parameter files.
# Usage: tests/soak_fuzz.sh [CASES], a million for each test by default.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export FORMATION_FUZZ_CASES="${1:-1000000}"
cargo test --locked --package formation_msgs --test decoding --test hostile_values
cargo test --locked --package formation --test scenario_text
cargo test --locked --package formation_node --test arguments
