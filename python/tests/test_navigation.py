"""Runs, covariance analyses, fusions."""

from __future__ import annotations

import json
from pathlib import Path

import nav_sim
import numpy as np
import pytest
from conftest import CONSUMER, DRIVE, TACTICAL, Command, table, without_times
from nav_sim import Model, NavSimError, Trajectory, fuse, lincov, run

FILES = ["epochs.csv", "fan.csv", "runs.csv"]


def test_a_run_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    words = ("--runs", 4, "--outage", "60:90", "--outage", "120:130.5", "--seed", 3, "-q", "-o", tmp_path / "run")
    said = command("run", DRIVE, TACTICAL, *words, "--format", "json").stdout
    own = run(DRIVE, TACTICAL, runs=4, outages=[(60, 90), (120, 130.5)], seed=3)
    assert without_times(own._native.json()) == without_times(said)
    for name in FILES:
        assert own.text(name) == (tmp_path / "run" / name).read_text(encoding="utf-8"), name
    own.to_html(tmp_path / "own.html")
    assert (tmp_path / "own.html").read_bytes() == (tmp_path / "run" / "report.html").read_bytes()
    assert own.verdict == own.data["verdict"]["kind"]


def test_the_tables_of_a_run(short: Path) -> None:
    own = run(short, TACTICAL, runs=2, outages=[(20, 40)])
    assert own.epochs["t_s"].dtype == np.float64 and len(own.epochs["t_s"]) == len(own.epochs["asee_pos_n_m"])
    assert own.outages["start_s"].tolist() == [20.0]
    assert own.outages["horizontal_error_end_m_p95"][0] == own.data["outages"][0]["horizontal_error_end_m"]["p95"]
    again = run(short, TACTICAL, runs=2, outages=[(20, 40)])
    assert again._native.json() == own._native.json()
    other = run(short, TACTICAL, runs=2, outages=[(20, 40)], seed=2)
    assert other.outages["rmse_end_pos_e_m"][0] != own.outages["rmse_end_pos_e_m"][0]
    pyplot = pytest.importorskip("matplotlib.pyplot")
    assert len(own.plot().lines) == 2
    pyplot.close("all")


def test_covariance_analysis_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    words = ("--method", "lincov", "--truth", CONSUMER, "--filter", "full", "--outage", "60:90", "-q")
    own = lincov(DRIVE, TACTICAL, truth=CONSUMER, filter="full", outages=[(60, 90)])
    said = command("run", DRIVE, TACTICAL, *words, "--format", "json", "-o", tmp_path / "run", code=3).stdout
    assert without_times(own._native.json()) == without_times(said)
    assert own.unmet is not None and own.verdict == "overconfident"


def test_models_trajectories_and_settings_in_memory_are_those_of_files(
    short: Path, tactical: Model, tmp_path: Path
) -> None:
    (tmp_path / "scenario.toml").write_text(
        "[imu]\nscale_ppm_gyro = 300\n[gnss]\npos_sigma_m = [1.0, 1.5, 3.0]\n[[outage]]\nstart_s = 20\nend_s = 40.0\n",
        encoding="utf-8",
    )
    settings = {
        "imu": {"scale_ppm_gyro": 300},
        "gnss": {"pos_sigma_m": np.array([1.0, 1.5, 3.0])},
        "outage": [{"start_s": 20.0, "end_s": np.float64(40.0)}],
    }
    with pytest.warns(nav_sim.NavSimWarning, match="scale"):
        own = lincov(Trajectory(short), Model.from_toml(tactical.to_toml()), scenario=settings)
    with pytest.warns(nav_sim.NavSimWarning, match="scale"):
        of_files = lincov(short, TACTICAL, scenario=tmp_path / "scenario.toml")
    for key, values in own.epochs.items():
        np.testing.assert_array_equal(values, of_files.epochs[key], err_msg=key)


