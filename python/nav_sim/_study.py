"""Studies: grids of runs that resume."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from nav_sim import _native
from nav_sim._answer import Answer, Columns, Progress, bar, columns
from nav_sim._errors import NavSimError, warn
from nav_sim._inputs import StrPath, path as path_of

#: Shards that a pool is given at most.
_SHARDS = 64


class StudyAnswer(Answer):
    """The results of a study: `nav-sim batch`."""

    def __init__(self, native: _native.Answer, directory: Path) -> None:
        super().__init__(native)
        #: Directory of the study, with `results.csv`, `summary.json`, `report.html` and `cells/`.
        self.directory = directory

    @cached_property
    def table(self) -> Columns:  # type: ignore[override]
        """`results.csv`: a row for each cell, outage and state."""
        return columns((self.directory / "results.csv").read_text(encoding="utf-8"))

    def cell(self, name: str) -> Path:
        """The run directory of a cell."""
        place = self.directory / "cells" / name
        if not place.is_dir():
            raise NavSimError(f"{place}: there is no such cell", file=str(place))
        return place


def _shard(study: str, directory: str, shard: tuple[int, int] | None, time_limit: float | None) -> None:
    """Computes a shard."""
    _native.study_run(study, directory, shard, time_limit, None)


class Study:
    """A run whose values may be lists, described in a file or a dict: `nav-sim batch`.

    study = Study("study.toml")
    found = study.run(progress=True)     # again after an interruption: it goes on where it was
    found.table, found.cell("length_s=5_right")
    """

    def __init__(self, study: StrPath | Mapping[str, Any], directory: StrPath | None = None) -> None:
        if isinstance(study, Mapping):
            if directory is None:
                raise NavSimError("directory: a study that is a dict needs one")
            self.directory = Path(directory)
            self.directory.mkdir(parents=True, exist_ok=True)
            self.path = self.directory / "study.json"
            self.path.write_text(json.dumps(study, indent=1, default=os.fspath), encoding="utf-8")
        else:
            self.path = Path(path_of(study, "study"))
            #: Where its cells and results are: `out/` and its name if nothing else is said.
            self.directory = Path("out") / self.path.stem if directory is None else Path(directory)

    def run(
        self,
        pool: Any = None,
        *,
        threads: int | None = None,
        shard: tuple[int, int] | None = None,
        time_limit: float | None = None,
        progress: Progress = None,
    ) -> StudyAnswer | None:
        """Computes what is missing, and compares all cells; None while some are missing.

        `pool`: a `concurrent.futures.Executor` (also of dask and mpi4py), or what has a `map`, that computes shards.
        `shard`: this process computes number `shard[0]` of `shard[1]`. `time_limit`: seconds after which it stops.
        """
        place = (os.fspath(self.path), os.fspath(self.directory))
        if pool is not None:
            shards = [(k, _SHARDS) for k in range(_SHARDS)]
            list(pool.map(_shard, *zip(*[(*place, one, time_limit) for one in shards])))
        with bar(progress) as told:
            native, doubts = _native.study_run(*place, shard, time_limit, told, threads)
        warn(doubts)
        return None if native is None else StudyAnswer(native, self.directory)

    def __repr__(self) -> str:
        return f"<Study: {self.path} in {self.directory}>"
