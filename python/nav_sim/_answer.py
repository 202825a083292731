"""Answers of commands."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union

import numpy as np
import numpy.typing as npt

from nav_sim import _native
from nav_sim._errors import NavSimError, warn
from nav_sim._inputs import Staging, StrPath, as_json, numbers, whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Is told how many units are done, of how many; True: a bar of tqdm where it is installed, else a line.
Progress = Union[Callable[[int, int], object], bool, None]

Columns = dict[str, npt.NDArray[Any]]


def columns(text: str) -> Columns:
    """The columns of a CSV."""
    return {key: np.asarray(values) for key, values in _native.columns(text).items()}


class Kept:
    """An answer of the engine in texts, which pickle."""

    def __init__(self, answer: _native.Answer | Kept) -> None:
        self._json, self._summary, self._html = answer.json(), answer.summary(), answer.html()
        self._verdict: list[str] = answer.verdict()
        self.unmet: str | None = answer.unmet
        self.warnings: list[str] = answer.warnings
        self._files = {name: answer.text(name) for name in answer.names()}

    def json(self) -> str:
        return self._json

    def summary(self) -> str:
        return self._summary

    def html(self) -> str:
        return self._html

    def verdict(self) -> list[str]:
        return self._verdict

    def names(self) -> list[str]:
        return list(self._files)

    def text(self, name: str) -> str:
        if name not in self._files:
            raise NavSimError(f"there is no {name} in this answer")
        return self._files[name]


class Answer:
    """The answer of the command of the same name.

    `data` is what the command prints as JSON, `summary()` what it prints in words, `to_html()` its page, `write()` the
    files that it makes.
    """

    def __init__(self, native: _native.Answer) -> None:
        self._native: _native.Answer | Kept = native

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_native": Kept(self._native)}

    @cached_property
    def data(self) -> dict[str, Any]:
        """All figures, as the JSON of the command has them."""
        found: dict[str, Any] = json.loads(self._native.json())
        return found

    @property
    def verdict(self) -> str:
        """The verdict in a word, such as "consistent"; in words where there is no single one."""
        found = self.data.get("verdict")
        kind = found.get("kind") if isinstance(found, dict) else None
        return kind if isinstance(kind, str) else "\n".join(self._native.verdict())

    @property
    def unmet(self) -> str | None:
        """The bound that is not met, where one was asked for."""
        return self._native.unmet

    @property
    def files(self) -> list[str]:
        """Names of the files that the command makes."""
        return self._native.names()

    def text(self, name: str) -> str:
        """The text of one of `files`."""
        return self._native.text(name)

    def table(self, name: str) -> Columns:
        """One of `files` that is a table: columns by name."""
        return columns(self.text(name))

    def summary(self) -> str:
        """What the command prints."""
        return self._native.summary()

    def _repr_html_(self) -> str:
        # styles of the page stay its own
        return f'<iframe srcdoc="{escape(self._native.html())}" width="100%" height="600"></iframe>'

    def to_html(self, path: StrPath) -> Path:
        """Writes the page of the command, which needs no other file."""
        page = Path(path)
        page.write_text(self._native.html(), encoding="utf-8", newline="\n")
        return page

    def write(self, directory: StrPath) -> Path:
        """Writes the files of the command."""
        place = Path(directory)
        place.mkdir(parents=True, exist_ok=True)
        for name in self.files:
            (place / name).write_text(self.text(name), encoding="utf-8", newline="\n")
        return place

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.verdict.splitlines()[0] if self.verdict else ''}>"

    def __str__(self) -> str:
        return self.summary()


A = TypeVar("A", bound=Answer)


def ask(kind: type[A], command: str, staging: Staging, progress: Progress = None, threads: int | None = None, **request: Any) -> A:
    """The answer to a request; what is None in it is left to the engine."""
    with bar(progress) as told:
        count = None if threads is None else whole(threads, "threads", 1)
        native = _native.answer(command, as_json(request), staging.hidden, told, count)
    warn(native.warnings)
    return kind(native)


class _Line:
    """A line of figures, where there is no tqdm."""

    total = 0
    n = 0

    def update(self, steps: int) -> None:
        self.n += steps
        print(f"\r{self.n} of {self.total}", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        print(file=sys.stderr)


@contextmanager
def bar(progress: Progress) -> Iterator[Callable[[int, int], object] | None]:
    """A progress bar, a function, or nothing."""
    if progress is not True:
        if progress and not callable(progress):
            raise NavSimError(f"progress={progress!r} is neither a function nor True")
        yield progress or None
        return
    try:
        from tqdm.auto import tqdm

        shown: Any = tqdm()
    except ImportError:
        shown = _Line()

    def show(done: int, total: int) -> None:
        shown.total = total
        shown.update(done - shown.n)

    try:
        yield show
    finally:
        shown.close()


def windows(outages: Sequence[tuple[float, float]] | str | None) -> list[str] | None:
    """Outages as the command has them: `START:END`, or none at all."""
    if outages is None:
        return None
    if isinstance(outages, str):
        return [outages]
    try:
        pairs = [one if isinstance(one, str) else window(one, "outages") for one in outages]
    except (TypeError, NavSimError):
        raise NavSimError(f"outages={outages!r}: not pairs of start and end (s)", hint="such as outages=[(300, 390)]") from None
    return pairs or ["none"]


def window(pair: Any, name: str) -> str:
    """A pair of start and end (s), as the command has it."""
    start_s, end_s = numbers(pair, name, 2)
    return f"{start_s!r}:{end_s!r}"


def flattened(entries: Sequence[Mapping[str, Any]]) -> Columns:
    """Entries of JSON as columns; figures within figures have both names, pairs have two columns."""
    rows = [_flat(entry) for entry in entries]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _flat(entry: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in entry.items():
        name = f"{before}{key}"
        if isinstance(value, Mapping):
            flat.update(_flat(value, f"{name}_"))
        elif isinstance(value, list) and len(value) == 2:
            flat[f"{name}_low"], flat[f"{name}_high"] = value
        elif not isinstance(value, list):
            flat[name] = value
    return flat


def _column(values: list[Any]) -> npt.NDArray[Any]:
    if any(isinstance(value, str) for value in values):
        return np.asarray(["" if value is None else str(value) for value in values])
    # None is NaN
    return np.asarray(values, dtype=np.float64)


def show_versions() -> None:
    """Prints the versions of nav-sim, Python and packages, for a bug report."""
    import platform
    from importlib import metadata

    print("python", platform.python_version(), platform.platform())
    for name in ("nav-sim", "numpy", "matplotlib", "pandas", "polars", "tqdm"):
        with suppress(metadata.PackageNotFoundError):
            print(name, metadata.version(name))


def axes_or_new(ax: Axes | None) -> Axes:
    """Axes to draw in, of a figure of their own where none are given."""
    if ax is not None:
        return ax
    try:
        from matplotlib.figure import Figure
    except ImportError as e:
        raise ImportError("plots need matplotlib: pip install 'nav-sim[plot]'") from e
    try:
        # where there is a notebook or a window, pyplot shows the figure
        import matplotlib.pyplot as plt

        found: Axes = plt.subplots()[1]
    except ImportError:
        found = Figure().add_subplot()
    return found

