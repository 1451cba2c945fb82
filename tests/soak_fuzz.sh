#!/usr/bin/env bash
# Runs the tests that draw random input for every parser of external data (messages, scenario files, arguments, parameter
# files) with CASES inputs each.
# Usage: tests/soak_fuzz.sh [CASES], one million by default.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export FORMATION_FUZZ_CASES="${1:-1000000}"
cargo test --locked --package formation_msgs --test all -- decoding:: hostile_values::
cargo test --locked --package formation_planner --test all -- scenario_text::
cargo test --locked --package module_agent --test all -- arguments::
