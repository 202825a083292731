#!/usr/bin/env bash
# The case study of Minaretzis et al. 2024, Section V, on a virtual IMU, at the paper's size: what
# `nav-sim demo --seed 1 -o out/paper_section5` does, command by command. Run it where trajectories/ and
# calib_data/ are (the repository, or a directory made by `nav-sim init`), with nav-sim on the PATH.
set -euo pipefail

# Eight static recordings of one axis of each sensor, 87 minutes each, every one with parameters of its own (scenario I);
# the same recordings with replaced points, vibrations and a step (II); two of them abnormal as well (III).
nav-sim synthesize calib_data/consumer_mems.toml --samples 524284 --spread --replicates 8 --axes x --seed 1 -o out/paper_section5/I
nav-sim synthesize calib_data/consumer_mems.toml --samples 524284 --spread --replicates 8 --axes x --contaminate section5-II --seed 1 -o out/paper_section5/II
nav-sim synthesize calib_data/consumer_mems.toml --samples 524284 --spread --replicates 8 --axes x --contaminate section5-III --seed 1 -o out/paper_section5/III

# One more clean recording, all six axes: windows of it are the errors of the simulated INS.
nav-sim synthesize calib_data/consumer_mems.toml --samples 524284 --spread --seed 2 -o out/paper_section5/ninth

# Three estimators for each scenario: nine models, each WN + QN + 2 AR1 + RW for both sensors.
nav-sim calibrate out/paper_section5/I --estimator all --seed 1 -o out/paper_section5/models/I.toml
nav-sim calibrate out/paper_section5/II --estimator all --seed 1 -o out/paper_section5/models/II.toml
nav-sim calibrate out/paper_section5/III --estimator all --seed 1 -o out/paper_section5/models/III.toml

# 100 runs with each model in the filter (a state for each AR1 and random walk), on the same errors and GNSS noise; the filters'
# own standard deviations relative to AWV on clean recordings are the paper's Table I.
cat > out/paper_section5/study.toml <<'END'
# nav-sim demo --samples 524284
[run]
trajectory = "../../trajectories/land_vehicle.toml"
static = ["ninth"] # windows of one more clean recording are the errors of the simulated INS
model = "models/{scenario}_{estimator}.toml"
filter = "full" # a state for each AR1 and random walk, as in the paper
runs = 100
seed = 1

[vary]
scenario = ["I", "II", "III"]
estimator = ["awv", "sr-awv", "dr-awv"]

[reference]
scenario = "I"
estimator = "awv"
END
nav-sim batch out/paper_section5/study.toml -o out/paper_section5
