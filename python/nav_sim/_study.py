"""Studies: grids of experiments in units that survive, resume and spread over machines."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path

import numpy as np

from nav_sim import _native
from nav_sim._answer import Answer, Columns, Progress, bar
from nav_sim._errors import NavSimError, warn
from nav_sim._inputs import StrPath, path as path_of


class StudyTables(Answer):
    """The tables of a study: `nav-sim batch merge`."""

    def __init__(self, native: _native.Answer, results: Path) -> None:
        super().__init__(native)
        #: The directory of the tables.
        self.results = results

    @property
    def files(self) -> list[str]:
        """Names of the files in `results`."""
        return sorted(path.name for path in self.results.iterdir())

    def text(self, name: str) -> str:
        """The text of one of `files`."""
        try:
            return (self.results / name).read_text(encoding="utf-8")
        except OSError as e:
            raise NavSimError(f"{self.results / name}: {e.strerror}", file=str(self.results / name)) from None

    def table(self, name: str) -> Columns:
        """One of `files` that is a table: columns by name."""
        return {key: np.asarray(values) for key, values in _native.columns(self.text(name)).items()}

    @cached_property
    def outages(self) -> Columns:
        """A row for each outage of each candidate in each cell."""
        return self.table("outages.csv")

    @cached_property
    def runs(self) -> Columns:
        """A row for each run."""
        return self.table("runs.csv")


class Study:
    """A grid of experiments, described in a file: `nav-sim batch`.

    study = Study("study.toml")
    study.plan()
    study.run(progress=True)          # again after an interruption: it goes on where it was
    table = study.merge().outages
    """

    def __init__(self, path: StrPath, directory: StrPath | None = None) -> None:
        self.path = Path(path_of(path, "path"))
        #: Where its plan, units and results are: `out/` and its name if nothing else is said.
        self.directory = Path("out") / self.path.stem if directory is None else Path(directory)

    def plan(self, *, seed: int | None = None, progress: Progress = None) -> int:
        """Checks it, calibrates its candidates and cuts it into units; returns how many."""
        with bar(progress) as told:
            units, doubts = _native.study_plan(os.fspath(self.path), os.fspath(self.directory), seed, told)
        warn(doubts)
        return units

    def run(self, *, shard: tuple[int, int] = (0, 1), progress: Progress = None) -> int:
        """Computes the units that are not there yet, of shard number `shard[0]` of `shard[1]`; returns how many."""
        with bar(progress) as told:
            place = (os.fspath(self.path), os.fspath(self.directory))
            (finished, _), doubts = _native.study_run(*place, *shard, told)
        warn(doubts)
        return finished

    def merge(self, *, progress: Progress = None) -> StudyTables:
        """Makes its tables, when all units are there."""
        with bar(progress) as told:
            native, results = _native.study_merge(os.fspath(self.path), os.fspath(self.directory), told)
        warn(native.warnings)
        return StudyTables(native, results)

    def __repr__(self) -> str:
        return f"<Study: {self.path} in {self.directory}>"
