"""Noise models."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from nav_sim import _native
from nav_sim._answer import Answer, Columns, ask, axes_or_new, flattened
from nav_sim._errors import NavSimError
from nav_sim._inputs import FloatArray, Staging, StrPath, as_json, as_toml, number, numbers, path, vector, whole, word
from nav_sim._wavelet import scales_s

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: A process as model files have it: {"type": "WN", "sigma2": 5e-5}.
Process = Mapping[str, Any]
#: The processes of a sensor, the same for its axes, or by axis.
Processes = Union[Sequence[Process], Mapping[str, Sequence[Process]]]

CHANNELS = tuple(f"{sensor}.{axis}" for sensor in ("accel", "gyro") for axis in "xyz")


class Model:
    """The noise of an IMU: for each axis a sum of processes, at a rate.

        Model(rate_hz=100, gyro=[{"type": "WN", "sigma2": 1e-6}, {"type": "RW", "gamma2": 1e-13}])

    Types and parameters, per sample: WN sigma2, QN q2, AR1 phi and sigma2 (of the innovation), RW gamma2 (of the
    increment), DR slope, GM, MA1; m/s² for accelerometers, rad/s for gyroscopes. A sensor that is left out has no
    noise.
    """

    def __init__(
        self, rate_hz: float, accel: Processes | Process | None = None, gyro: Processes | Process | None = None
    ) -> None:
        sensors = {name: _axes(given, name) for name, given in (("accel", accel), ("gyro", gyro)) if given is not None}
        # without a name no line is told of a text that the caller never saw
        self._take(as_toml({"schema": 1, "rate_hz": number(rate_hz, "rate_hz"), **sensors}), "")
        self._path: str | None = None

    def _take(self, text: str, path: str | None) -> None:
        self._text, self._path = text, path
        # the draws behind the intervals of a calibration, which `lincov` and `tune` read beside the model
        self._draws: str | None = None
        self._contents: dict[str, Any] = json.loads(_native.model_contents(text, path))

    @classmethod
    def from_toml(cls, text: str) -> Model:
        """Parses the text of a model file."""
        return cls._of(text, None)

    @classmethod
    def _of(cls, text: str, path: str | None) -> Model:
        model = cls.__new__(cls)
        model._take(text, path)
        return model

    @classmethod
    def read(cls, file: StrPath) -> Model:
        """Reads a model file (TOML), as `calibrate` writes it."""
        name = path(file, "file")
        try:
            text = Path(name).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as e:
            reason = getattr(e, "strerror", None) or str(e)
            raise NavSimError(f"{name}: {reason}", file=name) from None
        return cls._of(text, name)

    @classmethod
    def from_datasheet(
        cls,
        unit: str | None = None,
        *,
        entry: StrPath | Mapping[str, Any] | None = None,
        measured: StrPath | None = None,
        rate_hz: float | None = None,
        vrw: str | None = None,
        arw: str | None = None,
        accel_bias: str | None = None,
        gyro_bias: str | None = None,
        accel_rrw: str | None = None,
        gyro_rrw: str | None = None,
        corr_time: str | None = None,
        accel_turn_on: str | None = None,
        gyro_turn_on: str | None = None,
    ) -> Model:
        """A model from data-sheet figures, not calibrated (`nav-sim datasheet`).

        `unit` is a name of `nav_sim.catalogue()`, `entry` one's own (TOML, or its tables as a dict), `measured` a file of Kalibr,
        allan_variance_ros or imu_utils (YAML). Figures with units override these: `vrw`, `arw` (noise densities,
        "0.15 deg/sqrt(h)"), `accel_bias`, `gyro_bias` (instabilities, "0.5 deg/h"), `corr_time` (of these, "100 s"), `accel_rrw`,
        `gyro_rrw` (rate random walks, "2 deg/h/sqrt(h)"), `accel_turn_on`, `gyro_turn_on` (standard deviations, "2 mg"). `rate_hz`:
        of the file, else 100 Hz.
        """
        figures: dict[str, Any] = {"vrw": vrw, "arw": arw, "corr_time": corr_time}
        figures |= {"accel_bias": accel_bias, "gyro_bias": gyro_bias}
        figures |= {"accel_rrw": accel_rrw, "gyro_rrw": gyro_rrw, "from": None if measured is None else path(measured, "measured")}
        figures |= {"accel_turn_on": accel_turn_on, "gyro_turn_on": gyro_turn_on}
        with Staging() as staging:
            own = None if entry is None else staging.settings(entry, "entry")
            made = ask(Answer, "datasheet", staging, entry=own, unit=unit, rate_hz=rate_hz, **figures)
        return cls._of(made.text("model.toml"), None)

    def write(self, path: StrPath) -> Path:
        """Writes a model file, and after a calibration its draws (`….draws.json`)."""
        place = Path(path)
        place.write_text(self._text, encoding="utf-8", newline="\n")
        if self._draws is not None:
            place.with_suffix(".draws.json").write_text(self._draws, encoding="utf-8", newline="\n")
        return place

    def to_toml(self) -> str:
        """Text of its model file, with intervals and provenance."""
        return self._text

    @property
    def rate_hz(self) -> float:
        """The rate that its parameters are for (Hz)."""
        return float(self._contents["rate_hz"])

    @property
    def processes(self) -> dict[str, list[dict[str, Any]]]:
        """The processes of each channel that it has: `processes["gyro.x"]`."""
        return {channel: list(self._contents["channels"][channel]) for channel in self.channels}

    @cached_property
    def channels(self) -> list[str]:
        """The channels that it has."""
        return list(self._contents["channels"])

    def __add__(self, other: Model) -> Model:
        """Sum of two noises of one rate."""
        if not isinstance(other, Model):
            return NotImplemented
        if other.rate_hz != self.rate_hz:
            raise NavSimError(f"models of {self.rate_hz} Hz and of {other.rate_hz} Hz have no sum")
        own, more = self.processes, other.processes
        sensors: dict[str, dict[str, list[Process]]] = {"accel": {}, "gyro": {}}
        for channel in CHANNELS:
            sensor, axis = channel.split(".")
            both: list[Process] = [*own.get(channel, []), *more.get(channel, [])]
            if both:
                sensors[sensor][axis] = both
        return Model(self.rate_hz, sensors["accel"] or None, sensors["gyro"] or None)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self._contents == other._contents

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        sums = {channel: "+".join(p["type"] for p in own) for channel, own in self.processes.items()}
        return f"<Model at {self.rate_hz} Hz: {', '.join(f'{channel} {sum}' for channel, sum in sums.items())}>"

    def synthesize(
        self,
        *,
        samples: int | None = None,
        duration_s: float | None = None,
        replicate: int = 1,
        seed: int = 1,
        spread: bool = False,
        contaminate: StrPath | None = None,
    ) -> dict[str, FloatArray]:
        """A static recording of it, a column a channel: what `nav-sim synthesize` writes as replicate number
        `replicate`.

        `spread` draws the parameters of the replicate from the spread that the model file states; `contaminate`
        corrupts the recording as a scenario of the paper ("section5-II") or a file says.
        """
        if (samples is None) == (duration_s is None):
            raise NavSimError("samples, duration_s: give one of them")
        if duration_s is not None:
            samples = round(number(duration_s, "duration_s") * self.rate_hz)
        count, own, drawn = whole(samples, "samples", 1), whole(replicate, "replicate", 1), whole(seed, "seed", 0)
        corrupts = None if contaminate is None else path(contaminate, "contaminate")
        return _native.model_recording(self._text, count, own, drawn, bool(spread), corrupts)

    def wavelet_variance(self, tau_s: npt.ArrayLike) -> Columns:
        """Wavelet variance of each channel at the scales `tau_s` (s), rounded to 2, 4, 6, … samples."""
        return self._implied(tau_s, 2, lambda allan: allan / 2.0)

    def allan_deviation(self, tau_s: npt.ArrayLike) -> Columns:
        """Allan deviation of each channel at the averaging times `tau_s` (s), rounded to whole samples."""
        return self._implied(tau_s, 1, np.sqrt)

    def _implied(self, tau_s: npt.ArrayLike, per_average: int, of: Callable[[FloatArray], FloatArray]) -> Columns:
        averaged = np.rint(vector(tau_s, "tau_s") * self.rate_hz / per_average)
        if not ((averaged >= 1) & (averaged < 2**31)).all():
            raise NavSimError(f"tau_s: expected {per_average / self.rate_hz} s or more")
        found = _native.model_allan(self._text, averaged.astype(int).tolist())
        return {"tau_s": averaged * per_average / self.rate_hz, **{name: of(v) for name, v in found.items()}}

    def practical(
        self, policy: str = "matched", horizon_s: tuple[float, float] = (1.0, 100.0)
    ) -> dict[str, dict[str, float | None]]:
        """Data-sheet figures of the noisiest axis of each sensor.

        Noise density and random walk over `horizon_s`: "matched" (its Allan deviation
        at 1 s and the closest bias), "envelope" (nowhere below it) or "strict" (WN and RW as they are). What a model
        does not have is None.
        """
        found: dict[str, dict[str, float | None]] = json.loads(
            _native.model_practical(self._text, word(policy, "policy"), *numbers(horizon_s, "horizon_s", 2))
        )
        return found

    def export(
        self,
        target: str,
        path: StrPath | None = None,
        *,
        policy: str = "matched",
        horizon_s: tuple[float, float] = (1.0, 100.0),
    ) -> str:
        """Its parameters as the file of another program: "kalibr", "openvins", "px4", "gtsam", "matlab" and others.

        Returns the text, and writes it where a path is given.
        """
        horizon = "{}:{}".format(*numbers(horizon_s, "horizon_s", 2))
        with Staging() as staging:
            own = staged(self, "model", staging)
            found = ask(Answer, "export", staging, model=own, target=target, policy=policy, horizon=horizon)
        text = found.text("parameters.txt")
        if path is not None:
            Path(path).write_text(text, encoding="utf-8", newline="\n")
        return text[:-1]

    def plot(self, channel: str, ax: Axes | None = None, scales: int = 20, **line: Any) -> Axes:
        """Draws the wavelet variance that a channel implies."""
        ax = axes_or_new(ax)
        curve = self.wavelet_variance(scales_s(scales, self.rate_hz))
        ax.loglog(curve["tau_s"], curve[word(channel, "channel")], label=channel, **line)
        ax.set(xlabel="scale (s)", ylabel="wavelet variance")
        return ax


def _axes(given: Processes | Process, name: str) -> dict[str, Any]:
    if isinstance(given, Mapping) and "type" in given:
        return _axes([given], name)
    if isinstance(given, Mapping):
        return {axis: {"processes": own} for axis, own in given.items()}
    if isinstance(given, (list, tuple)):
        return {"processes": given}
    hint = 'a list such as [{"type": "WN", "sigma2": 1e-6}]'
    raise NavSimError(f"{name}={given!r} is not a list of processes", hint=hint)


def staged(model: StrPath | Model, name: str, staging: Staging) -> str:
    """The file of a model: its own where it was read from one."""
    if not isinstance(model, Model):
        return path(model, name)
    if model._path is not None:
        return model._path
    if model._draws is not None:
        staging.text(f"{name}.draws.json", model._draws)
    return staging.text(f"{name}.toml", model._text)


def catalogue() -> Columns:
    """Catalogued IMUs, a row a figure of a data sheet: `unit` (for `Model.from_datasheet`), `name`, `class`, `sensor`,
    `figure`, `given` (number and unit), `source`."""
    units = json.loads(_native.answer("datasheet", as_json({"list": True}), "", None).json())["units"]
    rows = [{"unit": u["unit"], "name": u["name"], "class": u["class"], **figure} for u in units for figure in u["figures"]]
    return flattened(rows)
