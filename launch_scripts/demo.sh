#!/usr/bin/env bash
# Builds the suite and forms the paper's Figure 1: seventeen modules, each a process of its own, on loopback.
# Further arguments go to `formation run`, for example --json.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

PATH="$PATH:$HOME/.cargo/bin"
if ! command -v cargo >/dev/null; then
    echo "error: cargo is missing; install Rust from https://rustup.rs" >&2
    exit 2
fi
target="${CARGO_TARGET_DIR:-$repository/target}"
cargo build --release --locked --manifest-path "$repository/Cargo.toml" --target-dir "$target" \
    -p launch_scripts -p module_agent -p leader_agent -p target_publisher -p verifier

# Replaced rather than started, so that signals and the exit status are the launcher's own.
exec "$target/release/formation" run "$repository/launch_scripts/scenarios/figure1_ladder17.yaml" "$@"
