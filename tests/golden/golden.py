#!/usr/bin/env python3
"""Holds the figures of forty commands: hashes of the JSON, CSV and TOML that they print and write.

    golden.py PROGRAM              compares with hashes.json and lists the outputs that differ (exit code 1)
    golden.py PROGRAM --record     writes hashes.json anew: only where a figure changes on purpose
    golden.py PROGRAM --against OLD    also runs OLD and shows the first differences of each output

Commands run on shipped data, with fixed seeds, in a temporary directory. Left out of the hashes: what depends on the
machine or the run (times, threads, commands, versions, hashes), and words (verdicts, notes, comments). Hashes are
stored for each arithmetic (see `arithmetic`); where it is another, the check is skipped.
--only TEXT runs the commands up to the last whose name has TEXT, and compares those that have it.
"""

import argparse
import csv
import hashlib
import io
import json
import math
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
HASHES = HERE / "hashes.json"
UNKNOWN_KEYS = {
    "verdict", "verdicts", "throughput", "throughput_epochs_per_s", "wall_s", "command", "threads", "version", "program",
    "processor_s", "processor_s_left", "run_s", "seconds",
}
HASH = re.compile(r"^[0-9a-f]{16,64}$")
COMMENT = re.compile(r"\s*(#|//|%|<!--)")

SCENARIO = """
run = { runs = 8, seed = 5 }
filter = { states = "21" }
imu = { rate_hz = 100.0, scale_ppm_accel = 300.0, scale_ppm_gyro = 300.0, misalignment_rad = 1e-4 }
gnss = { rate_hz = 1.0, pos_sigma_m = [1, 1, 2], vel_sigma_m_s = "none", lever_arm_m = [1, 0, -1] }
baro = { rate_hz = 1.0, sigma_m = 0.5 }
outage_periodic = { first_s = 30, length_s = 5, every_s = 15 }
"""
EFFICIENCY = """
schema = 1
model = "examples/accelerometer_n1.toml"
axis = "accel.x"
fit = "N1"
replicates = 4
samples = 4096
sets = 3
seed = 1
scenarios = ["section4-I", "section4-II"]
estimators = ["awv", "sr-awv", "dr-awv"]
trim = 1
efficiency = 0.6
"""
LINCOV_STUDY = """
method = "lincov"
trajectory = [{ file = "examples/quick_drive.toml" }]
truth = [{ model = "calib_data/consumer_mems.toml" }]
filters = ["15", "full"]
candidate = [
  { name = "right", model = "calib_data/consumer_mems.toml" },
  { name = "optimist", model = "calib_data/tactical.toml" },
]
outages = [{ sweep = { start_s = 25, duration_s = [10, 20] } }]
"""

EIGHT, DRIVE, QUICK = "trajectories/figure_eight.toml", "trajectories/land_vehicle.toml", "examples/quick_drive.toml"
MEMS, TACTICAL = "calib_data/consumer_mems.toml", "calib_data/tactical.toml"

