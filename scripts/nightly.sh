#!/usr/bin/env bash
# What a push is too short for: all tests with those that are ignored, kills and full disks again and again,
# the readers at length. Then the ledger, docs/validation.md, has the figures of this night (scripts/ledger.py).
#   scripts/nightly.sh [DIRECTORY]     exit code 1 where anything failed
set -uo pipefail
cd "$(dirname "$0")/.."
night=${1:-out/nightly}
mkdir -p "$night" && rm -f "$night"/*.txt
export CARGO_TERM_COLOR=never RUST_BACKTRACE=0
failed=0

# part NAME COMMAND...: its output in NAME.txt, how it ended on the terminal.
part() {
    local name=$1 start=$SECONDS ended=passed
    shift
    "$@" >"$night/$name.txt" 2>&1 || { ended=FAILED; failed=$((failed + 1)); }
    printf '%-10s %s, %s s\n' "$name" "$ended" $((SECONDS - start)) | tee -a "$night/parts.txt"
}

# A disk of so many kilobytes that is full: no result, no part of one, no wrong exit code. Only root may mount one: nobody else passes.
full_disk() (
    program=$PWD/target/debug/nav-sim
    command=("$program" run trajectories/figure_eight.toml calib_data/tactical.toml --runs 8 --seed 1 -q)
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
    "${command[@]}" -o "$place/enough" || exit 1
    enough=$(du -sk "$place/enough" | cut -f1)
    full=0
    for kilobytes in 4 8 16 32 64 128; do
        [ "$kilobytes" -lt "$enough" ] || continue
        mkdir -p "$place/disk"
        mount -t tmpfs -o size=${kilobytes}k tmpfs "$place/disk" || exit 1
        "${command[@]}" -o "$place/disk/out"
        code=$? left=$(ls -A "$place/disk")
        umount "$place/disk"
        echo "$kilobytes kB: exit code $code, left: $left"
        [ $code -eq 1 ] && [ -z "$left" ] || exit 1
        full=$((full + 1))
    done
    [ $full -gt 0 ] && echo "figure full_disk: $full full disks, nothing left"
)

# Workers that are killed at random points, five times the test of a push.
kills() {
    local total=0 output killed
    for _ in 1 2 3 4 5; do
        output=$(cargo test --locked --test cli killed_workers -- --nocapture 2>&1) || { echo "$output"; return 1; }
        killed=$(sed -n 's/.*\b\([0-9][0-9]*\) workers killed.*/\1/p' <<<"$output")
        total=$((total + killed))
    done
    [ $total -gt 0 ] && echo "figure kills: $total workers killed, the bytes of an undisturbed study"
}

# Each night other changes of the corpus.
fuzz() {
    NAV_SIM_FUZZ=${NAV_SIM_FUZZ:-60000} NAV_SIM_FUZZ_FIRST=$(($(date +%s) / 86400 * 1000000)) \
        cargo test --locked --test fuzz -- --show-output
}

part build cargo test --locked --no-run
part tests cargo test --locked --no-fail-fast -- --include-ignored --show-output --skip the_whole_reference_drive
part kills kills
part disks full_disk
part fuzz fuzz
part section4 cargo run --locked --release --example paper_section4 -- --sensitivity -o "$night/section4"
python3 scripts/ledger.py "$night" docs/validation.md || failed=$((failed + 1))
exit $((failed > 0))
