#!/usr/bin/env bash
# Makes what is passed on, tries it where nothing else is, and lists it with its SHA-256:
#
#   scripts/release.sh [DIRECTORY] [PART ...]      (default: target/packages, and all parts)
#
#   linux-x86_64, linux-aarch64   static programs (musl)
#   windows                       program
#   wheels                        manylinux2014 and musllinux 1.2 (x86_64), and the source distribution; those for Windows
#                                 and macOS are built there by the workflow: maturin 1.16 exports a wrong name for a
#                                 module within a package where another linker than Microsoft's is used
#
# Needs Rust with rustup, Python with pip, git, tar, binutils. What else it uses comes from the package indices into
# target/release-tools: zig compiles the C parts for all of them. Under the root that it makes, chroot needs root or
# namespaces of users; a program of another processor starts where qemu or wine are.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(realpath --canonicalize-missing "${1:-target/packages}")
parts=("${@:2}")
[ "${#parts[@]}" = 0 ] && parts=(linux-x86_64 linux-aarch64 windows wheels)
target=$(realpath --canonicalize-missing "${CARGO_TARGET_DIR:-target}")
tools=$target/release-tools
features=pictures,parquet
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mkdir -p "$out"

# What is stamped with a commit is made of it.
git diff --quiet HEAD || { echo "error: there are changes that no commit has" >&2 && exit 2; }
[ -x "$tools/bin/python" ] || python3 -m venv "$tools"
"$tools/bin/python" -m pip install --quiet --disable-pip-version-check \
    maturin==1.16.0 cargo-zigbuild==0.24.1 ziglang==0.17.1 abi3audit==0.0.26
# A program then tells `cargo audit bin` which crates it is made of.
[ -x "$tools/bin/cargo-auditable" ] || cargo install --quiet --locked --root "$tools" cargo-auditable@0.7.7
export PATH=$tools/bin:$PATH

# program TARGET: builds it, and tells where it is.
program() {
    rustup --quiet target add "$1"
    cargo auditable zigbuild --quiet --locked --profile dist --features "$features" --bin nav-sim --target "$1"
}

# extras DIRECTORY: manual pages and shell completions, written by a program for this machine.
extras() {
    local own=$target/debug/nav-sim command
    cargo build --quiet --locked --bin nav-sim
    mkdir -p "$1/man" "$1/completions"
    "$own" man >"$1/man/nav-sim.1"
    for command in $("$own" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p' | grep --invert-match help); do
        "$own" man "$command" >"$1/man/nav-sim-$command.1"
    done
    "$own" completions bash >"$1/completions/nav-sim.bash"
    "$own" completions zsh >"$1/completions/_nav-sim"
    "$own" completions fish >"$1/completions/nav-sim.fish"
    "$own" completions powershell >"$1/completions/nav-sim.ps1"
}

# pack NAME TARGET PROGRAM: one directory in one archive with licences and bill of materials; the same bytes for the same
# commit: no names and times of this machine.
pack() {
    local into=$root/pack/nav-sim-$version-$1 metadata
    mkdir -p "$into"
    metadata=$(cargo metadata --locked --format-version 1 --features "$features" --filter-platform "$2")
    python3 scripts/licences.py <<<"$metadata" >"$into/LICENCES-THIRD-PARTY.txt"
    python3 scripts/sbom.py <<<"$metadata" >"$into/nav-sim.cdx.json"
    cp "$3" README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT "$into"
    extras "$into"
    tar --create --directory "$root/pack" --sort=name --owner=0 --group=0 --numeric-owner --mode=u+rw,go=rX \
        --mtime="@$(git log -1 --format=%ct)" "${into##*/}" | gzip --no-name --best >"$out/${into##*/}.tar.gz"
    cp "$into/nav-sim.cdx.json" "$out/${into##*/}.cdx.json"
    echo "$out/${into##*/}.tar.gz: $(stat --format=%s "$out/${into##*/}.tar.gz") bytes; $3: $(stat --format=%s "$3") bytes"
}

# Nothing is looked for when it starts: no interpreter, no library.
is_static() {
    ! readelf --program-headers "$1" | grep -q INTERP && ! readelf --dynamic "$1" | grep -q NEEDED && return
    echo "error: $1 is dynamic" >&2
    exit 1
}

# It works where nothing else is: no library, no /proc, no /tmp.
in_empty_root() {
    local enter=(unshare --map-root-user chroot)
    [ "$(id -u)" = 0 ] && enter=(chroot)
    mkdir "$root/empty"
    cp --recursive "$1" trajectories calib_data "$root/empty"
    "${enter[@]}" "$root/empty" /nav-sim --version -v
    "${enter[@]}" "$root/empty" /nav-sim demo --samples 90000 --runs 1 --seed 1 -o demo --quiet
    "${enter[@]}" "$root/empty" /nav-sim run trajectories/figure_eight.toml calib_data/tactical.toml --method lincov -o out --quiet
    [ -s "$root/empty/out/report.html" ]
}

# starts NAME COMMAND...: a program of another system, where this one can run it.
starts() {
    if command -v "$1" >/dev/null; then
        "$@" --version && "$@" run trajectories/figure_eight.toml calib_data/tactical.toml --method lincov --quiet -o "$root/$1"
    else
        echo "not started: there is no $1"
    fi
}

linux() {
    local triple=$1-unknown-linux-musl
    local binary=$target/$triple/dist/nav-sim
    program "$triple"
    is_static "$binary"
    if [ "$1" = "$(uname -m)" ]; then in_empty_root "$binary"; else starts "qemu-$1-static" "$binary"; fi
    pack "$1-linux-musl" "$triple" "$binary"
}

windows() {
    program x86_64-pc-windows-gnu
    local binary=$target/x86_64-pc-windows-gnu/dist/nav-sim.exe
    starts wine "$binary"
    pack x86_64-windows x86_64-pc-windows-gnu "$binary"
}

wheels() {
    local build=(maturin build --quiet --locked --out "$out")
    rustup --quiet target add x86_64-unknown-linux-gnu x86_64-unknown-linux-musl
    "${build[@]}" --zig --compatibility manylinux2014 --target x86_64-unknown-linux-gnu
    RUSTFLAGS="-C target-feature=-crt-static" \
        "${build[@]}" --zig --compatibility musllinux_1_2 --target x86_64-unknown-linux-musl
    maturin sdist --out "$out"
    tar tzf "$out"/nav_sim-*.tar.gz | grep -E '/LICENSE-(APACHE|MIT)$' >/dev/null
    # One wheel is for every Python from 3.10 on: nothing but the stable interface is in it.
    abi3audit --strict --summary "$out"/*.whl
    # Its command starts in a bare environment.
    python3 -m venv "$root/bare"
    "$root/bare/bin/python" -m pip install --quiet --disable-pip-version-check "$out"/*manylinux*.whl
    "$root/bare/bin/nav-sim" --version
}

for part in "${parts[@]}"; do
    echo "== $part"
    case $part in
        linux-*) linux "${part#linux-}" ;;
        windows | wheels) "$part" ;;
        *) echo "error: no part $part" >&2 && exit 2 ;;
    esac
done
(cd "$out" && rm -f SHA256SUMS && sha256sum -- * | tee SHA256SUMS)
