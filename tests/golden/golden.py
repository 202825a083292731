#!/usr/bin/env python3
"""Compares the figures of some sixty commands with those stored in numbers.json.xz (commit 724ae3c).

    golden.py PROGRAM [--only TEXT]    lists what differs (exit code 1); --only: commands whose name has TEXT, and what they need
    golden.py PROGRAM --show TEXT      prints the figures of this program whose path has TEXT
    golden.py PROGRAM --record         stores the figures anew: only where one changes on purpose

Commands run on shipped data with fixed seeds in a temporary directory. A figure has a path, `run_15/summary.json/nees/mean`; a
cell of a CSV is `FILE/COLUMN/ROW`; long tables keep every n-th row and the sums of absolute values. map.toml says where a figure
moved or why it went. Tolerance: 1e-12 relative; where the arithmetic differs from the recorded one 1e-9, and `after_minimiser` (refused with
NAV_SIM_CI). Not compared: new figures, times, threads, versions, hashes, sentences, manifests.
"""

import argparse
import csv
import hashlib
import io
import json
import lzma
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
NUMBERS = HERE / "numbers.json.xz"
MAP = tomllib.loads((HERE / "map.toml").read_text())
MACHINE_KEYS = {
    "verdict", "verdicts", "throughput", "throughput_epochs_per_s", "wall_s", "command", "threads", "version", "program",
    "processor_s", "processor_s_left", "run_s", "seconds",
}
HASH = re.compile(r"^[0-9a-f]{16,64}$")
COMMENT = re.compile(r"\s*(#|//|%|<!--)")
LAST_COMMENT = re.compile(r"\s+(#|//|%|<!--).*$")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
ROWS_KEPT = 300
# Commands after a minimiser: another machine may end the search elsewhere on the same floor of the objective.
FITTED = re.compile(r"(dr_awv|sr_awv|awv|rgmwm|avlr|auto|curve|run_static|exported|choice|needed|require|tuned)\b")

SCENARIO = """
run = { runs = 8, seed = 5 }
filter = { states = "21" }
imu = { rate_hz = 100.0, scale_ppm_accel = 300.0, scale_ppm_gyro = 300.0, misalignment_rad = 1e-4 }
gnss = { rate_hz = 1.0, pos_sigma_m = [1, 1, 2], vel_sigma_m_s = "none", lever_arm_m = [1, 0, -1] }
baro = { rate_hz = 1.0, sigma_m = 0.5 }
outage_periodic = { first_s = 30, duration_s = 5, every_s = 15 }
"""
LINCOV_STUDY = """
[run]
method = "lincov"
trajectory = "examples/quick_drive.toml"
truth = "calib_data/consumer_mems.toml"
outage = ["25:+{duration_s}"]
filter = ["15", "full"]
[vary]
duration_s = [10, 20]
[vary.model]
right = { model = "calib_data/consumer_mems.toml" }
optimist = { model = "calib_data/tactical.toml" }
"""

EIGHT, DRIVE, QUICK = "trajectories/figure_eight.toml", "trajectories/land_vehicle.toml", "examples/quick_drive.toml"
MEMS, TACTICAL = "calib_data/consumer_mems.toml", "calib_data/tactical.toml"

