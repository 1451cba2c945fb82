#!/usr/bin/env bash
# Builds the page of the studio without a server into a folder that any web server can serve: the page, and its engine as WebAssembly.
# Usage: studio/playground/build.sh OUT
# Takes the target wasm32-unknown-unknown of rustup; where rustup cannot add it, Debian's compiler in the folder that FORMATION_WASM_RUST
# names, into which studio/playground/debian_compiler.sh unpacks it. Ends with 3 where neither is there.
set -euo pipefail
out=$(mkdir -p "$1" && cd "$1" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/playground
target=wasm32-unknown-unknown
export CARGO_PROFILE_RELEASE_STRIP=symbols
build=(cargo build --release --locked --package formation_playground --target "$target")

if [ -n "${FORMATION_WASM_RUST:-}" ]; then
    compiler=$FORMATION_WASM_RUST/usr
    LD_LIBRARY_PATH=$compiler/lib/x86_64-linux-gnu:$compiler/lib PATH=$compiler/bin:$PATH RUSTC=$compiler/bin/rustc RUSTC_BOOTSTRAP=1 \
        "${build[@]}" -Zbuild-std=std,panic_abort
elif rustup target add "$target" >/dev/null 2>&1; then
    "${build[@]}"
else
    echo "error: rustup cannot add the target $target; unpack Debian's compiler with studio/playground/debian_compiler.sh FOLDER, and \
set FORMATION_WASM_RUST=FOLDER" >&2
    exit 3
fi

# Its own lock file may name versions that a mirror of the registry does not have.
version=$(sed -n 's/^wasm-bindgen = .*"=\([0-9.]*\)".*/\1/p' Cargo.toml)
bindgen=$CARGO_TARGET_DIR/bindgen/bin/wasm-bindgen
if [ "$("$bindgen" --version 2>/dev/null)" != "wasm-bindgen $version" ]; then
    env -u CARGO_TARGET_DIR cargo install --quiet wasm-bindgen-cli --version "$version" --root "$CARGO_TARGET_DIR/bindgen"
fi
"$bindgen" --target web --no-typescript --out-dir "$out" --out-name playground "$CARGO_TARGET_DIR/$target/release/formation_playground.wasm"
cp studio/page/* report/player/* "$out"
echo "$out: $(cat "$out"/* | wc -c) bytes, $(cat "$out"/* | gzip -9 | wc -c) compressed"
