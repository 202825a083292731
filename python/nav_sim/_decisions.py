"""What to do: tune a model, find an IMU, plan recordings, choose a model, compare runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy.typing as npt

from nav_sim import _model, _trajectory
from nav_sim._answer import Answer, Progress, ask, windows
from nav_sim._inputs import Staging, StrPath, Table
from nav_sim._model import Model
from nav_sim._navigation import AnyModel, AnyTrajectory, Outages, Settings, states
from nav_sim._wavelet import reading


class Choice(Answer):
    """An answer that has a noise model."""

    @cached_property
    def model(self) -> Model | None:
        """The model: tuned, needed, or chosen; None where there is none."""
        files = [name for name in self.files if name.endswith(".toml")]
        return Model.from_toml(self.text(files[0])) if files else None


def tune(
    model: AnyModel,
    *,
    truth: AnyModel | Sequence[AnyModel] | None = None,
    intervals: bool = False,
    trajectory: AnyTrajectory | None = None,
    outages: Outages = None,
    aim: str | None = None,
    per: str | None = None,
    filter: str | int | None = None,
    scenario: Settings | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Choice:
    """The smallest factors on a model that make its filter consistent with other truths: `nav-sim tune`.

    `truth` are models that may make the errors, such as those of single recordings; `intervals=True` takes the draws
    of the model's own calibration instead. `aim` is "worst" or "mean" (the option --for), `per` "sensor" or "process".
    `.model` is the tuned one.
    """
    truths = [truth] if isinstance(truth, (str, os.PathLike, Model)) else truth or []
    with Staging() as staging:
        return ask(
            Choice,
            "tune",
            staging,
            progress,
            model=_model.staged(model, "model", staging),
            truth=[_model.staged(one, f"truth[{k}]", staging) for k, one in enumerate(truths)],
            intervals=intervals,
            trajectory=None if trajectory is None else _trajectory.staged(trajectory, staging),
            outage=windows(outages),
            per=per,
            filter=states(filter),
            scenario=None if scenario is None else staging.settings(scenario, "scenario"),
            seed=seed,
            **{"for": aim},
        )


def require(
    trajectory: AnyTrajectory,
    model: AnyModel | None = None,
    *,
    outage: float | tuple[float, float] | str,
    limits: str | Sequence[str],
    start: float | None = None,
    gnss: Settings | None = None,
    scenario: Settings | None = None,
    iso_drift: bool = False,
    catalogue: StrPath | bool | None = None,
    progress: Progress = None,
) -> Choice:
    """The IMU that keeps the errors at the end of an outage within limits: `nav-sim require`.

    With a `model` it is judged, without one `.model` is what is needed. `outage` is a length (s), a pair of start and
    end, or "longest"; `limits` such as "p95_m<=5"; `catalogue=True` ranks the catalogued IMUs, a path those of a
    directory.
    """
    asked = outage if isinstance(outage, str) else _window(outage)
    with Staging() as staging:
        return ask(
            Choice,
            "require",
            staging,
            progress,
            trajectory=_trajectory.staged(trajectory, staging),
            model=None if model is None else _model.staged(model, "model", staging),
            outage=asked,
            require=[limits] if isinstance(limits, str) else list(limits),
            start=start,
            gnss=None if gnss is None else staging.settings(gnss, "gnss"),
            scenario=None if scenario is None else staging.settings(scenario, "scenario"),
            iso_drift=iso_drift,
            catalogue=_catalogue(catalogue),
        )


def _window(outage: float | tuple[float, float]) -> str:
    if isinstance(outage, (int, float)):
        return repr(float(outage))
    start_s, end_s = outage
    return f"{float(start_s)!r}:{float(end_s)!r}"


def _catalogue(catalogue: StrPath | bool | None) -> str | None:
    if isinstance(catalogue, bool):
        return "built-in" if catalogue else None
    return None if catalogue is None else os.fspath(catalogue)


def design(
    model: AnyModel,
    *,
    recordings: int | None = None,
    hours: float | None = None,
    estimator: str | None = None,
    draws: int | None = None,
    trajectory: AnyTrajectory | None = None,
    outages: Outages = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Answer:
    """How well recordings that are not made yet would determine a model: `nav-sim design`.

    Without `recordings` or `hours` several numbers and lengths are tried.
    """
    with Staging() as staging:
        return ask(
            Answer,
            "design",
            staging,
            progress,
            model=_model.staged(model, "model", staging),
            recordings=recordings,
            hours=hours,
            estimator=estimator,
            draws=draws,
            trajectory=None if trajectory is None else _trajectory.staged(trajectory, staging),
            outage=windows(outages),
            seed=seed,
        )


def choose(
    recordings: StrPath | Table | Sequence[StrPath | Table | npt.ArrayLike],
    trajectory: AnyTrajectory,
    *,
    rate_hz: float | None = None,
    outages: Outages = None,
    estimator: Sequence[str] = (),
    model: Sequence[str] = (),
    filter: Sequence[str | int] = (),
    inflate: Sequence[str] = (),
    runs: int | None = None,
    trim: int | str | None = None,
    scenario: Settings | None = None,
    skip_s: float | str | None = None,
    gaps: str | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Choice:
    """Which estimator and model navigate best on one's own recordings, three or more: `nav-sim choose`.

    Each recording makes the errors of runs whose filters were calibrated on the others. `.model` is the winner's.
    """
    with Staging() as staging:
        return ask(
            Choice,
            "choose",
            staging,
            progress,
            inputs=staging.recordings(recordings, "recordings", None),
            trajectory=_trajectory.staged(trajectory, staging),
            outage=windows(outages),
            estimator=list(estimator),
            model=list(model),
            filter=[str(one) for one in filter],
            inflate=list(inflate),
            runs=runs,
            trim=None if trim is None else str(trim),
            scenario=None if scenario is None else staging.settings(scenario, "scenario"),
            recordings=reading(rate_hz, skip_s, None, None)["reading"],
            gaps=gaps,
            seed=seed,
        )


def compare(
    runs: StrPath | Sequence[StrPath],
    reference: StrPath,
    *,
    states: Sequence[str] = ("pos_e_m", "roll_deg"),
    progress: Progress = None,
) -> Answer:
    """Ratios of ASEE and RMSE between run directories, as `Run.write` and the command make them: `nav-sim compare`."""
    directories = [runs] if isinstance(runs, (str, os.PathLike)) else list(runs)
    request: dict[str, Any] = {"runs": [os.fspath(run) for run in directories], "reference": os.fspath(reference)}
    with Staging() as staging:
        return ask(Answer, "compare", staging, progress, **request, state=list(states))