# Name, arguments. The name is the directory or file that a command writes to, `@` in the arguments.
COMMANDS = [
    ("recordings", f"synthesize {MEMS} --replicates 4 --samples 16384 --spread --seed 1 -o @"),
    ("corrupted", f"synthesize {MEMS} --replicates 3 --samples 8192 --axes x --contaminate section5-II --seed 2 -o @"),
    ("wv.json", "wv recordings --axes accel.x,gyro.z --format json"),
    ("wv_formats.json", "wv calib_data/formats/euroc.csv calib_data/formats/compressed.csv.gz --format json"),
    ("wv.csv", "wv recordings --axes gyro.z --intervals large-sample --format csv"),
    ("dr_awv.toml", "calibrate recordings --seed 1 --bootstrap 50 --format json -o @"),
    ("sr_awv.toml", "calibrate corrupted --estimator sr-awv --model N1 --seed 1 --bootstrap 20 --format json -o @"),
    ("awv.toml", "calibrate recordings --estimator awv --model WN+RW --pool axes --axes accel --seed 1 --bootstrap 20"
     " --format json -o @"),
    ("rgmwm.toml", "calibrate recordings/replicate_1.csv --estimator rgmwm --model N1 --axes gyro.x --seed 1"
     " --bootstrap 20 --weighting edof --format json -o @"),
    ("avlr.toml", "calibrate recordings/replicate_1.csv --estimator avlr --model WN+RW --axes gyro.x --seed 1 --format json"
     " -o @"),
    ("auto.toml", "calibrate corrupted --axes gyro.x --model auto --seed 1 --bootstrap 20 --format json -o @"),
    ("curve.json", "calibrate --curve dr_awv.wv.json --model N1 --seed 1 --format json"),
    ("datasheet.toml", "datasheet --unit stim300 --rate-hz 100 -o @"),
    ("figures.toml", "datasheet --arw '0.15 deg/sqrt(h)' --vrw '0.07 m/s/sqrt(h)' --gyro-bias '0.5 deg/h'"
     " --accel-bias '50 ug' --corr-time 100s --format json -o @"),
    ("eight.csv", f"trajectory generate {EIGHT} --rate-hz 2"),
    ("thinned.csv", f"trajectory convert {DRIVE} --rate-hz 1 -o @"),
    ("closure.json", f"trajectory check {QUICK} --format json"),
    ("recorded", f"trajectory record {QUICK} {TACTICAL} --seed 3 -o @"),
    ("run_15", f"run {QUICK} {MEMS} --outage 30:50 --runs 16 --seed 1 --format json -o @"),
    ("run_full", f"run {QUICK} {MEMS} --outage 30:50 --runs 8 --seed 1 --filter full --truth {TACTICAL} -o @"),
    ("run_21", f"run {QUICK} {TACTICAL} --scenario scenario.toml -o @"),
    ("run_lincov", f"run {QUICK} {MEMS} --outage 30:50 --method lincov --seed 1 --format json -o @"),
    ("run_both", f"run {QUICK} {MEMS} --outage 30:50 --runs 8 --method both --seed 1 --turn-on-bias 0.05,0.001 -o @"),
    ("run_static", f"run {QUICK} dr_awv.toml --static recordings/replicate_2.csv --outage 30:50 --runs 4 --seed 1 -o @"),
    ("run_limits", f"run {EIGHT} {TACTICAL} --outage 60:90 --runs 8 --seed 1 --require p95_m<=5 --format json -o @"),
    ("fused", f"fuse recorded/imu.csv recorded/gnss.csv {TACTICAL} --initial recorded/initial.toml"
     " --reference recorded/reference.csv --outage 30:45 --smooth --format json -o @"),
    ("fused_21", f"fuse recorded/imu.csv recorded/gnss.csv {TACTICAL} --initial recorded/initial.toml --filter 21"
     " --lever-arm 0.1,0,0 -o @"),
    ("comparison.json", "compare run_full run_lincov --reference run_15 --state all --format json -o @"),
    ("comparison.csv", "compare run_full --reference run_15 --table csv -o full.json"),
    ("comparison.tex", "compare run_full --reference run_15 --table latex -o full.json"),
    *[(f"exported.{target}", f"export dr_awv.toml --target {target} -o @") for target in (
        "kalibr openvins vins gtsam px4 ardupilot kf-gins navego psins gnss-ins-sim pyins matlab").split()],
    ("export.json", f"export {MEMS} --target kalibr --policy envelope --horizon 1s:30s --format json"),
    ("plan.json", "batch plan examples/quick_study.toml --dry-run --seed 1 --format json"),
    ("planned", "batch plan examples/quick_study.toml --seed 1 -o study"),
    ("shard", "batch run examples/quick_study.toml --shard 0/2 -o study"),
    ("status.json", "batch status examples/quick_study.toml --format json -o study"),
    ("study", "batch run examples/quick_study.toml -o study"),
    ("study/results", "batch merge examples/quick_study.toml --state all --format json -o study"),
    ("lincov_study/results", "batch plan lincov_study.toml --seed 1 -o lincov_study"
     " && batch run lincov_study.toml -o lincov_study && batch merge lincov_study.toml --format json -o lincov_study"),
    ("efficiency", "efficiency efficiency.toml --format json -o @"),
    ("choice", f"choose recordings --trajectory {QUICK} --outage 30:40 --estimator awv,dr-awv --model N1 --filter 15"
     " --inflate none,x10 --runs 8 --seed 1 --format json -o @"),
    ("design.json", f"design {TACTICAL} --recordings 4 --hours 1 --draws 40 --trajectory {QUICK} --outage 30:50 --seed 1"
     " --format json"),
    ("require.json", f"require {QUICK} {TACTICAL} --outage 30:50 --p95-m 1 --format json"),
    ("needed.toml", f"require {QUICK} --outage 30:50 --rmse-m 20 --format json -o @"),
    ("tuned.toml", f"tune {TACTICAL} --truth {MEMS} --trajectory {QUICK} --outage 30:50 --seed 1 --format json -o @"),
]