# Name, arguments. The name is the directory or file that a command writes to, `@` in the arguments.
COMMANDS = [
    ("recordings", f"synthesize {MEMS} --replicates 4 --samples 16384 --spread --seed 1 -o @"),
    ("corrupted", f"synthesize {MEMS} --replicates 3 --samples 8192 --axes x --contaminate section5-II --seed 2 -o @"),
    ("wv.json", "wv recordings --axes accel.x,gyro.z --format json"),
    ("wv_formats.json", "wv calib_data/formats/euroc.csv calib_data/formats/compressed.csv.gz --format json"),
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
        "kalibr openvins vins gtsam px4 ardupilot kf-gins navego psins gnss-ins-sim pyins matlab "
        "lio-sam fast-lio gazebo ros-imu-covariance").split()],
    ("export.json", f"export {MEMS} --target kalibr --policy envelope --horizon 1s:30s --format json"),
    ("study", "batch examples/quick_study.toml --set seed=1 --format json -o @"),
    ("lincov_study", "batch lincov_study.toml --set seed=1 -o @"),
    ("choice", f"choose recordings --trajectory {QUICK} --outage 30:40 --estimator awv,dr-awv --model N1 --filter 15"
     " --inflate none,x10 --runs 8 --seed 1 --format json -o @"),
    ("design.json", f"design {TACTICAL} --recordings 4 --hours 1 --draws 40 --trajectory {QUICK} --outage 30:50 --seed 1"
     " --format json"),
    ("require.json", f"require {QUICK} {TACTICAL} --outage 30:50 --require p95_m<=1 --format json"),
    ("needed.toml", f"require {QUICK} --outage 30:50 --require rmse_m<=20 --format json -o @"),
    ("tuned.toml", f"tune {TACTICAL} --truth {MEMS} --trajectory {QUICK} --outage 30:50 --seed 1 --format json -o @"),
]


def is_words(value):
    """A sentence, a path or a hash rather than a name or a number."""
    return isinstance(value, str) and (" " in value.strip() or "/" in value or HASH.match(value) is not None)


