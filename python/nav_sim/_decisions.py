"""Decisions: tune, require, design, choose, compare."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from nav_sim import _model, _trajectory
from nav_sim._answer import Answer, Progress, ask, window, windows
from nav_sim._inputs import Staging, StrPath, number, path, settings
from nav_sim._model import Model
from nav_sim._navigation import AnyModel, AnyTrajectory, Outages, Settings
from nav_sim._wavelet import Recordings, reading


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
    trajectory: AnyTrajectory | None = None,
    outages: Outages = None,
    aim: str | None = None,
    filter: str | int | None = None,
    scenario: Settings | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Choice:
    """Smallest factors on a model that make its filter consistent with other truths: `nav-sim tune`.

    `truth` are models of the true IMU, such as those of single recordings; by default the model with the errors of the
    scenario. `aim` is "worst" or "mean" (--for). Without a `trajectory` a built-in drive is used;
    `outages`, `filter`, `scenario`, `seed`, `threads` and `progress` as of `run`. `.model` is the tuned one.
    """
    truths = truth or [] if isinstance(truth, (list, tuple, type(None))) else [truth]
    with Staging() as staging:
        return ask(
            Choice,
            "tune",
            staging,
            progress,
            threads,
            model=_model.staged(model, "model", staging),
            truth=[_model.staged(one, f"truth[{k}]", staging) for k, one in enumerate(truths)],
            trajectory=None if trajectory is None else _trajectory.staged(trajectory, staging),
            outage=windows(outages),
            filter=filter,
            scenario=settings(scenario, "scenario"),
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
    vehicle: str | None = None,
    catalogue: StrPath | bool | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Choice:
    """The IMU that keeps the errors at the end of an outage of a trajectory within limits: `nav-sim require`.

    A given `model` is judged; else `.model` is the required one. `outage` is a length (s), a pair of start and end, or
    "longest"; `start` the earliest start (s); `limits` such as "p95_m<=5"; `catalogue=True` ranks the catalogued IMUs, a path those of a
    directory; `vehicle="car"` adds its motion constraints. `gnss`, `scenario`, `threads`, `progress` as of `run`.
    """
    asked = outage if isinstance(outage, str) else _window(outage)
    with Staging() as staging:
        return ask(
            Choice,
            "require",
            staging,
            progress,
            threads,
            trajectory=_trajectory.staged(trajectory, staging),
            model=None if model is None else _model.staged(model, "model", staging),
            outage=asked,
            require=limits,
            start=start,
            gnss=settings(gnss, "gnss"),
            scenario=settings(scenario, "scenario"),
            vehicle=vehicle,
            catalogue=_catalogue(catalogue),
        )


def _window(outage: float | tuple[float, float]) -> str:
    return window(outage, "outage") if isinstance(outage, (list, tuple)) else repr(number(outage, "outage"))


def _catalogue(catalogue: StrPath | bool | None) -> str | None:
    if isinstance(catalogue, bool):
        return "built-in" if catalogue else None
    return None if catalogue is None else path(catalogue, "catalogue")


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
    threads: int | None = None,
    progress: Progress = None,
) -> Answer:
    """Expected intervals of planned calibrations of a model: `nav-sim design`.

    Several `recordings` (number) and `hours` (each) by default; `draws` are simulated. With `trajectory` their effect
    there; `estimator` as of `calibrate`, `outages`, `seed`, `threads`, `progress` of `run`.
    """
    with Staging() as staging:
        return ask(
            Answer,
            "design",
            staging,
            progress,
            threads,
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
    recordings: Recordings,
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
    skip_s: float | None = None,
    gaps: str | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Choice:
    """Ranks estimators and models along a trajectory from three or more recordings: `nav-sim choose`.

    Each recording is the truth of runs whose filters were calibrated on the others. `.model` is the winner's.
    `estimator`, `model`, `filter` and `inflate` ("none", "x10") list the candidates; `rate_hz`, `trim`, `skip_s`
    and `gaps` are as of `calibrate`, `outages`, `runs`, `scenario`, `seed`, `threads` and `progress` as of `run`.
    """
    with Staging() as staging:
        return ask(
            Choice,
            "choose",
            staging,
            progress,
            threads,
            recording=staging.recordings(recordings, "recordings", None),
            trajectory=_trajectory.staged(trajectory, staging),
            outage=windows(outages),
            estimator=estimator,
            model=model,
            filter=filter,
            inflate=inflate,
            runs=runs,
            trim=trim,
            scenario=settings(scenario, "scenario"),
            **reading(rate_hz, skip_s, gaps, None),
            seed=seed,
        )


def compare(
    runs: StrPath | Sequence[StrPath],
    reference: StrPath,
    *,
    states: Sequence[str] = ("pos_e_m", "roll_deg"),
    threads: int | None = None,
    progress: Progress = None,
) -> Answer:
    """Ratios of ASEE and RMSE between run directories, as `Run.write` and the command make them: `nav-sim compare`.

    Each of `runs` is divided by the `reference`; `states` are those of the answer's table; `threads` and `progress` as of `run`.
    """
    directories = runs if isinstance(runs, (list, tuple)) else [runs]
    request: dict[str, Any] = {"runs": [path(run, "runs") for run in directories], "reference": path(reference, "reference")}
    with Staging() as staging:
        return ask(Answer, "compare", staging, progress, threads, **request, state=states)
