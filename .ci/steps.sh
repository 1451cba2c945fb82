# What the gates share: the times of their steps, and what they install. To be sourced, with the root of the repository as
# working directory.

times=()
current='' began=$SECONDS
# step NAME: ends the step before it, if any.
step() {
    [ -z "$current" ] || times+=("$(printf '%4d s  %s' $((SECONDS - began)) "$current")")
    current=$1 began=$SECONDS
    [ -z "$current" ] || printf '\n== %s\n' "$current"
}

# Ends the last step, and prints the time of each.
report_times() {
    step ''
    printf '\n== times\n'
    printf '%s\n' "${times[@]}"
    printf '%4d s  in all\n' "$SECONDS"
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# need COMMAND PACKAGE: installs the package if the command fails.
need() {
    if ! sh -c "$1" >/dev/null 2>&1; then
        as_root apt-get update -qq
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$2"
    fi
}

# What every gate needs.
need_tools() {
    need "cc --version" build-essential
    need "python3 -c 'import ensurepip, venv'" python3-venv
    need "ip -V" iproute2
    need "unshare --version" util-linux
    if ! command -v cargo >/dev/null; then
        echo "error: cargo is missing; install Rust from https://rustup.rs" >&2
        exit 2
    fi
    cargo fmt --version >/dev/null 2>&1 || rustup component add rustfmt
    cargo clippy --version >/dev/null 2>&1 || rustup component add clippy
    cargo --version
    # Everything is compiled at most once in a gate, so what incremental builds keep would only cost time.
    export CARGO_INCREMENTAL=0
    # A failed assertion names its line without debug information; only backtraces need it.
    export CARGO_PROFILE_DEV_DEBUG=false
}

# require_tools NAMES: no test may be skipped for lack of these, nor for lack of network namespaces where the machine creates them.
require_tools() {
    export FORMATION_REQUIRE_TOOLS=$1
    if unshare --net true 2>/dev/null || unshare --user --map-root-user --net true 2>/dev/null; then
        FORMATION_REQUIRE_TOOLS+=,namespaces
    else
        echo "note: this machine creates no network namespaces, so tests that need them are skipped" >&2
    fi
}

# The dependencies with all features.
check_dependencies() {
    if cargo deny --version >/dev/null 2>&1; then
        cargo deny check
    else
        # Compiling cargo-deny takes longer than all else together.
        python3 .ci/check_dependencies
    fi
}

# The documents as a book. Its links are checked by tests.
build_book() {
    local environment=target/mdbook log
    if ! cmp -s .ci/book_requirements.txt "$environment/requirements.txt"; then
        python3 -m venv --clear "$environment"
        "$environment/bin/pip" install --quiet -r .ci/book_requirements.txt
        cp .ci/book_requirements.txt "$environment/requirements.txt"
    fi
    log=$("$environment/bin/mdbook" build 2>&1) || { printf '%s\n' "$log" >&2; return 1; }
    # A warning is a page that shows otherwise than it is written.
    if grep -E 'WARN|ERROR' <<<"$log" >&2; then return 1; fi
    [ -f target/book/index.html ]
}
