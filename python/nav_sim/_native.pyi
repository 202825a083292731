"""The native module: requests in, answers out. Use the functions of `nav_sim`."""

from collections.abc import Callable
from os import PathLike
from typing import final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Answer",
    "answer",
    "columns",
    "main",
    "model_allan",
    "model_contents",
    "model_practical",
    "model_recording",
    "study_run",
    "toml",
    "wavelet",
]

_Floats = npt.NDArray[np.float64]

@final
class Answer:
    """The answer to a request: as the command prints, draws and writes it."""

    @property
    def unmet(self) -> str | None: ...
    @property
    def warnings(self) -> list[str]: ...
    def json(self) -> str: ...
    def summary(self) -> str: ...
    def verdict(self) -> list[str]: ...
    def html(self) -> str: ...
    def names(self) -> list[str]: ...
    def text(self, name: str) -> str: ...

def answer(
    command: str,
    request: str,
    hidden: str,
    progress: Callable[[int, int], object] | None,
    threads: int | None = None,
) -> Answer: ...
def columns(text: str) -> dict[str, _Floats | list[str]]: ...
def toml(json: str) -> str: ...
def main(words: list[str]) -> int: ...
def model_allan(text: str, samples: list[int]) -> dict[str, _Floats]: ...
def model_contents(text: str, path: str | None) -> str: ...
def model_practical(text: str, policy: str, from_s: float, to_s: float) -> str: ...
def model_recording(
    text: str, samples: int, replicate: int, seed: int, spread: bool, contaminate: str | None
) -> dict[str, _Floats]: ...
def study_run(
    study: str | PathLike[str],
    directory: str | PathLike[str],
    shard: tuple[int, int] | None,
    time_limit_s: float | None,
    progress: Callable[[int, int], object] | None,
    threads: int | None = None,
) -> tuple[Answer | None, list[str]]: ...
def wavelet(x: _Floats, scales: int | None, efficiency: float | None) -> dict[str, _Floats]: ...