def leaves(value, path):
    """Figures and names of a JSON or TOML value, by path."""
    if isinstance(value, (dict, list)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        kept = [("hash" if HASH.match(str(key)) else str(key).replace("/", "~"), inner) for key, inner in items]
        return {p: v for key, inner in kept if key.lower() not in MACHINE_KEYS for p, v in leaves(inner, f"{path}/{key}").items()}
    return {} if value is None or is_words(value) else {path: value}


def cell(text):
    """A cell of a CSV as a number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def csv_leaves(text, path):
    """Cells by column and row; of a long table every n-th row, and the sums of columns."""
    rows = list(csv.reader(io.StringIO(text)))
    step = 1 + len(rows) // ROWS_KEPT
    found = {}
    for name, *cells in zip(*rows):
        values = [cell(one) for one in cells]
        if name.lower() in MACHINE_KEYS:
            continue
        found |= {f"{path}/{name}/{i}": v for i, v in enumerate(values) if i % step == 0 and v != "" and not is_words(v)}
        if step > 1:
            found[f"{path}/{name}/sum"] = math.fsum(abs(v) for v in values if isinstance(v, float) and math.isfinite(v))
    return found | {f"{path}/rows": len(rows)}


def figures_of(name, text, path):
    """Figures of one output."""
    if name.endswith(".json"):
        return leaves(json.loads(text), path)
    if name.endswith(".toml"):
        return leaves(tomllib.loads(text), path)
    if name.endswith(".csv"):
        return csv_leaves(text, path)
    return {f"{path}/line {i}": line for i, line in enumerate(l for l in text.splitlines() if not COMMENT.match(l))}


def prepare(place):
    """Makes the directory in which the commands run."""
    for folder in ["calib_data", "trajectories", "examples"]:
        shutil.copytree(ROOT / folder, place / folder)
    (place / "scenario.toml").write_text(SCENARIO)
    (place / "lincov_study.toml").write_text(LINCOV_STUDY)


def written(place, name):
    """Files that a command of this name has written."""
    target = place / name
    if target.is_dir():
        files = [path for path in sorted(target.rglob("*")) if path.suffix in {".json", ".csv", ".toml"}]
        return [path for path in files if "units" not in path.parts and path.name != "manifest.json"]
    stem = name.removesuffix(".toml")
    return [path for path in [target, place / f"{stem}.wv.json", place / f"{stem}.draws.json"] if path.is_file()]


def figures(program, place, name, arguments):
    """Figures of all outputs of a command, by path."""
    words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", arguments.replace("@", name))]
    done = subprocess.run([program, *words, "-j", "2", "--no-progress", "--quiet"], cwd=place, capture_output=True, text=True)
    printed, found = done.stdout, {f"{name}/exit code of {words[0]}": done.returncode}
    if done.returncode not in (0, 3):
        print(f"{name}: exit code {done.returncode}\n  {' '.join(words)}\n  {done.stderr.strip()[:2000]}")
    if "--format json" in arguments and printed:
        found |= figures_of("stdout.json", printed, f"{name}/stdout")
    elif printed and name.endswith((".csv", ".tex")):
        found |= figures_of(name, printed, f"{name}/stdout")
    for path in written(place, name):
        found |= figures_of(path.name, path.read_text(), str(path.relative_to(place)))
    return found


def chosen(only):
    """Commands by name: those asked for, and those whose files they read."""
    now = dict(COMMANDS)
    wanted = {name for name in now if only in name}
    for name in reversed(now):
        readers = " ".join(arguments for other, arguments in now.items() if other in wanted)
        if re.search(rf"(^|\s){re.escape(name.removesuffix('.toml'))}([/\s.]|$)", readers):
            wanted.add(name)
    return {name: arguments for name, arguments in now.items() if name in wanted}


def all_figures(program, only):
    """Figures by command."""
    with tempfile.TemporaryDirectory() as directory:
        place = Path(directory)
        prepare(place)
        found = {name: figures(program, place, name, arguments) for name, arguments in chosen(only).items()}
    return {name: values for name, values in found.items() if only in name}


def arithmetic(program):
    """What the last digits depend on: fused multiply-add in the kernels (AVX2 and AVX-512 give the same), and the
    system's elementary functions, by a hash of their values."""
    said = subprocess.run([program, "--version", "-v"], capture_output=True, text=True).stdout
    kernels = "fused" if "AVX" in said else "portable"
    values = [f(0.001 * i) for i in range(1, 3000) for f in (math.sin, math.exp, math.log, math.tan, math.cosh)]
    return f"{kernels}, libm {hashlib.sha256(chr(10).join(map(repr, values)).encode()).hexdigest()[:8]}"


def pattern(text):
    """A path of map.toml: `*` is any text within a key, `**` any text."""
    parts = [{"**": "(.*)", "*": "([^/]*)"}.get(part, re.escape(part)) for part in re.split(r"(\*\*?)", text)]
    return re.compile("".join(parts))


RENAMED = [(pattern(old), new) for old, new in MAP["keys"].items()]
DROPPED = [pattern(old) for old in MAP["dropped"]]
CHANGED = [(pattern(path), tolerance) for path, tolerance in MAP["changed_minimiser"].items()]


def path_now(path):
    """Where a stored figure is to be found, or None where a deletion dropped it."""
    for table, names in MAP["rows"].items():
        if path.startswith(table + "/") and path.rsplit("/", 1)[-1].isdigit():
            column, row = path.rsplit("/", 1)
            path = f"{column}/{names[int(row)]}"
    if any(old.fullmatch(path) for old in DROPPED):
        return None
    for old, new in RENAMED:
        if match := old.fullmatch(path):
            texts = iter(match.groups())
            return re.sub(r"\*(\d)|\*\*?", lambda star: match[int(star[1])] if star[1] else next(texts), new)
    return path


def scales(values):
    """Largest absolute value of each column and list: its entries have one unit."""
    largest = {}
    for path, value in values.items():
        parent, key = path.rsplit("/", 1)
        if key.isdigit() and isinstance(value, (int, float)):
            largest[parent] = max(largest.get(parent, 0.0), abs(value))
    return largest


def after_minimiser(path, old, new, stored, tolerance):
    """An objective is no higher, a parameter is within 2 % of half its interval, all else within the tolerance."""
    if path.endswith("/objective"):
        return new <= old + tolerance * abs(old)
    low, high = (stored.get(f"{path}_ci95/{i}") for i in (0, 1))
    if low is not None and high is not None and abs(new - old) <= 0.02 * (high - low) / 2:
        return True
    return abs(new - old) <= tolerance * abs(old)


def is_equal(old, new, close):
    """Equality of names, and of numbers, also of those in a line of text, within a tolerance."""
    if old == new:
        return True
    numbers = [isinstance(v, (int, float)) and not isinstance(v, bool) for v in (old, new)]
    if all(numbers):
        return (math.isnan(old) and math.isnan(new)) or close(old, new)
    if any(numbers) or not (isinstance(old, str) and isinstance(new, str)):
        return False
    old, new = (LAST_COMMENT.sub("", text) for text in (old, new))
    pairs = list(zip(NUMBER.findall(old), NUMBER.findall(new)))
    return NUMBER.split(old) == NUMBER.split(new) and all(close(float(a), float(b)) for a, b in pairs)


def differences(name, stored, now, tolerance):
    """Lines `path: old -> new` of a command."""
    largest, lines = scales(stored), []
    for path, old in stored.items():
        place = path_now(path)
        if place is None or (old != old and place not in now):
            continue
        def close(a, b):
            strict = abs(a - b) <= tolerance * max(abs(a), abs(b), largest.get(path.rsplit("/", 1)[0], 0.0))
            changed = next((wider for old, wider in CHANGED if old.fullmatch(path)), None)
            is_relaxed = changed or (tolerance > 1e-12 and FITTED.match(name))
            return strict or (is_relaxed and after_minimiser(path, a, b, stored, changed or 1e-3))
        if place not in now:
            lines.append(f"{place}: {old} -> missing")
        elif not is_equal(old, now[place], close):
            lines.append(f"{place}: {old} -> {now[place]}")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda path: str(Path(path).resolve()))
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--show", metavar="TEXT")
    parser.add_argument("--most", type=int, default=6, help="differences listed for a command")
    parser.add_argument("--record", action="store_true")
    arguments = parser.parse_args()
    here = arithmetic(arguments.program)
    now = all_figures(arguments.program, arguments.only)
    if arguments.show is not None:
        print("\n".join(f"{path} = {value}" for values in now.values() for path, value in values.items() if arguments.show in path))
        return 0
    if arguments.record:
        NUMBERS.write_bytes(lzma.compress(json.dumps({"arithmetic": here, "figures": now}).encode(), preset=9 | lzma.PRESET_EXTREME))
        print(f"recorded {sum(map(len, now.values()))} figures of {len(now)} commands for {here}")
        return 0
    stored = json.loads(lzma.decompress(NUMBERS.read_bytes()))
    tolerance = 1e-12 if here == stored["arithmetic"] else 1e-9
    if tolerance > 1e-12:
        print(f"arithmetic is {here}, recorded was {stored['arithmetic']}: figures within {tolerance:g}, fits within wider bounds")
        if os.environ.get("NAV_SIM_CI"):
            return 1
    compared, differing = 0, 0
    for name, expected in stored["figures"].items():
        name_now = MAP["moved"].get(name, name)
        if name_now not in now:
            continue
        lines = differences(name, expected, now[name_now], tolerance)
        compared, differing = compared + len(expected), differing + len(lines)
        if lines:
            print(f"{name}: {len(lines)} of {len(expected)} figures differ")
            print("\n".join(f"  {line[:220]}" for line in lines[: arguments.most]))
    gone = [name for name in stored["figures"] if name not in MAP["deleted"] and arguments.only in name]
    gone = [name for name in gone if MAP["moved"].get(name, name) not in now]
    print("".join(f"{name}: not run\n" for name in gone) + f"{differing} of {compared} figures of {len(now)} commands differ")
    return 1 if differing or gone else 0


if __name__ == "__main__":
    sys.exit(main())
