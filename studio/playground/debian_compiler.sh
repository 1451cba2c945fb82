#!/usr/bin/env bash
# Unpacks Debian's Rust compiler with what it needs to build for WebAssembly into a folder; nothing is installed.
# Usage: studio/playground/debian_compiler.sh FOLDER
set -euo pipefail
mkdir -p "$1"
cd "$1"
version=$(apt-cache show rustc-web | sed -n 's/^Version: \([0-9]*\.[0-9]*\)\..*/\1/p' | head -n 1)
lld=$(apt-cache search --names-only '^lld-[0-9]*$' | sed 's/ .*//' | sort -V | tail -n 1)
packages=(rustc-web cargo-web rust-web-src "libstd-rust-web-$version" libstd-rust-web-dev "$lld" "libllvm${lld#lld-}"
    libgit2-1.5 libssh2-1 libhttp-parser2.9 libmbedtls14 libmbedx509-1 libmbedcrypto7)
apt-get download "${packages[@]}"
for package in *.deb; do
    dpkg -x "$package" .
done
rm -- *.deb
ln -sf "wasm-ld-${lld#lld-}" usr/bin/wasm-ld
