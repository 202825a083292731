"""Tuning, requirements, designs, choices, comparisons: as the commands answer."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import nav_sim
import pytest
from conftest import CONSUMER, DRIVE, TACTICAL, Command, first_seconds, refused, without_times
from distributed import Client


def test_tune(short: Path, command: Command, tmp_path: Path) -> None:
    words = ("--outage 20:40 --for mean --seed 1 -q --format json --truth", CONSUMER, "--trajectory", short)
    said = command("tune", TACTICAL, *words, "-o", tmp_path / "tuned.toml").stdout
    own = nav_sim.tune(TACTICAL, truth=CONSUMER, trajectory=short, outages=[(20, 40)], aim="mean", seed=1)
    assert without_times(own._native.json()) == without_times(said)
    assert own.model == nav_sim.Model.read(tmp_path / "tuned.toml")


def test_require(short: Path, command: Command, tmp_path: Path) -> None:
    asked = "--outage 20:40 --require p95_m<=50 -q --format json"
    said = command("require", short, asked, "-o", tmp_path / "needed.toml").stdout
    own = nav_sim.require(short, outage=(20, 40), limits="p95_m<=50")
    assert json.loads(own._native.json()) == json.loads(said)
    assert own.model == nav_sim.Model.read(tmp_path / "needed.toml")
    judged = nav_sim.require(short, TACTICAL, outage=(20, 40), limits=["p95_m<=0.001"])
    assert judged.unmet is not None and judged.model is None
    said = command("require", short, asked, "--catalogue").stdout
    ranked = nav_sim.require(short, outage=(20, 40), limits="p95_m<=50", catalogue=True)
    assert json.loads(ranked._native.json()) == json.loads(said)


def test_design(command: Command) -> None:
    words = "--recordings 4 --hours 0.1 --draws 40 --estimator awv --seed 1 --format json -q"
    said = command("design", TACTICAL, words).stdout
    own = nav_sim.design(TACTICAL, recordings=4, hours=0.1, draws=40, estimator="awv", seed=1)
    assert own._native.json() == said


def test_choose(recordings: Path, tmp_path: Path, command: Command) -> None:
    # a drive as long as the recordings
    path = first_seconds(30.0, tmp_path / "drive.csv")
    words = "--outage 10:15 --model WN+RW --estimator awv --runs 2 --seed 1 --format json -q -o"
    said = command("choose", recordings, "--trajectory", path, words, tmp_path / "chosen").stdout
    own = nav_sim.choose(recordings, path, outages=[(10, 15)], model=["WN+RW"], estimator=["awv"], runs=2, seed=1)
    assert without_times(own._native.json()) == without_times(said)
    assert own.model == nav_sim.Model.read(tmp_path / "chosen" / "model.toml")


def test_compare(short: Path, command: Command, tmp_path: Path) -> None:
    for name, filter in (("full", "full"), ("15", 15)):
        nav_sim.run(short, TACTICAL, runs=4, outages=[(20, 40)], filter=filter, seed=1).write(tmp_path / name)
    words = ("--format json -q --reference", tmp_path / "full")
    said = command("compare", tmp_path / "15", *words, cwd=tmp_path).stdout
    own = nav_sim.compare(tmp_path / "15", tmp_path / "full")
    assert own._native.json() == said


STUDY = {
    "run": {
        "trajectory": "../short.csv",
        "truth": TACTICAL,
        "outage": ["20:+{length_s}"],
        "runs": 16,
        "seed": 1,
    },
    "vary": {
        "length_s": [5, 20],
        "model": {"tactical": {"model": TACTICAL}, "consumer": {"model": CONSUMER}},
    },
}


def test_a_study(short: Path, command: Command, tmp_path: Path) -> None:
    (tmp_path / "short.csv").write_bytes(short.read_bytes())
    study = nav_sim.Study(STUDY, tmp_path / "own")
    assert study.run(shard=(0, 2)) is None
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = study.run(pool)
    assert found is not None
    command("batch", study.path, "-q -o", tmp_path / "command")
    for name in ("results.csv", "summary.json"):
        own, commands = ((tmp_path / place / name).read_text(encoding="utf-8") for place in ("own", "command"))
        assert own == commands, name
    assert set(found.table["model"]) == {"tactical", "consumer"} and found.summary()
    assert (found.cell("length_s=5_tactical") / "runs.csv").exists()
    with Client(processes=False, dashboard_address=None) as client:  # type: ignore[no-untyped-call]
        spread = nav_sim.Study(STUDY, tmp_path / "dask").run(client.get_executor())
    assert spread is not None and spread.data == found.data
    with pytest.raises(nav_sim.NavSimError, match="no such cell"):
        found.cell("gone")
    with pytest.raises(nav_sim.NavSimError, match="shard"):
        study.run(shard=(2, 2))


def test_wrong_arguments(tmp_path: Path) -> None:
    assert "p95" in str(refused("", nav_sim.require, DRIVE, outage=30, limits="p95=50"))
    refused("", nav_sim.compare, tmp_path / "none", tmp_path / "none")
    refused("", nav_sim.design, TACTICAL, estimator="gmwm")