def test_outages_none_and_wrong(short: Path) -> None:
    assert lincov(short, TACTICAL, outages=[]).data["outages"] == []
    assert lincov(short, TACTICAL, outages="none").data["outages"] == []
    with pytest.raises(NavSimError, match="90"):
        lincov(short, TACTICAL, outages=[(90, 60)])
    with pytest.raises(NavSimError) as refused:
        lincov(short, TACTICAL, outages=[(6000, 6010)])
    assert "--" not in str(refused.value)


def test_bounds_are_told(short: Path) -> None:
    own = lincov(short, TACTICAL, outages=[(20, 40)], require="p95_m<=0.001")
    assert own.unmet is not None and "p95_m" in own.unmet
    assert lincov(short, TACTICAL, outages=[(20, 40)], require=["p95_m<=1000"]).unmet is None


def test_wrong_arguments_are_refused() -> None:
    for arguments in (
        {"filter": 16},
        {"require": "p95<5"},
        {"scenario": {"imu": {"rate": 1.0}}},
        {"turn_on_bias": (1,)},
    ):
        with pytest.raises(NavSimError):
            lincov(DRIVE, TACTICAL, **arguments)
    with pytest.raises(NavSimError, match="no/such"):
        lincov("no/such.toml", TACTICAL)
    with pytest.raises(NavSimError) as refused:
        lincov({"t_s": [0.0, 1.0, np.nan], "lat_deg": [0.0] * 3, "lon_deg": [0.0] * 3, "h_m": [0.0] * 3}, TACTICAL)
    assert refused.value.file == "trajectory.csv" and refused.value.line == 4


def test_a_fusion_is_that_of_the_command(drive: Path, command: Command, tmp_path: Path) -> None:
    files = (drive / "imu.csv", drive / "gnss.csv", TACTICAL)
    words = ("--reference", drive / "reference.csv", "--outage", "100:130", "--smooth", "-q")
    said = command("fuse", *files, *words, "--format", "json", "-o", tmp_path / "fused").stdout
    own = fuse(*files, reference=drive / "reference.csv", outages=[(100, 130)], smooth=True)
    assert json.loads(own._native.json()) == json.loads(said)
    for name in ("solution.csv", "innovations.csv", "errors.csv", "smoothed.csv", "solution.kml"):
        assert own.text(name) == (tmp_path / "fused" / name).read_text(encoding="utf-8"), name
    assert own.innovations["status"].dtype.kind == "U" and own.solution["t_s"].dtype == np.float64


def test_a_start_that_is_given(drive: Path, command: Command, tmp_path: Path) -> None:
    files = (drive / "imu.csv", drive / "gnss.csv", TACTICAL)
    said = command("fuse", *files, "--initial", "90:5", "-q", "--format", "json", "-o", tmp_path / "a", code=3).stdout
    wrong = fuse(*files, heading_deg=(90, 5))
    assert json.loads(wrong._native.json()) == json.loads(said) and wrong.unmet is not None
    said = command(
        "fuse", *files, "--initial", drive / "initial.toml", "-q", "--format", "json", "-o", tmp_path / "b"
    ).stdout
    assert json.loads(fuse(*files, initial=drive / "initial.toml")._native.json()) == json.loads(said)


def test_a_fusion_of_arrays_is_that_of_files(drive: Path, tactical: Model) -> None:
    imu, gnss = table(drive / "imu.csv"), table(drive / "gnss.csv")
    own = fuse(imu, gnss, tactical, mounting=(0.0, 0.0, 0.0), heading_deg=None, lever_arm_m=np.zeros(3).tolist())
    files = fuse(drive / "imu.csv", drive / "gnss.csv", TACTICAL, mounting=(0.0, 0.0, 0.0))
    for key, values in files.solution.items():
        np.testing.assert_allclose(own.solution[key], values, rtol=1e-9, atol=1e-9, err_msg=key)


def test_outages_that_are_no_pairs_are_named() -> None:
    for wrong in [(300, 390), 5, [(300, "x")]]:
        with pytest.raises(NavSimError, match="not pairs of start and end"):
            lincov(DRIVE, TACTICAL, outages=wrong)  # type: ignore[arg-type]
