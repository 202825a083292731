"""Wavelet variances and Allan deviations of arrays."""

from __future__ import annotations

from pathlib import Path

import nav_sim
import numpy as np
import pytest
from conftest import Command, refused, table
from nav_sim import NavSimError, allan_deviation, wavelet_variance


def allan_by_definition(x: np.ndarray, m: int) -> float:
    """Half the mean square of differences of adjacent averages over m samples, at every start (IEEE 1139)."""
    sums = np.concatenate([[0.0], np.cumsum(x)])
    averages = (sums[m:] - sums[:-m]) / m
    return float(np.sqrt(0.5 * np.mean((averages[m:] - averages[:-m]) ** 2)))


def test_the_allan_deviation_is_that_of_its_definition() -> None:
    x = np.random.default_rng(1).standard_normal(5000)
    found = allan_deviation(x, 50.0)
    assert list(found) == ["tau_s", "adev", "edof", "ci_low", "ci_high"]
    for tau_s, adev in zip(found["tau_s"], found["adev"]):
        assert adev == pytest.approx(allan_by_definition(x, round(tau_s * 50.0)), rel=1e-11)


def test_white_noise_has_its_variance_over_the_scale() -> None:
    # the wavelet variance of white noise at 2^j samples is sigma²/2^j; 100 000 samples know the first scales to
    # sqrt(2/edof) with edof ≥ 1e5/2^j, hence five deviations
    found = wavelet_variance(3.0 * np.random.default_rng(2).standard_normal(100_000), 1.0)
    scales = 2.0 ** np.arange(1, 9)
    deviations = (found["wv"][:8] * scales / 9.0 - 1.0) / np.sqrt(2.0 * scales / 1e5)
    assert np.all(np.abs(deviations) < 5.0)
    assert np.all((found["ci_low"] < found["wv"]) & (found["wv"] < found["ci_high"]))


def test_outliers_do_not_raise_the_robust_one() -> None:
    x = np.random.default_rng(3).standard_normal(20_000)
    clean = wavelet_variance(x, 1.0, robust=True)["wv"][0]
    x[::200] += 50.0
    assert wavelet_variance(x, 1.0)["wv"][0] > 5.0 * clean
    assert wavelet_variance(x, 1.0, robust=True)["wv"][0] < 1.1 * clean


def test_it_is_the_curve_of_the_command(recordings: Path) -> None:
    path = recordings / "replicate_1.csv"
    z = table(path)["gyro_z_rad_s"]
    file = next(s for s in nav_sim.wv(path).signals if (s["sensor"], s["axis"]) == ("gyro", "z"))
    for name, robust in (("classical", False), ("robust", True)):
        own = wavelet_variance(z, 100.0, robust=robust)
        for key, values in file[name].items():
            np.testing.assert_allclose(own[key], values, rtol=1e-13, err_msg=f"{name} {key}")


def test_wv_answers_as_the_command(recordings: Path, command: Command) -> None:
    said = command("wv", recordings, "--format json --axes gyro -q").stdout
    assert nav_sim.wv(recordings, axes="gyro")._native.json() == said
    text = command("wv", recordings, "-q").stdout
    assert nav_sim.wv(recordings).summary().startswith(text.rstrip())


@pytest.mark.parametrize(
    "x",
    [
        np.arange(64, dtype=np.float32) ** 1.5,
        np.arange(64) ** 2,
        list(range(64)),
        (np.arange(128.0) ** 1.5)[::2],
        np.asfortranarray(np.arange(128.0).reshape(64, 2) ** 1.5)[:, 1],
        np.arange(64.0).astype(">f8"),
    ],
)
def test_whatever_numpy_takes_for_a_vector_is_one(x: object) -> None:
    own = np.array(np.asarray(x), dtype=np.float64, copy=True)
    np.testing.assert_array_equal(wavelet_variance(x, 1.0)["wv"], wavelet_variance(own, 1.0)["wv"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("x", "rate_hz", "words"),
    [
        (np.zeros((8, 3)), 1.0, "x: 2 dimensions, and one is needed"),
        (3.0, 1.0, "x: 0 dimensions"),
        ([], 1.0, "x: there is nothing in it"),
        ([1.0], 1.0, "x:"),
        ([np.nan, np.nan, 2.0, np.nan], 1.0, "x:"),
        ([1.0, np.inf, 2.0, 3.0], 1.0, "x: sample 1 is "),
        (["a", "b"], 1.0, "x: not an array of numbers"),
        ([[1.0, 2.0], [3.0]], 1.0, "x: not an array of numbers"),
        ([1j, 2j], 1.0, "x: complex"),
        ([1.0, 2.0, 4.0, 3.0], -1.0, "rate_hz: -1.0"),
        ([1.0, 2.0, 4.0, 3.0], np.nan, "rate_hz: nan"),
        ([], True, "rate_hz=True is not a number"),
        ([1e200, 0.0], 1.0, "x: 5e199 is"),
    ],
)
def test_what_is_no_signal_is_refused_by_name(x: object, rate_hz: float, words: str) -> None:
    refused(words, wavelet_variance, x, rate_hz)


def test_too_many_scales_and_no_efficiency() -> None:
    for arguments in ({"scales": 10}, {"scales": 0}, {"robust": True, "efficiency": 2.0}):
        refused("", wavelet_variance, np.arange(64.0), 1.0, **arguments)


def test_frames_take_a_curve() -> None:
    curve = wavelet_variance(np.random.default_rng(4).standard_normal(256), 10.0)
    for library in ("pandas", "polars"):
        frame = pytest.importorskip(library).DataFrame(curve)
        assert list(frame.columns) == ["tau_s", "wv", "edof", "ci_low", "ci_high"]
        assert frame["tau_s"][0] == 0.2


def test_a_plot_is_drawn_where_it_is_asked_for() -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    ax = pyplot.subplots()[1]
    assert wavelet_variance(np.random.default_rng(5).standard_normal(256), 10.0).plot(ax=ax) is ax
    assert len(ax.lines) == 1
    pyplot.close("all")


def test_missing_samples_are_those_of_a_recording_with_gaps() -> None:
    # the command finds the same samples missing by the times of the others
    x = np.random.default_rng(6).standard_normal(4096)
    missing = np.zeros(4096, dtype=bool)
    missing[1000:1100] = missing[2000:2003] = True
    given = {"t_s": np.arange(4096)[~missing] / 100.0, "gyro_z_rad_s": x[~missing]}
    with pytest.warns(nav_sim.NavSimWarning):
        (file,) = nav_sim.wv(given).signals
    for name, robust in (("classical", False), ("robust", True)):
        own = wavelet_variance(np.ma.array(x, mask=missing), 100.0, robust=robust)
        for key, values in file[name].items():
            np.testing.assert_allclose(own[key], values, rtol=1e-12, err_msg=f"{name} {key}")


def test_dates_of_rows_are_their_times() -> None:
    pandas = pytest.importorskip("pandas")
    with pytest.raises(NavSimError, match="runs at 100 Hz"):
        nav_sim.wv(pandas.DataFrame({"gyro_x_rad_s": [1, 2]}, pandas.to_datetime([0, 10**7])), rate_hz=200.0)
