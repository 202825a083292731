"""The one exception and the one warning."""

from __future__ import annotations

import re


class NavSimError(Exception):
    """Something cannot be done: what, where and what helps.

    `str(error)` has it all; the parts are attributes.
    """

    #: What is wrong, with file and line where they are known.
    message: str
    #: The file at fault, or the argument that was given as arrays.
    file: str | None
    #: The line in it, from 1; of arrays the row.
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


#: Options of the commands whose arguments here have another name.
_RENAMED = {"outage": "outages", "lever_arm": "lever_arm_m", "heading": "heading_deg", "for": "aim"}


def as_arguments(text: str) -> str:
    """Options of the command line as arguments of functions: `--rate-hz` is `rate_hz=`."""

    def argument(match: re.Match[str]) -> str:
        name = match[1].replace("-", "_")
        return f"{_RENAMED.get(name, name)}="

    return re.sub(r"--([a-z][a-z-]*[a-z])", argument, text)
