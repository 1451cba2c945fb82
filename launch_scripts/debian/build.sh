#!/usr/bin/env bash
# Builds a Debian package with all programs, scenarios, shell completions and systemd units, and prints its path.
#   launch_scripts/debian/build.sh [FOLDER]     # writes into FOLDER, otherwise into target/debian
# FORMATION_PROGRAMS names a folder with programs that are built already; otherwise cargo builds them for release.
set -euo pipefail
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
here="$repository/launch_scripts/debian"
target="${CARGO_TARGET_DIR:-$repository/target}"
out="${1:-$target/debian}"
programs="${FORMATION_PROGRAMS:-$target/release}"
if [ -z "${FORMATION_PROGRAMS:-}" ]; then
    cargo build --release --locked --manifest-path "$repository/Cargo.toml" --target-dir "$target" \
        -p formation --features programs
fi

version="$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' "$repository/Cargo.toml")"
architecture="$(dpkg --print-architecture)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
root="$work/root"

# The launcher finds the other programs next to itself; their names are too common for /usr/bin.
for program in formation leader_agent module_agent recorder target_publisher verifier visualiser world; do
    install -D -m 755 "$programs/$program" "$root/usr/lib/formation/$program"
    strip --strip-unneeded "$root/usr/lib/formation/$program"
done
mkdir -p "$root/usr/bin"
ln -s ../lib/formation/formation "$root/usr/bin/formation"
complete() { "$root/usr/lib/formation/formation" completions "$1" | install -D -m 644 /dev/stdin "$root/usr/share/$2"; }
complete bash bash-completion/completions/formation
complete zsh zsh/vendor-completions/_formation
complete fish fish/vendor_completions.d/formation.fish
"$root/usr/lib/formation/formation" manual "$root/usr/share/man/man1" >&2
gzip -9n "$root"/usr/share/man/man1/*.1
for unit in "$here"/*.service; do
    install -D -m 644 "$unit" "$root/usr/lib/systemd/system/${unit##*/}"
done
install -D -m 644 "$here/formation.default" "$root/etc/default/formation"
install -D -m 644 -t "$root/usr/share/formation/scenarios" "$repository"/launch_scripts/scenarios/*.yaml
install -D -m 644 -t "$root/usr/share/formation" "$repository/launch_scripts/config/formation.yaml" \
    "$repository/launch_scripts/rviz/formation.rviz"
install -D -m 644 "$repository/LICENSE" "$root/usr/share/doc/formation/copyright"
install -D -m 644 -t "$root/usr/share/doc/formation" "$repository/README.md" "$repository/CHANGELOG.md"

# dpkg-shlibdeps reads the name of the package from debian/control.
mkdir -p "$work/debian" "$root/DEBIAN"
printf 'Source: formation\n\nPackage: formation\nArchitecture: any\n' >"$work/debian/control"
depends="$(cd "$work" && dpkg-shlibdeps -O "$root"/usr/lib/formation/* | sed -n 's/^shlibs:Depends=//p')"
cat >"$root/DEBIAN/control" <<CONTROL
Package: formation
Version: $version
Architecture: $architecture
Maintainer: The formation maintainers <maintainers@formation.invalid>
Installed-Size: $(du -sk "$root/usr" | cut -f 1)
Depends: $depends
Recommends: iproute2
Section: science
Priority: optional
Description: modular robots that form a target shape, as ROS 2 nodes
 Modular robots that decide for themselves, over DDS, which module takes which spot of a target configuration.
 This package has the nodes and the launcher; they need no ROS installation.
CONTROL
printf '/etc/default/formation\n' >"$root/DEBIAN/conffiles"
chmod -R u=rwX,go=rX "$root"

mkdir -p "$out"
package="$out/formation_${version}_$architecture.deb"
dpkg-deb --root-owner-group "-Z${FORMATION_DEB_COMPRESSION:-xz}" --build "$root" "$package" >&2
printf '%s\n' "$package"
