#!/bin/sh
# Makes the pictures of README and book, from the top of the repository; tests/cli/readme.rs holds that they are current.
#
#   scripts/pictures.sh [NAV-SIM [DIRECTORY]]
set -eu
nav_sim=${1:-target/release/nav-sim}
out=${2:-docs/figures}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$out"
"$nav_sim" synthesize calib_data/consumer_mems.toml --replicates 6 --samples 65536 --spread \
    --contaminate examples/one_bad_recording.toml --axes gyro.x --seed 1 -o "$work/static" > "$work/said"
"$nav_sim" calibrate "$work/static" --axes gyro.x --bootstrap 50 --seed 1 \
    -o "$work/model.toml" --force > "$work/said"
cp "$work/model.svg" "$out/calibration.svg"
"$nav_sim" run trajectories/land_vehicle.toml calib_data/consumer_mems.toml --method lincov --seed 1 \
    --outage 300:390 --outage 700:790 -o "$work/run" --plot "$out/run.svg" --force > "$work/said"
