"""Reference trajectories."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nav_sim import _native
from nav_sim._answer import Answer, axes_or_new
from nav_sim._errors import warn
from nav_sim._inputs import FloatArray, Staging, StrPath, Table, as_json, columns, is_path, number, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Trajectory:
    """A motion: a file, or columns.

    Columns are `t_s`, `lat_deg`, `lon_deg`, `h_m`, and `roll_deg`, `pitch_deg`, `yaw_deg` where they are known;
    without them heading and pitch follow the path; names may end in `_rad` too. `n_m`, `e_m`, `d_m` are metres north, east and down of `origin`
    (latitude and longitude in degrees, height in m). Files: motion profiles (.toml), tables (.csv), KF-GINS (.nav),
    TUM, GPX.
    """

    def __init__(self, source: StrPath | Table, origin: tuple[float, float, float] | None = None) -> None:
        if is_path(source):
            self._path: str | None = os.fspath(source)
            self._columns: dict[str, FloatArray] = {}
        else:
            self._path, self._columns = None, columns(source, "trajectory")  # type: ignore[arg-type]
        self._origin = None if origin is None else numbers(origin, "origin", 3)
        found = self._read(1.0)
        self.start_s, self.end_s = float(found.data["start_s"]), float(found.data["end_s"])
        warn(found._native.warnings)

    def staged(self, staging: Staging) -> str:
        """Its file."""
        if self._path is not None:
            return self._path
        path = staging.table(self._columns, "trajectory")
        if self._origin is not None:
            # below the rows, so that these are in the lines of all tables
            with open(path, "a", encoding="utf-8") as file:
                file.write("# origin: " + ", ".join(map(repr, self._origin)) + "\n")
        return path

    def states(self, rate_hz: float = 10.0) -> dict[str, FloatArray]:
        """Position, velocity (`v_n_m_s` …) and attitude at that rate."""
        return self._read(number(rate_hz, "rate_hz")).table("trajectory.csv")

    def _read(self, rate_hz: float) -> Answer:
        with Staging() as staging:
            asked = as_json({"trajectory": self.staged(staging), "rate_hz": rate_hz})
            return Answer(_native.answer("trajectory convert", asked, staging.hidden, None))

    def write(self, path: StrPath) -> Path:
        """Writes its file, or its columns as a table."""
        with Staging() as staging:
            return Path(shutil.copyfile(self.staged(staging), path))

    def plot(self, ax: Axes | None = None, **line: Any) -> Axes:
        """Draws the way: longitude and latitude, a second a point."""
        return way(axes_or_new(ax), self.states(rate_hz=1.0), **line)

    def __repr__(self) -> str:
        return f"<Trajectory: {self._path or 'columns'}, {self.start_s:g} s to {self.end_s:g} s>"


def way(ax: Axes, states: dict[str, FloatArray], **line: Any) -> Axes:
    """Draws positions, with one scale for both directions."""
    ax.plot(states["lon_deg"], states["lat_deg"], **line)
    ax.set(aspect=1.0 / np.cos(np.radians(states["lat_deg"][0])), xlabel="longitude (°)", ylabel="latitude (°)")
    return ax


def staged(trajectory: StrPath | Table | Trajectory, staging: Staging, name: str = "trajectory") -> str:
    """The file of a trajectory."""
    if isinstance(trajectory, Trajectory):
        return trajectory.staged(staging)
    return staging.table(trajectory, name)
