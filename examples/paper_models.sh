#!/usr/bin/env bash
# Recordings and models of the case study of Minaretzis et al. 2024, Section V, at the paper's size, in out/paper: what
# examples/paper_table1.toml and examples/outage_length.toml need.
set -euo pipefail
imu=calib_data/consumer_mems.toml
make() { nav-sim synthesize $imu --samples 524284 --spread "$@"; }
make --replicates 8 --axes x --seed 1 -o out/paper/I
make --replicates 8 --axes x --contaminate section5-II --seed 1 -o out/paper/II
make --replicates 8 --axes x --contaminate section5-III --seed 1 -o out/paper/III
make --seed 2 -o out/paper/ninth
for scenario in I II III; do
    nav-sim calibrate out/paper/$scenario --estimator all --seed 1 -o out/paper/models/$scenario.toml
done
