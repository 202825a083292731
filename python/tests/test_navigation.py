"""Runs, covariance analyses, fusions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import nav_sim
import numpy as np
import pytest
from conftest import CONSUMER, DRIVE, TACTICAL, Command, refused, table, without_times
from nav_sim import Model, NavSimError, Trajectory, fuse, judge, lincov, run

FILES = ["epochs.csv", "runs.csv"]


def test_a_run_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    words = "--runs 4 --outage 60:90 --outage 120:130.5 --seed 3 -q --format json -o"
    said = command("run", DRIVE, TACTICAL, words, tmp_path / "run").stdout
    own = run(DRIVE, TACTICAL, runs=4, outages=[(60, 90), (120, 130.5)], seed=3)
    assert without_times(own._native.json()) == without_times(said)
    for name in FILES:
        assert own.text(name) == (tmp_path / "run" / name).read_text(encoding="utf-8"), name
    own.write(tmp_path / "own")
    assert (tmp_path / "own" / "report.html").read_bytes() == (tmp_path / "run" / "report.html").read_bytes()
    manifests = [json.loads((tmp_path / place / "manifest.json").read_bytes()) for place in ("own", "run")]
    assert manifests[0]["key"] == manifests[1]["key"] and manifests[0]["outputs"].keys() == manifests[1]["outputs"].keys()
    assert own.verdict == own.data["verdict"]["kind"]


def test_the_tables_of_a_run(short: Path) -> None:
    own, again, other = (run(short, TACTICAL, runs=2, outages=[(20, 40)], seed=seed) for seed in (1, 1, 2))
    assert own.epochs["t_s"].dtype == np.float64 and len(own.epochs["t_s"]) == len(own.epochs["asee_pos_n_m"])
    assert own.outages["start_s"].tolist() == [20.0]
    assert own.outages["horizontal_error_end_m_p95"][0] == own.data["outages"][0]["horizontal_error_end_m"]["p95"]
    assert again._native.json() == own._native.json()
    assert other.outages["rmse_end_pos_e_m"][0] != own.outages["rmse_end_pos_e_m"][0]
    pyplot = pytest.importorskip("matplotlib.pyplot")
    assert len(own.plot().lines) == 2
    pyplot.close("all")


def test_covariance_analysis_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    words = ("--method lincov --filter full --outage 60:90 -q --format json --truth", CONSUMER, "-o", tmp_path / "run")
    own = lincov(DRIVE, TACTICAL, truth=CONSUMER, filter="full", outages=[(60, 90)])
    said = command("run", DRIVE, TACTICAL, *words, code=3).stdout
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
    assert "90" in str(refused("", lincov, short, TACTICAL, outages=[(90, 60)]))
    assert "--" not in str(refused("", lincov, short, TACTICAL, outages=[(6000, 6010)]))


def test_bounds_are_told(short: Path) -> None:
    own = lincov(short, TACTICAL, outages=[(20, 40)], require="p95_m<=0.001")
    assert own.unmet is not None and "p95_m" in own.unmet
    assert lincov(short, TACTICAL, outages=[(20, 40)], require=["p95_m<=1000"]).unmet is None


def test_wrong_trajectories_are_refused() -> None:
    refused("no/such", lincov, "no/such.toml", TACTICAL)
    path = {"t_s": [0.0, 1.0, np.nan], "lat_deg": [0.0] * 3, "lon_deg": [0.0] * 3, "h_m": [0.0] * 3}
    wrong = refused('trajectory, row 2: column "t_s"', lincov, path, TACTICAL)
    assert wrong.file == "trajectory" and wrong.line == 2


def test_a_fusion_is_that_of_the_command(drive: Path, command: Command, tmp_path: Path) -> None:
    files = (drive / "imu.csv", drive / "gnss.csv", TACTICAL)
    words = ("--outage 100:130 --smooth -q --format json --reference", drive / "reference.csv")
    said = command("fuse", *files, *words, "-o", tmp_path / "fused").stdout
    own = fuse(*files, reference=drive / "reference.csv", outages=[(100, 130)], smooth=True)
    assert json.loads(own._native.json()) == json.loads(said)
    for name in ("solution.csv", "innovations.csv", "errors.csv", "smoothed.csv", "solution.kml"):
        assert own.text(name) == (tmp_path / "fused" / name).read_text(encoding="utf-8"), name
    assert set(own.innovations["used"]) == {0.0, 1.0} and own.solution["t_s"].dtype == np.float64


def test_a_judgement_is_that_of_the_command(drive: Path, command: Command, tmp_path: Path) -> None:
    solution, reference = tmp_path / "fused" / "solution.csv", drive / "reference.csv"
    command("fuse", drive / "imu.csv", drive / "gnss.csv", TACTICAL, "-q -o", tmp_path / "fused")
    words = ("--outage 100:130 -q --format json --reference", reference)
    said = command("judge", solution, *words, "-o", tmp_path / "judged").stdout
    own = judge(solution, reference, outages=[(100, 130)])
    assert json.loads(own._native.json()) == json.loads(said)
    assert own.text("errors.csv") == (tmp_path / "judged" / "errors.csv").read_text(encoding="utf-8")
    columns = judge(table(solution), reference, outages=[(100, 130)])
    assert columns.verdict == own.verdict and len(columns.errors["t_s"]) == len(own.errors["t_s"])


def test_a_start_that_is_given(drive: Path, command: Command, tmp_path: Path) -> None:
    files = (drive / "imu.csv", drive / "gnss.csv", TACTICAL)
    said = command("fuse", *files, "--initial 90:5 -q --format json -o", tmp_path / "a", code=3).stdout
    wrong = fuse(*files, heading_deg=(90, 5))
    assert json.loads(wrong._native.json()) == json.loads(said) and wrong.unmet is not None
    said = command("fuse", *files, "--initial", drive / "initial.toml", "-q --format json -o", tmp_path / "b").stdout
    assert json.loads(fuse(*files, initial=drive / "initial.toml")._native.json()) == json.loads(said)


def test_a_fusion_of_arrays_is_that_of_files(drive: Path, tactical: Model) -> None:
    imu, gnss = table(drive / "imu.csv"), table(drive / "gnss.csv")
    own = fuse(imu, gnss, tactical, mounting=(0.0, 0.0, 0.0), heading_deg=None, lever_arm_m=np.zeros(3).tolist())
    files = fuse(drive / "imu.csv", drive / "gnss.csv", TACTICAL, mounting=(0.0, 0.0, 0.0))
    for key, values in files.solution.items():
        np.testing.assert_allclose(own.solution[key], values, rtol=1e-9, atol=1e-9, err_msg=key)


def test_horizontal_errors_have_columns(short: Path) -> None:
    own = lincov(short, TACTICAL, outages=[(20, 40)])
    for table, place in ((own.epochs, ""), (own.outages, "end_")):
        for name in ("asee", "rmse"):
            north, east = (table[f"{name}_{place}pos_{axis}_m"] for axis in "ne")
            np.testing.assert_array_equal(table[f"{name}_{place}horizontal_m"], np.hypot(north, east))


def frame(path: Path) -> Any:
    return pytest.importorskip("pandas").DataFrame(table(path))


def test_attitude_without_a_unit_is_not_guessed(short: Path) -> None:
    drive = frame(short)
    bare = drive.rename(columns=lambda name: name.replace("_deg", "") if name[0] in "rpy" else name)
    np.testing.assert_array_equal(Trajectory(bare).states()["yaw_deg"], Trajectory(drive).states()["yaw_deg"])
    angles = ["roll", "pitch", "yaw"]
    bare[angles] = np.radians(bare[angles])
    without_unit = str(refused("", lincov, bare, TACTICAL))
    assert "no unit in the name of roll, pitch, yaw" in without_unit and "_rad" in without_unit
    named = bare.rename(columns={name: f"{name}_rad" for name in angles})
    np.testing.assert_allclose(Trajectory(named).states()["yaw_deg"], Trajectory(drive).states()["yaw_deg"], atol=1e-9)


def test_a_frame_may_have_its_time_as_index_but_no_dates(short: Path) -> None:
    drive = frame(short)
    own = Trajectory(drive.set_index("t_s")).states()
    np.testing.assert_array_equal(own["lat_deg"], Trajectory(drive).states()["lat_deg"])
    with pytest.raises(NavSimError, match="t_s.*dates, and seconds are needed"):
        Trajectory(drive.assign(t_s=drive["t_s"].astype("datetime64[s]")))


def test_local_coordinates_ask_for_an_origin() -> None:
    path = {"t_s": np.arange(9.0), "n_m": np.arange(9.0), "e_m": np.arange(9.0), "d_m": np.zeros(9)}
    assert "Trajectory(…, origin=(lat_deg, lon_deg, h_m))" in str(refused("", lincov, path, TACTICAL))
    with pytest.warns(nav_sim.NavSimWarning, match="^trajectory: no attitude"):
        moved = Trajectory(path, origin=(46.5, 6.6, 400.0))
    assert moved.states()["lat_deg"][0] == pytest.approx(46.5, abs=1e-12)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"filter": 16}, 'filter=\'16\': "16" is not one of 15, 21, full'),
    ({"require": "p95<5"}, 'require=\'p95<5\': expected "consistent" or NAME'),
    ({"require": 5.0}, "require='5.0': expected"),
    ({"turn_on_bias": (1,)}, "turn_on_bias="),
    ({"turn_on_bias": ("a", 1.0)}, "turn_on_bias='a,1.0': expected two numbers"),
    ({"scenario": {"imu": {"rate": 1.0}}}, 'unknown key "imu.rate"'),
    ({"scenario": {"gnss": {"rate_hz": "x"}}}, '"gnss.rate_hz" = "x" is not a number'),
    ({"scenario": 3}, "scenario: a int is neither a path nor a dict"),
    ({"truth": 3}, "truth: a int is no path"),
    *(({"outages": wrong}, "outages=") for wrong in ((300, 390), 5, [(300, "x")], [(1, 2, 3)])),
    ({"progress": 3}, "progress=3"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG)
def test_a_wrong_argument_is_named(arguments: dict[str, Any], words: str) -> None:
    refused(words, lincov, DRIVE, TACTICAL, **arguments)


def test_threads_and_notebooks(short: Path) -> None:
    one, two = (nav_sim.run(short, TACTICAL, outages=[(20, 40)], runs=16, threads=n) for n in (1, 2))
    assert one.text("runs.csv") == two.text("runs.csv")
    assert one._repr_html_().startswith("<iframe srcdoc=")
    with pytest.raises(nav_sim.NavSimError, match="threads=0 is not a whole number"):
        nav_sim.run(short, TACTICAL, threads=0)
