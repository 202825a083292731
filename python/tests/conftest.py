"""What several tests need: files of the repository, short recordings, the command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nav_sim
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
DRIVE = ROOT / "trajectories" / "figure_eight.toml"
TACTICAL = ROOT / "calib_data" / "tactical.toml"
CONSUMER = ROOT / "calib_data" / "consumer_mems.toml"

Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def command() -> Command:
    """The command of the wheel, whose exit code is to be the first argument's."""

    def call(*words: object, code: int = 0, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        given = [sys.executable, "-m", "nav_sim", "--no-progress"]
        for word in words:
            # options may be one text
            given += word.split() if isinstance(word, str) and word[0] == "-" else [str(word)]
        done = subprocess.run(given, capture_output=True, text=True, cwd=cwd, encoding="utf-8")
        assert done.returncode == code, done.stderr
        return done

    return call


def refused(words: str, call: Callable[..., object], *given: Any, **arguments: Any) -> nav_sim.NavSimError:
    """The error of a call, whose message begins with these words."""
    with pytest.raises(nav_sim.NavSimError) as found:
        call(*given, **arguments)
    assert found.value.message.startswith(words), found.value.message
    return found.value


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory, command: Command) -> Path:
    """Four static recordings of 4096 samples, 100 Hz."""
    place = tmp_path_factory.mktemp("recordings") / "static"
    command("synthesize", CONSUMER, "--replicates 4 --samples 4096 --seed 1 -o", place)
    return place


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory, command: Command) -> Path:
    """IMU and GNSS recordings of a drive: imu.csv, gnss.csv, reference.csv, initial.toml."""
    place = tmp_path_factory.mktemp("drive") / "drive"
    command("trajectory", "record", DRIVE, TACTICAL, "--seed 1 -o", place)
    return place


def first_seconds(seconds: float, path: Path) -> Path:
    """The beginning of the shipped drive as a table."""
    states = nav_sim.Trajectory(DRIVE).states(10.0)
    count = round(10.0 * seconds) + 1
    return nav_sim.Trajectory({k: v[:count] for k, v in states.items() if not k.startswith("v_")}).write(path)


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of a minute."""
    return first_seconds(60.0, tmp_path_factory.mktemp("short") / "short.csv")


def table(path: Path) -> dict[str, Any]:
    """A table of numbers as columns."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return dict(zip(lines[0].split(","), np.loadtxt(lines[1:], delimiter=",", ndmin=2).T))


def without_times(text: str) -> dict[str, Any]:
    """JSON without what the seed does not determine, and without the names of inputs."""
    found: dict[str, Any] = json.loads(text)
    for key in ("throughput_epochs_per_s", "files"):
        found.pop(key, None)
    return found


@pytest.fixture(scope="session")
def tactical() -> nav_sim.Model:
    return nav_sim.Model.read(TACTICAL)


@pytest.fixture(autouse=True)
def no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, "MPLBACKEND", "agg")
