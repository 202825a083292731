"""Noise models and trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nav_sim
import numpy as np
import pytest
from conftest import CONSUMER, DRIVE, ROOT, TACTICAL, Command, refused, table
from nav_sim import Model, NavSimError, NavSimWarning, Trajectory


def white_and_walk() -> Model:
    return Model(100.0, gyro=[{"type": "WN", "sigma2": 1e-6}, {"type": "RW", "gamma2": 1e-12}])


def test_a_model_of_processes() -> None:
    model = white_and_walk()
    assert model.channels == ["gyro.x", "gyro.y", "gyro.z"]
    assert model.processes["gyro.y"] == [{"type": "WN", "sigma2": 1e-6}, {"type": "RW", "gamma2": 1e-12}]
    by_axis = Model(100.0, accel={"x": [{"type": "QN", "q2": 1e-7}]})
    assert by_axis.channels == ["accel.x"]
    both = model + by_axis
    assert both.channels == ["accel.x", *model.channels] and both != model
    assert Model.from_toml(both.to_toml()) == both
    with pytest.raises(NavSimError, match="50"):
        model + Model(50.0, gyro=[{"type": "WN", "sigma2": 1.0}])


def test_a_model_file_comes_back_as_it_was(tmp_path: Path) -> None:
    model = Model.read(CONSUMER)
    assert Model.read(model.write(tmp_path / "m.toml")) == model
    assert (tmp_path / "m.toml").read_text(encoding="utf-8") == CONSUMER.read_text(encoding="utf-8")


def test_what_is_no_model_is_refused() -> None:
    refused("no/such", Model.read, "no/such.toml")
    for processes in ([{"type": "XX"}], [{"type": "WN", "sigma2": -1.0}], None):
        refused("", Model, 100.0, processes)
    refused("", Model, -1.0, [], [])
    assert refused("", Model.from_toml, "schema = 1\nrate_hz = 100.0\n[gyro]\nprocesses = 3\n").line == 4


@pytest.mark.parametrize("contaminate", [None, "section5-III"])
def test_a_recording_is_that_of_the_command(contaminate: str | None, command: Command, tmp_path: Path) -> None:
    corrupts = f"--contaminate {contaminate}" if contaminate else "-q"
    words = "--replicates 2 --samples 60000 --spread --seed 7 -o"
    command("synthesize", CONSUMER, corrupts, words, tmp_path / "static")
    own = Model.read(CONSUMER).synthesize(samples=60000, replicate=2, seed=7, spread=True, contaminate=contaminate)
    # the file has ten digits
    for name, values in table(tmp_path / "static" / "replicate_2.csv").items():
        if name != "t_s":
            np.testing.assert_allclose(own[name], values, rtol=6e-10, err_msg=name)


def test_the_length_of_a_recording() -> None:
    assert len(Model.read(TACTICAL).synthesize(duration_s=2.0)["gyro_x_rad_s"]) == 200
    for arguments in ({}, {"samples": 0}, {"samples": 5, "duration_s": 1.0}, {"samples": 5, "seed": -1}):
        refused("", white_and_walk().synthesize, **arguments)


def test_the_curves_of_white_noise_and_a_walk() -> None:
    # white noise sigma²/tau; random walk gamma² (tau² + 2)/(12 tau) with tau samples (the Haar filter's variance)
    tau = 2.0 * np.arange(1, 7)
    wv = 1e-6 / tau + 1e-12 * (tau**2 + 2.0) / (12.0 * tau)
    curve = white_and_walk().wavelet_variance(tau / 100.0)
    np.testing.assert_allclose(curve["gyro.x"], wv, rtol=1e-12)
    np.testing.assert_allclose(curve["tau_s"], tau / 100.0)
    adev = white_and_walk().allan_deviation(tau / 200.0)
    np.testing.assert_allclose(adev["gyro.z"], np.sqrt(2.0 * wv), rtol=1e-12)
    refused("tau_s", white_and_walk().allan_deviation, tau_s=[0.001])


def test_practical_figures_are_those_of_the_processes() -> None:
    # N = sigma sqrt(dt), K = gamma sqrt(f) (IEEE 952)
    figures = white_and_walk().practical("strict")["gyro"]
    assert figures["density_rad_s_per_sqrt_hz"] == pytest.approx(1e-3 / np.sqrt(100.0))
    assert figures["walk_rad_s2_per_sqrt_hz"] == pytest.approx(1e-6 * np.sqrt(100.0))
    with pytest.raises(NavSimError, match="policy"):
        white_and_walk().practical("loose")


def test_an_export_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    for target in ("kalibr", "px4", "kf-gins"):
        command("export", TACTICAL, "--force -q --target", target, "-o", tmp_path / "out")
        Model.read(TACTICAL).export(target, tmp_path / "own")
        assert (tmp_path / "own").read_bytes() == (tmp_path / "out").read_bytes(), target
    with pytest.raises(NavSimError, match="target"):
        Model.read(TACTICAL).export("abacus")
    with pytest.raises(NavSimError, match="accel"):
        white_and_walk().export("kalibr")


def test_a_trajectory_of_columns(tmp_path: Path) -> None:
    t_s = np.arange(0.0, 20.0, 0.5)
    line = {"t_s": t_s, "n_m": 10.0 * t_s, "e_m": 0.0 * t_s, "d_m": 0.0 * t_s}
    with pytest.warns(NavSimWarning, match="no attitude"):
        way = Trajectory(line, origin=(45.0, 7.0, 200.0))
    states = way.states(2.0)
    # due north at 10 m/s, without attitude in the columns: the heading is that of the path
    np.testing.assert_allclose(states["v_n_m_s"], 10.0, rtol=1e-4)
    np.testing.assert_allclose(states["yaw_deg"], 0.0, atol=1e-3)
    assert (way.start_s, states["lat_deg"][0], states["h_m"][0]) == (0.0, pytest.approx(45.0), pytest.approx(200.0))
    with pytest.warns(NavSimWarning, match="no attitude"):
        again = Trajectory(way.write(tmp_path / "way.csv"))
    np.testing.assert_array_equal(again.states()["lat_deg"], way.states()["lat_deg"])


def test_a_trajectory_of_a_file() -> None:
    way = Trajectory(str(DRIVE))
    assert way.end_s > 100.0 and "figure_eight" in repr(way)
    pyplot = pytest.importorskip("matplotlib.pyplot")
    way.plot()
    pyplot.close("all")
    for wrong in ("no/such.toml", {"t_s": [0.0]}, {}, 5):
        refused("", Trajectory, wrong)
    with pytest.raises(NavSimError, match="rate_hz"):
        way.states(-1.0)


@pytest.mark.filterwarnings("ignore::nav_sim.NavSimWarning")
def test_a_data_sheet_is_that_of_the_command(command: Command, tmp_path: Path) -> None:
    command("datasheet", "--unit stim300 --rate-hz 200 --corr-time", "1000 s", "-o", tmp_path / "m.toml")
    own = Model.from_datasheet("stim300", rate_hz=200.0, corr_time="1000 s")
    entry = ROOT / "calib_data" / "catalogue" / "stim300.toml"
    of_entry = Model.from_datasheet(entry=entry, rate_hz=200.0, corr_time="1000 s")
    assert own.to_toml() == of_entry.to_toml() == (tmp_path / "m.toml").read_text(encoding="utf-8")
    units = nav_sim.catalogue()
    assert "stim300" in units["unit"] and len(units["given"]) == len(units["source"])


def test_a_density_is_that_of_the_sheet() -> None:
    with pytest.warns(nav_sim.NavSimWarning) as told:
        model = Model.from_datasheet(arw="0.15 deg/sqrt(h)", rate_hz=100.0)
    assert any("(gyro_bias=)" in str(warning.message) for warning in told)
    # sigma2 = N² rate: 0.15°/60/√s, squared, times 100 Hz
    assert model.processes["gyro.x"] == [{"type": "WN", "sigma2": pytest.approx((np.radians(0.15) / 60.0) ** 2 * 100.0)}]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "no figure gives"),
        ({"unit": "stim301"}, "unit= stim301"),
        ({"arw": "0.15 m"}, "arw='0.15 m': has the unit m"),
        ({"arw": 0.15}, "arw='0.15': has no unit"),
        ({"entry": {"unit": {"manufacturer": "a"}}}, "entry: "),
    ],
)
def test_what_is_no_data_sheet_is_refused(arguments: dict[str, Any], words: str) -> None:
    refused(words, Model.from_datasheet, **arguments)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (5, "gyro=5 is not a list of processes"),
        ([5], '"gyro.processes" = 5 is not a table'),
        ([{"type": "WN", "sigma2": "x"}], '"gyro.processes[1].sigma2" = "x" is not a number'),
    ],
)
def test_what_is_no_process_is_refused(given: Any, words: str) -> None:
    refused(words, Model, 100.0, gyro=given)
    assert Model(100.0, gyro={"type": "WN", "sigma2": 1.0}) == Model(100.0, gyro=[{"type": "WN", "sigma2": 1.0}])


@pytest.mark.filterwarnings("ignore::nav_sim.NavSimWarning")
def test_figures_of_imu_utils_need_the_rate_and_are_per_sample(tmp_path: Path) -> None:
    file = tmp_path / "imu.yaml"
    file.write_text('%YAML:1.0\nGyr:\n   unit: " rad/s"\n   avg-axis:\n      gyr_n: 2e-3\n      gyr_w: 3e-5\n')
    without_rate = refused("", Model.from_datasheet, measured=file)
    assert without_rate.line == 5 and "rate_hz=" in (without_rate.hint or ""), without_rate
    model = Model.from_datasheet(measured=file, rate_hz=400.0, gyro_rrw="2 deg/h/sqrt(h)")
    processes = model.processes["gyro.x"]
    assert model.rate_hz == 400.0
    # a sample has the variance that the file states; K²/rate is the variance of an increment
    assert processes[0] == {"type": "WN", "sigma2": pytest.approx(4e-6)}
    assert processes[-1] == {"type": "RW", "gamma2": pytest.approx(np.radians(2.0 / 3600.0 / 60.0) ** 2 / 400.0)}