def is_words(value):
    """A sentence, a path or a hash rather than a name or a number."""
    return isinstance(value, str) and (" " in value.strip() or "/" in value or HASH.match(value) is not None)


def masked(value):
    """A JSON or TOML value without what depends on the machine, and without words."""
    if isinstance(value, dict):
        kept = {key: masked(inner) for key, inner in value.items() if key.lower() not in UNKNOWN_KEYS}
        return {("hash" if HASH.match(key) else key): inner for key, inner in kept.items()}
    if isinstance(value, list):
        inner = [masked(one) for one in value]
        return ["words"] if inner and all(one == "words" for one in inner) else inner
    return "words" if is_words(value) else value


def leaves(value, place=""):
    """Lines `place = value`, in the order of the file."""
    if isinstance(value, dict):
        return [line for key, inner in value.items() for line in leaves(inner, f"{place}.{key}")]
    if isinstance(value, list):
        return [line for i, inner in enumerate(value) for line in leaves(inner, f"{place}[{i}]")] or [f"{place} = []"]
    return [f"{place} = {value}"]


def csv_lines(text):
    """Rows without the columns that depend on the machine."""
    rows = list(csv.reader(io.StringIO(text)))
    left_out = {i for i, name in enumerate(rows[0]) if name.lower() in UNKNOWN_KEYS} if rows else set()
    return [",".join(cell for i, cell in enumerate(row) if i not in left_out) for row in rows]


def lines_of(name, text):
    """What counts of an output, as lines."""
    if not text:
        return []
    if name.endswith(".json"):
        return leaves(masked(json.loads(text, parse_float=str)))
    if name.endswith(".toml"):
        return leaves(masked(tomllib.loads(text, parse_float=str)))
    if name.endswith(".csv"):
        return csv_lines(text)
    return [line for line in text.splitlines() if not COMMENT.match(line)]


def prepare(place):
    """Makes the directory in which the commands run."""
    for folder in ["calib_data", "trajectories", "examples"]:
        shutil.copytree(ROOT / folder, place / folder)
    (place / "scenario.toml").write_text(SCENARIO)
    (place / "efficiency.toml").write_text(EFFICIENCY)
    (place / "lincov_study.toml").write_text(LINCOV_STUDY)


def written(place, name):
    """Files that a command of this name has written."""
    target = place / name
    if target.is_dir():
        files = [path for path in sorted(target.rglob("*")) if path.suffix in {".json", ".csv", ".toml"}]
        return [path for path in files if "units" not in path.parts]
    stem = name.removesuffix(".toml")
    return [path for path in [target, place / f"{stem}.wv.json", place / f"{stem}.draws.json"] if path.is_file()]


