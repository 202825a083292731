"""What a process sees: other threads, Ctrl-C, forks, memory, the command."""

from __future__ import annotations

import inspect
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path

import nav_sim
import numpy as np
import pytest
from conftest import DRIVE, TACTICAL, Command


def python(script: str, *words: object) -> subprocess.Popen[str]:
    given = [sys.executable, "-c", textwrap.dedent(script), *map(str, words)]
    return subprocess.Popen(given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_other_threads_run_meanwhile() -> None:
    x = np.random.default_rng(1).standard_normal(1 << 21)
    worker = threading.Thread(target=nav_sim.wavelet_variance, args=(x, 1.0), kwargs={"robust": True})
    worker.start()
    ticks = 0
    while worker.is_alive():
        time.sleep(1e-3)
        ticks += 1
    # with the lock held there would be the one before it is taken and the one after
    assert ticks > 5


@pytest.mark.skipif(sys.platform == "win32", reason="a process group for the signal is needed there")
@pytest.mark.parametrize(
    "call",
    [
        "nav_sim.run(drive, model, runs=100_000, outages=[(60, 90)])",
        "nav_sim.wavelet_variance(np.random.default_rng(1).standard_normal(1 << 26), 1.0, robust=True)",
        "nav_sim.calibrate(np.random.default_rng(1).standard_normal((1 << 20, 6)), rate_hz=100.0, bootstrap=100_000)",
    ],
)
def test_ctrl_c_is_a_keyboard_interrupt(call: str) -> None:
    script = f"""
        import sys, time
        import numpy as np
        import nav_sim
        drive, model = sys.argv[1:]
        print("ready", flush=True)
        try:
            {call}
        except KeyboardInterrupt:
            print("stopped", flush=True)
    """
    process = python(script, DRIVE, TACTICAL)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=120)
    assert out == "stopped\n", errors


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_a_fork_is_refused_and_not_left_waiting() -> None:
    script = """
        import os, sys
        import numpy as np
        import nav_sim
        nav_sim.wavelet_variance(np.arange(64.0), 1.0)
        child = os.fork()
        if child == 0:
            try:
                nav_sim.wavelet_variance(np.arange(64.0), 1.0)
            except nav_sim.NavSimError as e:
                os._exit(7 if "spawn" in e.hint else 8)
            os._exit(9)
        sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """
    process = python(script)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 7, errors


def test_a_failing_callback_stops_the_job(short: Path) -> None:
    def told(done: int, total: int) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        nav_sim.run(short, TACTICAL, runs=1000, outages=[(20, 40)], progress=told)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_many_calls_leave_memory_flat() -> None:
    def resident_kib() -> int:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

    def calls(count: int) -> None:
        for _ in range(count):
            nav_sim.wavelet_variance(x, 1.0)
            try:
                nav_sim.wavelet_variance(wrong, 1.0)
            except nav_sim.NavSimError:
                pass

    x = np.random.default_rng(1).standard_normal(2000)
    wrong = np.full(2000, np.nan)
    calls(500)
    before = resident_kib()
    calls(10_000)
    # a signal that stayed would be 16 kB a call, 160 MB in all; an array of eight figures 2 MB
    assert resident_kib() - before < 1500


def test_the_command_is_the_program(command: Command, tmp_path: Path) -> None:
    assert command("--version").stdout.startswith("nav-sim ")
    assert "lincov" in command("run", "--help").stdout
    assert "no/such.csv" in command("wv", "no/such.csv", code=2).stderr
    assert "--no-such" in command("wv", "--no-such", code=2).stderr
    done = command("run", DRIVE, TACTICAL, "--method lincov -q -o", tmp_path / "run")
    assert "horizontal" in done.stdout
    assert '"nav-sim"' in (tmp_path / "run" / "manifest.json").read_text(encoding="utf-8")


def test_importing_takes_neither_numpy_nor_matplotlib() -> None:
    process = python("import sys, nav_sim; print([m for m in ('numpy', 'matplotlib') if m in sys.modules])")
    assert process.communicate()[0] == "[]\n"


def test_every_name_is_there_and_described() -> None:
    assert set(nav_sim.__all__) <= set(dir(nav_sim))
    for name in nav_sim.__all__:
        assert getattr(nav_sim, name).__doc__, name
    with pytest.raises(AttributeError):
        nav_sim.no_such_name  # noqa: B018


ANNOTATED = [getattr(nav_sim, name) for name in nav_sim.__all__ if inspect.isroutine(getattr(nav_sim, name))]


@pytest.mark.parametrize("function", [*ANNOTATED, nav_sim.Model.from_datasheet], ids=lambda f: f.__name__)
def test_every_argument_is_described(function: Callable[..., object]) -> None:
    text = function.__doc__ or ""
    if "with the arguments of `wavelet_variance`" in text:
        text += nav_sim.wavelet_variance.__doc__ or ""
    missing = [name for name in inspect.signature(function).parameters if not re.search(rf"\b{name}\b", text)]
    assert not missing


def test_a_doubt_points_to_the_line_of_the_caller(short: Path) -> None:
    path = {name: values for name, values in nav_sim.Trajectory(short).states(2.0).items() if name[0] in "tlh"}
    calls: list[Callable[[], object]] = [
        lambda: nav_sim.Trajectory(path),
        lambda: nav_sim.run(path, TACTICAL, runs=1, outages=[]),
        lambda: nav_sim.lincov(path, TACTICAL, outages=[]),
        lambda: nav_sim.Model.from_datasheet(arw="0.1 deg/sqrt(h)"),
    ]
    for call in calls:
        with pytest.warns(nav_sim.NavSimWarning) as told:
            call()
        assert {warning.filename for warning in told} == {__file__}


def test_progress_without_tqdm_is_a_line(
    short: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    nav_sim.run(short, TACTICAL, runs=3, outages=[], progress=True)
    assert capsys.readouterr().err.endswith("3 of 3\n")
