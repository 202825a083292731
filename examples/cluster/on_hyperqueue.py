#!/usr/bin/env python3
"""A study on HyperQueue, disturbed, against the same study undisturbed.

    pip install hyperqueue
    python3 examples/cluster/on_hyperqueue.py target/release/nav-sim

Starts a HyperQueue server with two workers on this machine and gives them the shards of a study of 50 units. One
task is killed (SIGKILL) while it works, then the server with both workers; a second server with two workers does what
is left. The merged tables must be those of a run in one process, byte by byte.

(The workers of the Python package live in the process of its server, so one cannot be killed without the other.)
"""

import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

SHARDS = 8
UNITS = 50
HERE = Path(__file__).resolve().parent.parent
STUDY = f"""
runs = 3000
unit_runs = 300
seed = 1
metrics = ["outages", "ratios", "epochs"]
trajectory = [{{ file = "{HERE}/quick_drive.toml" }}]
truth = [{{ model = "{HERE}/../calib_data/consumer_mems.toml" }}]
candidate = [
  {{ model = "{HERE}/../calib_data/consumer_mems.toml" }},
  {{ model = "{HERE}/../calib_data/tactical.toml" }},
]
outages = [{{ sweep = {{ start_s = 20, duration_s = [2, 5, 10, 20, 30] }} }}]
"""


def batch(program, command, directory, *more):
    arguments = [program, "batch", command, "study.toml", "--out", directory, "--quiet", *more]
    return subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)


def serve(program):
    """A server with two workers, until every shard has been worked on."""
    with LocalCluster() as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        job = Job(default_workdir=Path.cwd(), max_fails=SHARDS)
        run = [program, "batch", "run", "study.toml", "--out", "hq", "--shards", str(SHARDS), "-j", "1"]
        for _ in range(SHARDS):  # HQ_TASK_ID counts them from 0
            job.program([*run, "--no-progress"])
        client = cluster.client()
        client.wait_for_jobs([client.submit(job)], raise_on_error=False)


def units():
    return len(list(Path("hq/units").glob("*/*.unit")))


def wait_for(number):
    while units() < number:
        time.sleep(0.01)


def tasks(server):
    """Processes of nav-sim below the server."""
    listed = subprocess.run(["ps", "-eo", "pid=,ppid=,comm="], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listed.splitlines()]
    return [int(pid) for pid, parent, name in rows if int(parent) == server and name.startswith("nav-sim")]


def results(directory):
    return {path.name: path.read_bytes() for path in sorted(Path(directory, "results").iterdir())}


def main():
    program = str(Path(sys.argv[1] if len(sys.argv) > 1 else "nav-sim").absolute())
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        Path("study.toml").write_text(STUDY)
        for directory in ["one", "hq"]:
            batch(program, "plan", directory)
        batch(program, "run", "one")
        batch(program, "merge", "one")

        server = multiprocessing.Process(target=serve, args=(program,))
        server.start()
        wait_for(5)
        victim = tasks(server.pid)[0]
        os.kill(victim, signal.SIGKILL)
        print(f"killed task {victim} after {units()} of {UNITS} units")
        wait_for(15)
        orphans = tasks(server.pid)
        for pid in [server.pid, *orphans]:
            os.kill(pid, signal.SIGKILL)
        server.join()
        left = units()
        print(f"killed the server with both workers after {left} units")
        assert left < UNITS

        server = multiprocessing.Process(target=serve, args=(program,))
        server.start()
        server.join()
        print(f"{units()} units after the second server")
        batch(program, "merge", "hq")
        assert results("hq") == results("one"), "the tables differ"
        print(f"{len(results('hq'))} merged files are the same bytes as undisturbed")
        os.chdir("/")


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