def outputs_of(program, place, name, arguments):
    """All outputs of a command as lines, by name."""
    words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", arguments.replace("@", name))]
    printed, codes = "", []
    while words:
        end = words.index("&&") if "&&" in words else len(words)
        call, words = words[:end], words[end + 1 :]
        done = subprocess.run([program, *call, "-j", "2", "--no-progress", "--quiet"], cwd=place, capture_output=True, text=True)
        printed = done.stdout
        codes.append(f"exit code {done.returncode}")
        if done.returncode not in (0, 3):
            codes += [f"stderr: {line}" for line in done.stderr.splitlines()]
    result = {f"{name}: exit code": codes}
    if "--format json" in arguments:
        result[f"{name}: stdout"] = lines_of("stdout.json", printed)
    elif printed and name.endswith((".csv", ".tex")):
        result[f"{name}: stdout"] = lines_of(name, printed)
    for path in written(place, name):
        result[f"{name}: {path.relative_to(place)}"] = lines_of(path.name, path.read_text())
    return result


def all_outputs(program, only):
    """Outputs of all commands, each with its time."""
    chosen = COMMANDS
    if only:
        last = max(i for i, (name, _) in enumerate(COMMANDS) if only in name)
        chosen = COMMANDS[: last + 1]
    outputs = {}
    with tempfile.TemporaryDirectory() as directory:
        place = Path(directory)
        prepare(place)
        for name, arguments in chosen:
            start = time.monotonic()
            outputs |= {key: lines for key, lines in outputs_of(program, place, name, arguments).items() if only in key}
            print(f"{time.monotonic() - start:6.2f} s  {arguments}", file=sys.stderr)
    return outputs


def digest(lines):
    """Hash of an output."""
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:20]


def arithmetic(program):
    """What the last digits depend on: fused multiply-add in the kernels (AVX2 and AVX-512 give the same), and the
    system's elementary functions, by a hash of their values."""
    said = subprocess.run([program, "--version", "-v"], capture_output=True, text=True).stdout
    kernels = "fused" if "AVX" in said else "portable"
    values = [f(0.001 * i) for i in range(1, 3000) for f in (math.sin, math.exp, math.log, math.tan, math.cosh)]
    return f"{kernels}, libm {digest([repr(value) for value in values])[:8]}"


def show(name, old, new):
    """The first lines in which two versions of an output differ."""
    print(f"{name}: {len(old)} lines before, {len(new)} now")
    differing = [(a, b) for a, b in zip(old, new) if a != b]
    for a, b in differing[:5]:
        print(f"  - {a[:200]}\n  + {b[:200]}")
    if len(old) != len(new):
        only_old, only_new = [a for a in old if a not in set(new)], [b for b in new if b not in set(old)]
        print("\n".join([f"  only before: {a[:200]}" for a in only_old[:5]] + [f"  only now: {b[:200]}" for b in only_new[:5]]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda path: str(Path(path).resolve()))
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--against", type=lambda path: str(Path(path).resolve()))
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    here = arithmetic(arguments.program)
    outputs = all_outputs(arguments.program, arguments.only)
    hashes = {name: digest(lines) for name, lines in outputs.items()}
    stored = json.loads(HASHES.read_text()) if HASHES.exists() else {}
    if arguments.record:
        stored[here] = hashes
        HASHES.write_text(json.dumps(stored, indent=1) + "\n")
        print(f"recorded {len(hashes)} outputs of {len(COMMANDS)} commands for {here}")
        return 0
    if here not in stored:
        print(f"skipped: no hashes for {here}")
        return 0
    expected = {name: value for name, value in stored[here].items() if arguments.only in name}
    differing = [name for name in expected | hashes if expected.get(name) != hashes.get(name)]
    before = all_outputs(arguments.against, arguments.only) if arguments.against and differing else {}
    for name in differing:
        if before:
            show(name, before.get(name, []), outputs.get(name, []))
        else:
            print(f"differs: {name}" + ("" if name in hashes else " (no longer written)"))
    print(f"{len(differing)} of {len(expected)} outputs differ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
