#!/usr/bin/env bash
# Builds the binary that is passed on: static, so that it starts on any Linux of this architecture, and packs it.
#
#   scripts/release.sh [DIRECTORY]        (default: target/packages)
#
# Built for musl where its standard library is installed (rustup target add x86_64-unknown-linux-musl; a package
# like musl-tools for the C parts), else for glibc, statically. The latter is for trying: glibc is under the LGPL.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-target/packages}
arch=$(uname -m)
rustlib=$(rustc --print sysroot)/lib/rustlib
libc=gnu
[ -d "$rustlib/$arch-unknown-linux-musl" ] && libc=musl
target=$arch-unknown-linux-$libc
echo "building for $target"
RUSTFLAGS="${RUSTFLAGS:-} -C target-feature=+crt-static" \
    cargo build --locked --profile dist --features pictures,parquet --bin nav-sim --target "$target"
binary=${CARGO_TARGET_DIR:-target}/$target/dist/nav-sim

# Nothing is looked for when it starts: no interpreter, no library.
if readelf --program-headers "$binary" | grep -q INTERP || readelf --dynamic "$binary" | grep -q NEEDED; then
    echo "error: $binary is dynamic" >&2
    exit 1
fi

# It works where nothing else is: no library, no /proc, no /tmp.
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
cp "$binary" trajectories/figure_eight.toml calib_data/tactical.toml "$root"
enter=(unshare --map-root-user chroot)
[ "$(id -u)" = 0 ] && enter=(chroot)
"${enter[@]}" "$root" /nav-sim --version -v
"${enter[@]}" "$root" /nav-sim run figure_eight.toml tactical.toml --outage 60:90 --runs 8 --seed 1 -o out --quiet | head -1
[ -s "$root/out/report.html" ]

# One directory in one archive, the same bytes for the same commit: no names and times of this machine.
version=$(cargo metadata --locked --no-deps --format-version 1 | python3 -c '
import json, sys
print(next(p["version"] for p in json.load(sys.stdin)["packages"] if p["name"] == "nav-sim"))')
name=nav-sim-$version-$arch-linux-$libc
mkdir -p "$root/pack/$name" "$out"
cp "$binary" README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT "$root/pack/$name"
cargo metadata --locked --format-version 1 --filter-platform "$target" |
    python3 scripts/licences.py >"$root/pack/$name/LICENCES-THIRD-PARTY.txt"
tar --create --directory "$root/pack" --sort=name --owner=0 --group=0 --numeric-owner --mode=u+rw,go=rX \
    --mtime="@$(git log -1 --format=%ct)" "$name" | gzip --no-name --best >"$out/$name.tar.gz"
(cd "$out" && sha256sum "$name.tar.gz" | tee "$name.tar.gz.sha256")
echo "$out/$name.tar.gz: $(stat --format=%s "$out/$name.tar.gz") bytes; nav-sim: $(stat --format=%s "$binary") bytes"
