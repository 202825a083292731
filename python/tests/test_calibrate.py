"""Calibrations."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import nav_sim
import numpy as np
import pytest
from conftest import DRIVE, Command, refused, table, without_times
from nav_sim import Model, calibrate

USUAL: dict[str, Any] = {"model": "AR1+RW+WN", "bootstrap": 20}


def test_it_answers_as_the_command(recordings: Path, command: Command, tmp_path: Path) -> None:
    words = "--model AR1+RW+WN --bootstrap 20 --seed 1 -q --format json -o"
    said = command("calibrate", recordings, words, tmp_path / "model.toml").stdout
    fit = calibrate(recordings, **USUAL)
    assert without_times(fit._native.json()) == without_times(said)
    assert fit.files == ["model.draws.json", "model.wv.json", "model.toml", "model.html", "model.svg"]
    for name in fit.files:
        assert fit.text(name) == (tmp_path / name).read_text(encoding="utf-8"), name
    fit.write(tmp_path / "own")
    assert (tmp_path / "own" / "model.toml").read_bytes() == (tmp_path / "model.toml").read_bytes()


def test_arrays_tables_and_files_are_the_same(recordings: Path) -> None:
    paths = sorted(recordings.glob("replicate_*.csv"))
    tables = [table(path) for path in paths]
    arrays = [np.stack([columns[name] for name in columns if name != "t_s"], axis=1) for columns in tables]
    frames = [pytest.importorskip("pandas").DataFrame(columns) for columns in tables]
    polars = [pytest.importorskip("polars").DataFrame(columns) for columns in tables]
    kinds = np.dtype([(name, float) for name in tables[0]])
    structured = [np.array(list(zip(*columns.values())), dtype=kinds) for columns in tables]
    wanted = calibrate(paths, **USUAL).parameters["value"]
    for given in (tables, frames, polars, structured):
        np.testing.assert_array_equal(calibrate(given, **USUAL).parameters["value"], wanted)
    np.testing.assert_array_equal(calibrate(arrays, rate_hz=100.0, **USUAL).parameters["value"], wanted)


def test_a_single_signal() -> None:
    # white noise of variance 4e-6: 65536 samples know it to sqrt(2/65536) = 0.55 %; five deviations
    x = 2e-3 * np.random.default_rng(1).standard_normal(65536)
    fit = calibrate(x, rate_hz=200.0, axes="gyro.z", estimator="gmwm", model="WN", bootstrap=0)
    assert fit.model.channels == ["gyro.z"]
    assert fit.parameters["value"][0] == pytest.approx(4e-6, rel=0.028)
    assert fit.parameters["unit"][0] == "(rad/s)²"
    assert fit.model.rate_hz == 200.0


def test_parameters_curves_and_model(recordings: Path) -> None:
    fit = calibrate(recordings, **USUAL)
    rows = list(zip(fit.parameters["sensor"], fit.parameters["process"], fit.parameters["parameter"]))
    assert ("gyro", "AR1", "phi") in rows and ("accel", "WN", "sigma2") in rows
    assert [p["type"] for p in fit.model.processes["gyro.x"]] == ["WN", "AR1", "RW"]
    assert fit.model == Model.from_toml(fit.text("model.toml"))
    curve = fit.curves[0]
    assert len(curve["tau_s"]) == len(curve["implied"]) == len(curve["wv"])
    assert fit.verdict and fit.summary()
    pyplot = pytest.importorskip("matplotlib.pyplot")
    assert fit.plot(sensor="gyro").get_xscale() == "log"
    pyplot.close("all")


def test_texts_show_the_argument_and_not_where_it_was_put() -> None:
    rng = np.random.default_rng(2)
    sigma = [1e-2] * 3 + [1e-3] * 3
    fit = calibrate([sigma * rng.standard_normal((512, 6)) for _ in range(2)], rate_hz=100.0, model="WN", bootstrap=0)
    texts = [fit._native.json(), fit.summary(), fit._native.html(), *map(fit.text, fit.files)]
    assert not any("nav-sim-" in text.replace("nav-sim-python", "") and "/tmp/" in text for text in texts)
    files = [r["file"] for r in json.loads(fit.text("model.wv.json"))["curves"][0]["replicates"]]
    assert set(files) == {"recordings[0].npz", "recordings[1].npz"}


def test_several_estimators_have_a_model_each(recordings: Path) -> None:
    fit = calibrate(recordings, estimator="all", **USUAL)
    assert list(fit.models) == ["awv", "sr-awv", "dr-awv"]


@pytest.mark.parametrize(
    ("given", "arguments", "words"),
    [
        (np.zeros((100, 5)), {"rate_hz": 100.0}, "recordings: 5 columns whose channels are not known"),
        (np.zeros((10, 2, 3)), {"rate_hz": 100.0}, "recordings: 3 dimensions"),
        ([], {}, "recordings: there is nothing in it"),
        ({"gyro_x_rad_s": [1.0, 2.0], "gyro_y_rad_s": [1.0]}, {"rate_hz": 1.0}, "recordings: gyro_y_rad_s has 1 rows"),
        ({}, {}, "recordings: there are no columns"),
        ({"gyro_x_rad_s": np.r_[np.zeros(50), np.nan, np.ones(50)]}, {"rate_hz": 1.0}, "recordings, row 50"),
        ("no/such/place", {}, "no/such/place"),
        (7, {}, "recordings"),
    ],
)
def test_what_is_no_recording_is_refused_by_name(given: Any, arguments: dict[str, Any], words: str) -> None:
    refused(words, calibrate, given, **arguments)


def test_hints_name_arguments(recordings: Path) -> None:
    without_rate = refused("", calibrate, np.random.default_rng(1).standard_normal((512, 6)))
    assert "rate_hz=" in (without_rate.hint or "") and "--" not in str(without_rate)
    line = recordings.parent / "broken.csv"
    line.write_text("t_s,gyro_x_rad_s\n0.0,1.0\n0.01,abc\n", encoding="utf-8")
    broken = refused("", calibrate, line)
    assert broken.file == str(line) and broken.line == 3


def test_progress_is_told(recordings: Path) -> None:
    told: list[tuple[int, int]] = []
    calibrate(recordings, progress=lambda done, total: told.append((done, total)), **USUAL)
    assert told and all(0 <= done <= total for done, total in told)


@pytest.mark.filterwarnings("ignore::nav_sim.NavSimWarning")
def test_a_calibrated_model_keeps_its_intervals(recordings: Path, short: Path, tmp_path: Path) -> None:
    fit = calibrate(recordings, **USUAL)
    written = nav_sim.lincov(short, fit.model.write(tmp_path / "m.toml"), outages=[(20, 40)])
    in_memory = nav_sim.lincov(short, fit.model, outages=[(20, 40)])
    interval = in_memory.outages["horizontal_error_end_m_p95_ci95_low"]
    assert np.isfinite(interval).all()
    np.testing.assert_array_equal(interval, written.outages["horizontal_error_end_m_p95_ci95_low"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"bootstrap": "many"}, "bootstrap='many': not a whole number ≥ 0"),
        ({"seed": 1.5}, "seed='1.5': not a whole number"),
        ({"efficiency": "high"}, "efficiency='high': not a number"),
        ({"estimator": "best"}, "estimator='best': not one of awv"),
        ({"pool": "axis"}, "pool='axis': not one of axes, sensor"),
        ({"trim": "x"}, "trim='x': expected a number"),
        ({"model": object()}, "model: a object is neither"),
        ({"axes": "gyr"}, "axes='gyr': expected all"),
        ({"rate_hz": "fast"}, "rate_hz='fast': not a finite number > 0"),
    ],
)
def test_a_wrong_argument_is_named(arguments: dict[str, Any], words: str) -> None:
    refused(words, calibrate, np.zeros((64, 6)), **{"rate_hz": 100.0, **arguments})


@pytest.mark.filterwarnings("ignore::nav_sim.NavSimWarning")
def test_answers_pickle(recordings: Path, tmp_path: Path) -> None:
    fit = calibrate(recordings, **USUAL)
    again = pickle.loads(pickle.dumps(fit))
    for name in (*fit.files,):
        assert again.text(name) == fit.text(name)
    assert (again.data, again.summary(), again.verdict) == (fit.data, fit.summary(), fit.verdict)
    assert again.model == fit.model and str(again) == str(fit)
    assert again.to_html(tmp_path / "a.html").read_bytes() == fit.to_html(tmp_path / "b.html").read_bytes()
    run = nav_sim.lincov(DRIVE, fit.model, outages=[(60, 90)])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(run)).epochs["nees"], run.epochs["nees"])
