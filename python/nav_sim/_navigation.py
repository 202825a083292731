"""INS/GNSS navigation: simulated, analysed, and of recorded data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from nav_sim import _model, _trajectory
from nav_sim._answer import Answer, Columns, Progress, ask, axes_or_new, flattened, windows
from nav_sim._errors import NavSimError
from nav_sim._inputs import Staging, StrPath, Table, number, numbers, settings
from nav_sim._model import Model
from nav_sim._trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Windows without fixes, as `run` has them.
Outages = Union[Sequence[tuple[float, float]], str, None]
#: A trajectory: a file, columns, or a `Trajectory`.
AnyTrajectory = Union[StrPath, Table, Trajectory]
#: A noise model: a file or a `Model`.
AnyModel = Union[StrPath, Model]
#: Settings: a file, or its tables as a dict.
Settings = Union[StrPath, Mapping[str, Any]]


class Run(Answer):
    """Errors of a navigation, by Monte Carlo or covariance analysis: `nav-sim run`.

    RMSE is the true error, ASEE (averaged standard estimation error) the filter's own standard deviation.
    """

    @cached_property
    def epochs(self) -> Columns:
        """Once a second, after the fix: `t_s`, `asee_…`, `rmse_…`, `bias_…` of each state, `nees`, `coverage`;
        `asee_horizontal_m` and `rmse_horizontal_m` are the roots of the sums of squares of north and east."""
        return _with_horizontal(self.table("epochs.csv"), "")

    @cached_property
    def runs(self) -> Columns:
        """Errors of each run at the ends of outages; of Monte Carlo only."""
        return self.table("runs.csv")

    @cached_property
    def outages(self) -> Columns:
        """A row an outage, before the fix that ends it: `start_s`, `end_s`, `asee_end_…` and `rmse_end_…` of each state
        (`rmse_end_pos_e_m`) and of the horizontal position (`asee_end_horizontal_m`), `horizontal_error_end_m_p95`, and
        more, as in `data`."""
        return _with_horizontal(flattened(self.data["outages"]), "end_")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the horizontal RMSE and ASEE over time; outages are grey."""
        ax = axes_or_new(ax)
        for name, label in (("rmse", "true (RMSE)"), ("asee", "stated (ASEE)")):
            ax.semilogy(self.epochs["t_s"], self.epochs[f"{name}_horizontal_m"], label=label)
        _shade(ax, self.outages)
        ax.set(xlabel="time (s)", ylabel="horizontal error (m)")
        ax.legend()
        return ax


def _with_horizontal(table: Columns, place: str) -> Columns:
    for name in ("asee", "rmse"):
        north, east = (table.get(f"{name}_{place}pos_{axis}_m") for axis in "ne")
        if north is not None and east is not None:
            table[f"{name}_{place}horizontal_m"] = np.hypot(north, east)
    return table


def _shade(ax: Axes, outages: Columns) -> None:
    for start_s, end_s in zip(outages.get("start_s", ()), outages.get("end_s", ())):
        ax.axvspan(start_s, end_s, color="0.9", zorder=0)


