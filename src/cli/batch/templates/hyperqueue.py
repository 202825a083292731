#!/usr/bin/env python3
"""pip install hyperqueue, then run this file where the study is: with the directory of a running
HyperQueue server as argument, or without, and a server and a worker are started here."""
import subprocess
import sys
from pathlib import Path

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest

RUN = [{{run_words}}]


def work(client):
    job = Job(default_workdir=Path.cwd(), max_fails={{shards}})
    for _ in range({{shards}}):  # HQ_TASK_ID counts them from 0
        job.program(RUN, resources=ResourceRequest(cpus={{cpus}}))
    return client.wait_for_jobs([client.submit(job)], raise_on_error=False)


subprocess.run([{{plan_words}}], check=True)
if len(sys.argv) > 1:
    work(Client(sys.argv[1]))
else:
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig())
        work(cluster.client())
# exit code 75 of the merge: units are missing; run this file again
sys.exit(subprocess.run([{{merge_words}}]).returncode)
