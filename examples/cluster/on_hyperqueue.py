#!/usr/bin/env python3
"""A study on HyperQueue, disturbed, against the same study undisturbed.

    pip install hyperqueue
    python3 examples/cluster/on_hyperqueue.py target/release/nav-sim

Starts a HyperQueue server with two workers on this machine and gives them the shards of a study of 50 cells. One
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
CELLS = 50
HERE = Path(__file__).resolve().parent.parent
STUDY = f"""
[run]
trajectory = "{HERE}/quick_drive.toml"
truth = "{HERE}/../calib_data/consumer_mems.toml"
outage = ["20:+{{length_s}}"]
seed = [1, 2, 3, 4, 5]
runs = 300
[vary]
length_s = [2, 5, 10, 20, 30]
[vary.model]
right = {{ model = "{HERE}/../calib_data/consumer_mems.toml" }}
optimist = {{ model = "{HERE}/../calib_data/tactical.toml" }}
"""


def batch(program, directory):
    arguments = [program, "batch", "study.toml", "--out", directory, "--quiet"]
    return subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)


def serve(program):
    """A server with two workers, until every shard has been worked on."""
    with LocalCluster() as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        job = Job(default_workdir=Path.cwd(), max_fails=SHARDS)
        run = [program, "batch", "study.toml", "--out", "hq", "--shards", str(SHARDS), "-j", "1"]
        for _ in range(SHARDS):  # HQ_TASK_ID counts them from 0
            job.program([*run, "--no-progress"])
        client = cluster.client()
        client.wait_for_jobs([client.submit(job)], raise_on_error=False)


def cells():
    return len(list(Path("hq/cells").glob("*/manifest.json")))


def wait_for(number):
    while cells() < number:
        time.sleep(0.01)


def tasks(server):
    """Processes of nav-sim below the server."""
    listed = subprocess.run(["ps", "-eo", "pid=,ppid=,comm="], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listed.splitlines()]
    return [int(pid) for pid, parent, name in rows if int(parent) == server and name.startswith("nav-sim")]


def results(directory):
    return {name: Path(directory, name).read_bytes() for name in ["results.csv", "summary.json", "report.html"]}


def main():
    program = str(Path(sys.argv[1] if len(sys.argv) > 1 else "nav-sim").absolute())
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        Path("study.toml").write_text(STUDY)
        batch(program, "one")

        server = multiprocessing.Process(target=serve, args=(program,))
        server.start()
        wait_for(5)
        victim = tasks(server.pid)[0]
        os.kill(victim, signal.SIGKILL)
        print(f"killed task {victim} after {cells()} of {CELLS} cells")
        wait_for(15)
        orphans = tasks(server.pid)
        for pid in [server.pid, *orphans]:
            os.kill(pid, signal.SIGKILL)
        server.join()
        left = cells()
        print(f"killed the server with both workers after {left} cells")
        assert left < CELLS

        server = multiprocessing.Process(target=serve, args=(program,))
        server.start()
        server.join()
        print(f"{cells()} cells after the second server")
        batch(program, "hq")
        assert results("hq") == results("one"), "the tables differ"
        print(f"{len(results('hq'))} results are the same bytes as undisturbed")
        os.chdir("/")


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
