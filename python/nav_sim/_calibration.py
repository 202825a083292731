"""Calibration: from static recordings to a noise model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nav_sim._answer import Answer, Columns, Progress, ask, axes_or_new, flattened
from nav_sim._errors import NavSimError
from nav_sim._inputs import Staging
from nav_sim._model import Model
from nav_sim._wavelet import Recordings, reading

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Calibration(Answer):
    """Noise models that were fitted to recordings: `nav-sim calibrate`."""

    @cached_property
    def model(self) -> Model:
        """The noise model; of several estimators the first one's (see `models`)."""
        return next(iter(self.models.values()))

    @cached_property
    def models(self) -> dict[str, Model]:
        """The noise model of each estimator."""
        files = [name for name in self.files if name.endswith(".toml")]
        named = zip(dict.fromkeys(fit["estimator"] for fit in self.data["fits"]), files)
        return {estimator: self._model(name) for estimator, name in named}

    def _model(self, name: str) -> Model:
        model = Model.from_toml(self.text(name))
        draws = name.removesuffix(".toml") + ".draws.json"
        model._draws = self.text(draws) if draws in self.files else None
        return model

    @property
    def verdict(self) -> str:
        """How well the models fit, in words."""
        return "\n".join(self._native.verdict())

    @cached_property
    def parameters(self) -> Columns:
        """Every parameter of every fit, a row each: a dict of columns.

        `estimator`, `sensor`, `axis`, `process` ("AR1_2"), `parameter` ("phi"), `value`, `ci_low` and `ci_high` (the
        95 % interval, NaN where the data do not determine it), `unit`.
        """
        return flattened([row for fit in self.data["fits"] for row in _parameters(fit)])

    @cached_property
    def curves(self) -> list[dict[str, Any]]:
        """The fitted curves: `tau_s`, `wv`, `ci_low`, `ci_high`, `implied` (by the model) and what they are of."""
        files = [name for name in self.files if name.endswith(".wv.json")]
        found = [entry for name in files for entry in json.loads(self.text(name))["curves"]]
        return [{key: _array(value) for key, value in entry.items() if key != "replicates"} for entry in found]

    def plot(self, ax: Axes | None = None, sensor: str | None = None, axis: str | None = None) -> Axes:
        """Draws the wavelet variance of the recordings and that of the model, of one sensor where it is named."""
        ax = axes_or_new(ax)
        chosen = [c for c in self.curves if sensor in (None, c["sensor"]) and axis in (None, c["axis"])]
        if not chosen:
            raise NavSimError(f"sensor, axis: there is no curve of {sensor} {axis}")
        for curve in chosen:
            of = f"{curve['sensor']} {curve['axis']}, {curve['estimator']}"
            line = ax.loglog(curve["tau_s"], curve["implied"], label=f"{of}: model")[0]
            ax.loglog(curve["tau_s"], curve["wv"], ".", color=line.get_color(), label=of)
            ax.fill_between(curve["tau_s"], curve["ci_low"], curve["ci_high"], alpha=0.2, color=line.get_color(), lw=0)
        ax.set(xlabel="scale (s)", ylabel="wavelet variance")
        ax.legend()
        return ax


_UNITS = {"accel": "m/s²", "gyro": "rad/s"}


def _parameters(fit: Mapping[str, Any]) -> list[dict[str, Any]]:
    types = [process["type"] for process in fit["processes"]]
    rows = []
    for k, process in enumerate(fit["processes"]):
        kind = types[k]
        label = f"{kind}_{types[: k + 1].count(kind)}" if types.count(kind) > 1 else kind
        for name, value in process.items():
            if name == "type" or name.endswith("_ci95"):
                continue
            low, high = process.get(f"{name}_ci95") or (None, None)
            place = {key: fit[key] for key in ("estimator", "sensor", "axis")}
            unit = _unit(name, _UNITS[fit["sensor"]])
            figures = {"value": value, "ci_low": low, "ci_high": high, "unit": unit}
            rows.append({**place, "process": label, "parameter": name, **figures})
    return rows


def _unit(parameter: str, unit: str) -> str:
    """The unit of a parameter per sample."""
    if parameter in ("phi", "theta"):
        return ""
    if parameter == "beta":
        return "1/s"
    return f"({unit})²" if parameter.endswith("2") else unit


def _array(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _array(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return np.asarray([np.nan if entry is None else entry for entry in value])
    return value


def calibrate(
    recordings: Recordings,
    *,
    rate_hz: float | None = None,
    estimator: str = "dr-awv",
    model: str = "N2",
    axes: str | Sequence[str] | None = None,
    pool: str | None = None,
    trim: int | str | None = None,
    weighting: str | None = None,
    efficiency: float = 0.6,
    scales: int | str | None = None,
    skip_s: float | None = None,
    gaps: str | None = None,
    bootstrap: int | None = None,
    seed: int = 1,
    threads: int | None = None,
    progress: Progress = None,
) -> Calibration:
    """Fits a noise model to static recordings, each of them one replicate: `nav-sim calibrate`.

    Parameters
    ----------
    recordings
        One or a list of: a path (CSV, .npy, .npz, .mcap, .bag, .ulg, .ubx; a directory is all its recordings), a table
        (dict of columns, data frame, structured array) with the names `accel_x_m_s2` … `gyro_z_rad_s` and `t_s`, or an
        array of 6 columns (accelerometer x, y, z in m/s², gyroscope x, y, z in rad/s), of 3 with `axes="gyro"`, of 1
        with `axes="gyro.x"`.
    rate_hz
        Sample rate (Hz), where there is no time in the recordings.
    estimator
        "awv", "sr-awv" or "dr-awv" of several signals; "gmwm", "rgmwm" or "avlr" of a single recording; "all".
    model
        A sum such as "2*AR1+RW+WN+QN" (that is "N2"), or "auto", which chooses.
    axes
        The signals to take: "gyro", "accel.x", …
    pool
        "sensor": the three axes of a sensor are replicates of one another; "axes": a model for each axis.
    trim
        Replicates that dr-awv drops at each end of each scale: a number, or a share such as "30%".
    weighting
        Weight of a scale: "model" or "edof".
    efficiency
        Efficiency of the robust variances, 0.3 to 0.99.
    scales
        How many, or those that are fitted: "1s:1000s".
    skip_s
        Seconds to leave out at the beginning.
    gaps
        Missing samples: "keep", "refuse", "split", "ignore".
    bootstrap
        Draws behind the intervals; 0: no intervals.
    seed
        Seed of these draws.
    threads, progress
        As of `run`, of recordings.
    """
    with Staging() as staging:
        files = staging.recordings(recordings, "recordings", axes if isinstance(axes, str) else None)
        return ask(
            Calibration,
            "calibrate",
            staging,
            progress,
            threads,
            recording=files,
            estimator=estimator,
            model=model,
            trim=trim,
            weighting=weighting,
            pool=pool,
            bootstrap=bootstrap,
            **reading(rate_hz, skip_s, gaps, axes),
            efficiency=efficiency,
            scales=scales,
            seed=seed,
        )
