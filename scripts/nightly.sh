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

# A disk that is full after so many blocks of 512 bytes (a limit on the size of files): no result, no part of one, no wrong exit code.
full_disk() (
    program=$PWD/target/debug/nav-sim
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
    command=("$program" run trajectories/figure_eight.toml calib_data/tactical.toml --runs 8 --seed 1 -q -o "$place/out")
    for blocks in 1 2 4 8 16 32 64; do
        (trap '' XFSZ; ulimit -f $blocks; "${command[@]}")
        code=$?
        echo "$blocks blocks: exit code $code"
        [ $code -eq 1 ] || { echo "not 1"; exit 1; }
        [ -z "$(ls -A "$place")" ] || { ls -lA "$place"; exit 1; }
    done
    "${command[@]}" && echo "figure full_disk: 7 full disks, nothing left"
)

# Workers that are killed at random points, five times the test of a push.
kills() {
    for _ in 1 2 3 4 5; do
        cargo test --locked --test cli batch::killed || return 1
        cargo test --locked --test cli killed || return 1
    done
    echo "figure kills: 100 workers killed, the bytes of an undisturbed study"
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
