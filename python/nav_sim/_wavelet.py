"""Wavelet variances and Allan deviations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from nav_sim import _native
from nav_sim._answer import Answer, Progress, ask, axes_or_new
from nav_sim._errors import NavSimError
from nav_sim._inputs import FloatArray, Staging, StrPath, Table, number, vector, whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: A recording or several, as `calibrate` takes them.
Recordings = Union[StrPath, Table, npt.ArrayLike, Sequence[Union[StrPath, Table, npt.ArrayLike]]]


class Curve(dict[str, FloatArray]):
    """A variance or deviation, scale by scale: a dict of arrays of one length.

    `tau_s` are the times (s), `ci_low` and `ci_high` the ends of the 95 % intervals, `edof` the equivalent degrees of
    freedom; the figure itself is `wv` (the unit of x squared) or `adev` (the unit of x).
    """

    def plot(self, ax: Axes | None = None, **line: Any) -> Axes:
        """Draws the curve with its intervals, both axes logarithmic; `line` goes to matplotlib."""
        ax = axes_or_new(ax)
        name, x, y = "wv", "scale (s)", "wavelet variance"
        if "adev" in self:
            name, x, y = "adev", "averaging time (s)", "Allan deviation"
        drawn = ax.loglog(self["tau_s"], self[name], marker=".", **line)[0]
        ax.fill_between(self["tau_s"], self["ci_low"], self["ci_high"], alpha=0.2, color=drawn.get_color(), lw=0)
        ax.set(xlabel=x, ylabel=y)
        return ax


def wavelet_variance(
    x: npt.ArrayLike,
    rate_hz: float,
    *,
    robust: bool = False,
    efficiency: float = 0.6,
    scales: int | None = None,
) -> Curve:
    """The Haar wavelet variance of one signal at the scales 2, 4, 8, … samples.

    Parameters
    ----------
    x
        Evenly spaced samples, in any unit; NaN where one is missing. Their mean does not matter.
    rate_hz
        Their rate (Hz).
    robust
        The M-estimate that outliers do not raise, instead of the classical mean of squares.
    efficiency
        That of the robust one at the Gaussian model, 0.3 to 0.99.
    scales
        How many; by default one less than the length allows.
    """
    rate = _rate(rate_hz)
    levels = None if scales is None else whole(scales, "scales", 1)
    found = _native.wavelet(vector(x, "x"), levels, number(efficiency, "efficiency") if robust else None)
    return Curve(tau_s=scales_s(len(found["wv"]), rate), **found)


def scales_s(count: int, rate_hz: float) -> FloatArray:
    """The first scales, 2, 4, 8, … samples (s)."""
    scales: FloatArray = np.exp2(np.arange(1.0, count + 1.0)) / rate_hz
    return scales


def allan_deviation(
    x: npt.ArrayLike,
    rate_hz: float,
    *,
    robust: bool = False,
    efficiency: float = 0.6,
    scales: int | None = None,
) -> Curve:
    """The overlapping Allan deviation of one signal of rates, at averaging times of 1, 2, 4, … samples.

    It is the root of twice the wavelet variance at scales twice as long, with the arguments of `wavelet_variance`.
    """
    wv = wavelet_variance(x, rate_hz, robust=robust, efficiency=efficiency, scales=scales)
    adev, low, high = (np.sqrt(2.0 * wv[key]) for key in ("wv", "ci_low", "ci_high"))
    return Curve(tau_s=wv["tau_s"] / 2.0, adev=adev, edof=wv["edof"], ci_low=low, ci_high=high)


def _rate(rate_hz: float) -> float:
    rate = number(rate_hz, "rate_hz")
    if not 0.0 < rate < math.inf:
        raise NavSimError(f"rate_hz: {rate_hz} is not a rate above 0 Hz")
    return rate


class WaveletVariances(Answer):
    """The wavelet variances of recordings, signal by signal: `nav-sim wv`."""

    @cached_property
    def signals(self) -> list[dict[str, Any]]:
        """One entry a signal: file, sensor, axis, and the curves `classical` and `robust`."""
        return [self._signal(entry) for entry in self.data["signals"]]

    def _signal(self, entry: dict[str, Any]) -> dict[str, Any]:
        tau_s, edof = np.asarray(entry["tau_s"]), np.asarray(entry["edof"])
        efficiency = float(self.data["efficiency"])

        def curve(name: str, share: float) -> Curve:
            figures = {key: np.asarray(entry[name][key], dtype=np.float64) for key in ("wv", "ci_low", "ci_high")}
            # the engine has no fewer than one
            return Curve(tau_s=tau_s, edof=np.maximum(share * edof, 1.0), **figures)

        named = {key: entry[key] for key in ("file", "sensor", "axis", "samples")}
        return {**named, "classical": curve("classical", 1.0), "robust": curve("robust", efficiency)}


def reading(
    rate_hz: float | None, skip_s: float | None, gaps: str | None, axes: str | Sequence[str] | None
) -> dict[str, Any]:
    """Options for reading recordings."""
    return {"rate_hz": rate_hz, "skip_s": skip_s, "gaps": gaps, "axes": axes}


def wv(
    recordings: Recordings,
    *,
    rate_hz: float | None = None,
    axes: str | Sequence[str] | None = None,
    efficiency: float = 0.6,
    scales: int | None = None,
    intervals: str = "eta3",
    skip_s: float | None = None,
    gaps: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> WaveletVariances:
    """Wavelet variances (classical, robust) of static recordings: `nav-sim wv`.

    The recordings are given as to `calibrate`, with `rate_hz` where there is no time in them. `axes` takes some of the signals ("gyro", "accel.x"); `intervals` is
    "eta3" or "large-sample"; `skip_s` leaves out seconds at the beginning; `gaps` is
    "keep", "refuse", "split" or "ignore"; `efficiency`, `scales`, `threads` and `progress` are as of `calibrate`.
    """
    with Staging() as staging:
        files = staging.recordings(recordings, "recordings", axes if isinstance(axes, str) else None)
        return ask(
            WaveletVariances,
            "wv",
            staging,
            progress,
            threads,
            recording=files,
            **reading(rate_hz, skip_s, gaps, axes),
            efficiency=efficiency,
            scales=scales,
            intervals=intervals,
        )