def run(
    trajectory: AnyTrajectory,
    model: AnyModel,
    *,
    truth: AnyModel | None = None,
    static: StrPath | Table | Sequence[StrPath | Table] | None = None,
    rate_hz: float | None = None,
    outages: Outages = None,
    runs: int | None = None,
    method: str | None = None,
    filter: str | int | None = None,
    turn_on_bias: tuple[float, float] | None = None,
    scale_ppm: tuple[float, float] | None = None,
    require: str | Sequence[str] | None = None,
    gnss: Settings | None = None,
    scenario: Settings | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Run:
    """Navigates by INS/GNSS along a trajectory with a noise model in the filter: `nav-sim run`.

    Parameters
    ----------
    trajectory
        A file, columns (`t_s`, `lat_deg`, `lon_deg`, `h_m`, …) or a `Trajectory`.
    model
        Noise model of the filter.
    truth
        Noise model of the true IMU, if another.
    static
        Recordings whose windows are the errors, as in `calibrate`; `rate_hz` where they have no time.
    outages
        Windows without fixes: pairs of start and end (s); [] or "none"; by default 300 to 390 s and 700 to 790 s.
    runs
        Runs of Monte Carlo (100).
    method
        "monte-carlo", "lincov" (no sampling) or "both".
    filter
        States: 15, 21 (and scale factors) or "full" (one for each process).
    turn_on_bias, scale_ppm
        Standard deviations that the filter expects: (accel, gyro) in (m/s², rad/s), ppm.
    require
        Limits such as "p95_m<=5" or "consistent"; see `.unmet`.
    gnss, scenario
        All other settings, by a file or as a dict: `scenario={"gnss": {"rate_hz": 5.0}}`; of `gnss` the section of
        that name.
    seed
        Of all random numbers; that of the scenario, or 1, without it.
    threads
        Threads that compute; by default one a core.
    progress
        True shows a bar; a function gets the runs done and all runs.
    """
    with Staging() as staging:
        recordings = None if static is None else staging.recordings(static, "static", None)
        return ask(
            Run,
            "run",
            staging,
            progress,
            threads,
            trajectory=_trajectory.staged(trajectory, staging),
            model=_model.staged(model, "model", staging),
            truth=None if truth is None else _model.staged(truth, "truth", staging),
            static=recordings,
            rate_hz=rate_hz,
            outage=windows(outages),
            runs=runs,
            filter=filter,
            turn_on_bias=turn_on_bias,
            scale_ppm=scale_ppm,
            method=method,
            require=require,
            gnss=settings(gnss, "gnss"),
            scenario=settings(scenario, "scenario"),
            seed=seed,
        )


def lincov(
    trajectory: AnyTrajectory,
    model: AnyModel,
    *,
    truth: AnyModel | None = None,
    outages: Outages = None,
    filter: str | int | None = None,
    turn_on_bias: tuple[float, float] | None = None,
    scale_ppm: tuple[float, float] | None = None,
    require: str | Sequence[str] | None = None,
    gnss: Settings | None = None,
    scenario: Settings | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Run:
    """Expected errors by covariance analysis: `nav-sim run --method lincov`.

    `trajectory`, `model`, `truth`, `outages`, `filter`, `turn_on_bias`, `scale_ppm`, `require`, `gnss`, `scenario`,
    `threads` and `progress` as of `run`. RMSE is the expected true error; `.runs` is empty.
    """
    return run(
        trajectory,
        model,
        truth=truth,
        outages=outages,
        method="lincov",
        filter=filter,
        turn_on_bias=turn_on_bias,
        scale_ppm=scale_ppm,
        require=require,
        gnss=gnss,
        scenario=scenario,
        threads=threads,
        progress=progress,
    )


class Fusion(Answer):
    """The filter on recorded data: `nav-sim fuse`."""

    @cached_property
    def solution(self) -> Columns:
        """`t_s`, `lat_deg`, `lon_deg`, `h_m`, velocity, attitude, biases, and their standard deviations `sd_…`."""
        return self.table("solution.csv")

    @cached_property
    def smoothed(self) -> Columns:
        """The same, of all fixes; with `smooth=True`."""
        return self.table("smoothed.csv")

    @cached_property
    def innovations(self) -> Columns:
        """Each fix: innovation, standard deviation, used or not."""
        return self.table("innovations.csv")

    @cached_property
    def errors(self) -> Columns:
        """Differences from the reference, with `reference=`."""
        return self.table("errors.csv")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the way: longitude and latitude."""
        return _trajectory.way(axes_or_new(ax), self.solution)


#: Attitude of the IMU in the vehicle: "flu", "rfu", "auto", angles (°), or angles and standard deviations (°).
Mounting = Union[str, Sequence[float], tuple[Sequence[float], Sequence[float]]]


def fuse(
    imu: StrPath | Table,
    gnss: StrPath | Table,
    model: AnyModel,
    *,
    initial: Settings = "auto",
    lever_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
    heading_deg: tuple[float, float] | None = None,
    mounting: Mounting | None = None,
    reference: AnyTrajectory | None = None,
    outages: Sequence[tuple[float, float]] = (),
    filter: str | int = 15,
    turn_on_bias: tuple[float, float] | None = None,
    gnss_sigma: float | Mapping[str, Any] | None = None,
    gnss_delay_s: float = 0.0,
    gnss_correlation: str | float = "auto",
    gate: str | float = 0.9999,
    nhc: bool = False,
    zupt: bool = False,
    odometer: StrPath | Table | None = None,
    rear_axle_m: Sequence[float] = (0.0, 0.0, 0.0),
    topic: tuple[str | None, str | None] | None = None,
    smooth: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Fusion:
    """Fuses recorded IMU and GNSS data: `nav-sim fuse`.

    Parameters
    ----------
    imu
        A file, or columns: `t_s`, and rates `gyro_x_rad_s` … `accel_z_m_s2` or increments `dtheta_x_rad` … `dv_z_m_s`.
    gnss
        A file, or columns: `t_s`, `lat_deg`, `lon_deg`, `h_m`, `sd_n_m`, `sd_e_m`, `sd_d_m`, and velocities `v_n_m_s`
        … with `sd_vn_m_s` ….
    model
        Noise model of the filter.
    initial
        Initial state: a file, a dict or "auto" (level from the IMU, heading from the course).
    lever_arm_m
        The antenna from the IMU: front, right, down (m).
    heading_deg
        Initial heading and its standard deviation (°).
    mounting
        "flu", "rfu", "auto" (from the drive), angles (roll, pitch, yaw) (°), or a pair of angles and standard deviations.
    reference
        A trajectory to compare with.
    outages
        Windows in which fixes are withheld, on the clock of the data (s).
    gnss_sigma
        A factor on the stated standard deviations, or {"pos_m": [n, e, d], "vel_m_s": [n, e, d]} where none are stated.
    gnss_delay_s
        Delay of the fixes (s).
    gnss_correlation
        Correlation time of the fixes' errors: "auto", "none", or seconds.
    gate
        Level of the chi-square test of fixes, or "none".
    nhc
        Road vehicle: its rear axle moves neither sideways nor up.
    zupt
        Zero-velocity updates at standstill.
    odometer
        Speed of a wheel: a file, or columns `t_s` and `wheel_m_s`.
    rear_axle_m
        Middle of the rear axle from the IMU: front, right, down (m).
    topic
        Topics of IMU and fixes in a log that has several.
    filter, turn_on_bias, threads, progress
        As of `run`.
    smooth
        Also estimate every row from all fixes.
    """
    with Staging() as staging:
        if heading_deg is not None:
            deg, sigma_deg = numbers(heading_deg, "heading_deg", 2)
            initial = f"{deg!r}:{sigma_deg!r}"
        return ask(
            Fusion,
            "fuse",
            staging,
            progress,
            threads,
            imu=staging.columns(imu, "imu"),
            gnss=staging.table(gnss, "gnss"),
            model=_model.staged(model, "model", staging),
            initial=staging.settings(initial, "initial"),
            lever_arm_m=numbers(lever_arm_m, "lever_arm_m", 3),
            mounting=_mounting(mounting),
            reference=None if reference is None else _trajectory.staged(reference, staging, "reference"),
            outage=windows(outages) if len(outages) else None,
            filter=filter,
            turn_on_bias=turn_on_bias,
            gnss_sigma=_sigma(gnss_sigma),
            gnss_delay_s=gnss_delay_s,
            gnss_correlation=gnss_correlation,
            gate=gate,
            nhc=nhc,
            zupt=zupt,
            odometer=None if odometer is None else staging.table(odometer, "odometer"),
            rear_axle_m=[float(x) for x in rear_axle_m],
            topic=_topics(topic),
            smooth=smooth,
        )


class Judgement(Answer):
    """A solution against a reference: `nav-sim judge`."""

    @cached_property
    def errors(self) -> Columns:
        """`t_s`, errors `err_…`, standard deviations `sd_…`, `nees`."""
        return self.table("errors.csv")


def judge(
    solution: StrPath | Table,
    reference: AnyTrajectory,
    *,
    covariance: StrPath | None = None,
    outages: Sequence[tuple[float, float]] = (),
    reference_delay_s: float = 0.0,
    reference_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
    origin: tuple[float, float, float] | None = None,
    threads: int | None = None,
) -> Judgement:
    """Tests the consistency of any filter's solution: `nav-sim judge`.

    Parameters
    ----------
    solution
        A file, or columns: `t_s`, `lat_deg`, `lon_deg`, `h_m`, velocities and attitude, with standard deviations
        `sd_n_m` … `sd_yaw_deg`.
    reference
        A file, columns or a `Trajectory`.
    covariance
        File of standard deviations or covariances.
    outages
        Windows in which the solution had no fixes (s).
    reference_delay_s, reference_arm_m
        Delay of the reference (s); its point from that of the solution: front, right, down (m).
    origin
        Latitude, longitude (°) and height (m) of local coordinates.
    threads
        As of `run`.
    """
    with Staging() as staging:
        return ask(
            Judgement,
            "judge",
            staging,
            None,
            threads,
            solution=staging.table(solution, "solution"),
            reference=_trajectory.staged(reference, staging, "reference"),
            covariance=None if covariance is None else staging.table(covariance, "covariance"),
            outage=windows(outages) if len(outages) else None,
            reference_delay=reference_delay_s,
            reference_arm=numbers(reference_arm_m, "reference_arm_m", 3),
            origin=None if origin is None else _joined(origin),
        )


def _joined(values: Any) -> str:
    return ",".join(repr(float(value)) for value in values)


def _topics(topic: tuple[str | None, str | None] | None) -> Any:
    if topic is None:
        return None
    if not isinstance(topic, (list, tuple)) or len(topic) != 2:
        raise NavSimError(f"topic={topic!r}: not a pair of names, of the IMU and of the fixes")
    return ",".join(name or "" for name in topic)


def _mounting(mounting: Mounting | None) -> Any:
    if mounting is None or isinstance(mounting, str):
        return mounting
    try:
        angles: Any = np.asarray(mounting, dtype=np.float64)
    except (TypeError, ValueError):
        raise NavSimError(f"mounting={mounting!r} is neither a text nor angles") from None
    if angles.shape not in ((3,), (2, 3)):
        raise NavSimError("mounting: roll, pitch, yaw (°), and three standard deviations where known")
    both = angles if angles.ndim == 2 else np.stack([angles, np.ones(3)])
    return ":".join(map(_joined, both))


def _sigma(sigma: float | Mapping[str, Any] | None) -> Any:
    if sigma is None:
        return None
    if isinstance(sigma, Mapping):
        keys = sorted(sigma)
        if keys not in (["pos_m"], ["pos_m", "vel_m_s"]):
            raise NavSimError(f"gnss_sigma={sigma!r}: not pos_m, or pos_m and vel_m_s")
        return ":".join(_joined(np.broadcast_to(sigma[key], 3)) for key in keys)
    return f"x{number(sigma, 'gnss_sigma')!r}"
