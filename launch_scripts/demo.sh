#!/usr/bin/env bash
# Builds the suite and forms the paper's Figure 1: seventeen modules, each a process of its own, on loopback.
# With `--modules N` as the first arguments, N modules form a random target instead; more than 50 go over Zenoh.
# Further arguments go to `formation run`, for example --json.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

modules=17
if [ "${1:-}" = --modules ]; then
    modules="${2:-}"
    case "$modules" in
        "" | *[!0-9]*) printf 'error: --modules needs a number\n' >&2; exit 2 ;;
    esac
    shift 2
    drawn=yes
fi

missing() {
    printf 'error: %s\n' "$@" >&2
    exit 2
}

PATH="$PATH:${CARGO_HOME:-$HOME/.cargo}/bin:/usr/sbin:/sbin"
for tool in cargo rustc; do
    command -v "$tool" >/dev/null || missing "$tool is missing; install Rust from https://rustup.rs"
done

needed="$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$repository/Cargo.toml")"
installed="$(cd "$repository" && rustc --version | cut -d ' ' -f 2)"
if [ "$(printf '%s\n' "$needed" "$installed" | sort -V | head -n 1)" != "$needed" ]; then
    missing "Rust $installed is too old, as $needed is needed; run \`rustup update\`, or install Rust from https://rustup.rs"
fi

# Links a program as cargo will, unless cargo is configured to use another linker.
links() {
    local program status=0
    program="$(mktemp)"
    echo 'fn main() {}' | rustc --crate-name links -o "$program" - >/dev/null 2>&1 || status=$?
    rm -f "$program"
    return "$status"
}
if ! links && ! env | grep -q '^CARGO_TARGET_.*_LINKER=' &&
    ! grep -qs '^ *linker *=' "${CARGO_HOME:-$HOME/.cargo}/config.toml"; then
    missing "a C linker is missing, without which Rust links no program; install one (Debian, Ubuntu: \`apt-get install gcc libc6-dev\`, Fedora: \`dnf install gcc\`)"
fi

# More than twelve processes on loopback need multicast there, or a network namespace in which it can be switched on.
takes_multicast() { (( $(cat /sys/class/net/lo/flags 2>/dev/null || echo 0) & 0x1000 )); }
has_namespaces() {
    command -v ip >/dev/null && {
        unshare --net --mount true || unshare --user --map-root-user --net --mount true
    } 2>/dev/null
}
features=()
case "$([ "$modules" -gt 50 ] && echo many) $* " in
    many* | *" --middleware zenoh "*) features=(--features zenoh) ;;
    *" --modules-per-process"*) ;;
    *)
        takes_multicast || has_namespaces || missing \
            "the loopback interface takes no multicast, and \`unshare\` and \`ip\` can make no network namespace" \
            "run \`sudo ip link set lo up multicast on\`, or fewer processes: \`$0 --modules-per-process 2\`"
        ;;
esac

target="${CARGO_TARGET_DIR:-$repository/target}"
if [ ! -x "$target/release/formation" ]; then
    echo "Building in $target; the first time, this takes about three minutes on two cores." >&2
fi
cargo build --release --locked --manifest-path "$repository/Cargo.toml" --target-dir "$target" \
    --no-default-features "${features[@]}" -p formation -p module_agent -p leader_agent -p target_publisher -p verifier

scenario="$repository/launch_scripts/scenarios/figure1_ladder17.yaml"
if [ -n "${drawn:-}" ]; then
    scenario="$target/modules_$modules.yaml"
    "$target/release/formation" generate --modules "$modules" --spots "$modules" --seed 1 >"$scenario"
fi

# Replaced rather than started, so that signals and the exit status are the launcher's own.
exec "$target/release/formation" run "$scenario" "$@"
