"""The one exception and the one warning."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterable


class NavSimError(Exception):
    """Something cannot be done: what, where and what helps.

    `str(error)` has it all; the parts are attributes.
    """

    #: What is wrong, with file and line where they are known.
    message: str
    #: The file at fault, or the argument that was given in memory.
    file: str | None
    #: The line in it, from 1; of arrays and tables the index of the row.
    line: int | None
    #: What helps, where that is known.
    hint: str | None

    def __init__(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        hint: str | None = None,
    ) -> None:
        self.message = as_arguments(message)
        self.file = file
        self.line = line
        self.hint = None if hint is None else as_arguments(hint)
        super().__init__(message, file, line, hint)

    def __str__(self) -> str:
        return self.message if self.hint is None else f"{self.message}\nhint: {self.hint}"


class NavSimWarning(UserWarning):
    """Something is doubtful about the input or the result."""


def warn(doubts: Iterable[str]) -> None:
    """Warns of doubts, at the line outside of this package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals["__name__"].startswith("nav_sim."):
        frame, level = frame.f_back, level + 1
    for doubt in doubts:
        warnings.warn(as_arguments(doubt), NavSimWarning, stacklevel=level)


#: Options of the commands whose arguments here have another name.
_RENAMED = {
    "for": "aim",
    "heading": "heading_deg",
    "recording": "recordings",
    "lever_arm": "lever_arm_m",
    "outage": "outages",
    "state": "states",
}
_ORIGIN = "give nav_sim.Trajectory(…, origin=(lat_deg, lon_deg, h_m))"
#: Phrases that options alone do not make.
_PHRASES = {
    "write it with latitude and longitude: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M": _ORIGIN,
    "give --origin LAT_DEG,LON_DEG,H_M": _ORIGIN,
    "--gnss-sigma POS[:VEL]": "gnss_sigma=",
    "--topic NAME names one (nav-sim inspect lists them)": "topic= names one (nav-sim inspect lists them)",
    "--unit NAME (nav-sim datasheet --list)": "a unit of nav_sim.catalogue()",
    "nav-sim datasheet --list": "nav_sim.catalogue()",
}
#: Options whose value is a word.
_WORD = re.compile(r"--(estimator|filter|gaps|method|model|pool) ([a-z0-9]+)")


def as_arguments(text: str) -> str:
    """Options of the command line as arguments of functions: `--rate-hz` is `rate_hz=`."""

    def argument(match: re.Match[str]) -> str:
        name = match[1].replace("-", "_")
        return f"{_RENAMED.get(name, name)}="

    for phrase, meant in _PHRASES.items():
        text = text.replace(phrase, meant)
    return re.sub(r"--([a-z][a-z-]*[a-z])=?", argument, _WORD.sub(r'--\1="\2"', text))
