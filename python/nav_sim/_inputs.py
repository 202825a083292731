"""What users have, as the files that the engine reads.

A path goes through as it is. Arrays and tables are written to a directory of their own in the formats of the command,
so that one reader checks both; no text that comes back shows the directory, only the name of the argument.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeAlias, TypeGuard, Union

import numpy as np
import numpy.typing as npt

from nav_sim import _native
from nav_sim._errors import NavSimError

FloatArray: TypeAlias = npt.NDArray[np.float64]
StrPath: TypeAlias = Union[str, "os.PathLike[str]"]


def as_json(given: Mapping[str, Any]) -> str:
    """Options or settings for the engine; what is None is left to it."""
    return "{" + ",".join(f"{json.dumps(key)}:{_text(value, key)}" for key, value in _known(given).items()) + "}"


def _text(value: Any, name: str) -> str:
    try:
        return json.dumps(value, allow_nan=False, default=_plain)
    except (AttributeError, TypeError, ValueError):
        raise NavSimError(f"{name}: a {type(value).__name__} is neither a text nor finite numbers") from None


def as_toml(given: Mapping[str, Any]) -> str:
    """Settings as the text of a file."""
    return _native.toml(as_json(given))


def _known(given: Any) -> Any:
    if isinstance(given, Mapping):
        return {key: _known(value) for key, value in given.items() if value is not None}
    return [_known(value) for value in given] if isinstance(given, (list, tuple)) else given


def _plain(value: Any) -> Any:
    return os.fspath(value) if isinstance(value, os.PathLike) else value.tolist()


class Frame(Protocol):
    """A data frame, of pandas or polars: columns by name."""

    @property
    def columns(self) -> Any: ...
    def __getitem__(self, name: Any, /) -> Any: ...


#: Columns by name: a dict of arrays, a data frame, a structured array.
Table: TypeAlias = Union[Mapping[str, npt.ArrayLike], Frame, npt.NDArray[np.void]]

#: Channels of an array without names, as the readers of `.npy` files take them.
SIX = tuple(f"{sensor}_{axis}_{unit}" for sensor, unit in (("accel", "m_s2"), ("gyro", "rad_s")) for axis in "xyz")


def is_path(value: object) -> TypeGuard[StrPath]:
    """Whether a value names a file."""
    return isinstance(value, (str, os.PathLike))


def path(value: object, name: str) -> str:
    """The path of a file."""
    if is_path(value):
        return os.fspath(value)
    raise NavSimError(f"{name}: a {type(value).__name__} is no path")


def number(value: Any, name: str) -> float:
    """One number."""
    try:
        return float("bool" if isinstance(value, bool) else value)
    except (TypeError, ValueError):
        raise NavSimError(f"{name}={value!r} is not a number") from None


def numbers(values: Any, name: str, count: int) -> list[float]:
    """So many numbers."""
    if not isinstance(values, (list, tuple, np.ndarray)) or len(values) != count:
        raise NavSimError(f"{name}={values!r} is not {count} numbers")
    return [number(value, name) for value in values]


def whole(value: Any, name: str, least: int) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise NavSimError(f"{name}={value!r} is not a whole number ≥ {least}")
    return int(value)


def word(value: Any, name: str) -> str:
    """A text."""
    if isinstance(value, str):
        return value
    raise NavSimError(f"{name}={value!r} is not a text")


def settings(value: Any, name: str) -> Any:
    """Settings: a path, or tables by name."""
    if value is None or isinstance(value, Mapping):
        return value
    if is_path(value):
        return os.fspath(value)
    raise NavSimError(f"{name}: a {type(value).__name__} is neither a path nor a dict")


def is_table(value: object) -> bool:
    """Whether a value has columns by name."""
    if isinstance(value, np.ndarray):
        return value.dtype.names is not None
    return isinstance(value, Mapping) or hasattr(value, "columns")


def vector(value: npt.ArrayLike, name: str) -> FloatArray:
    """One signal: as it is where it is one of float64, else converted."""
    array = _floats(value, name)
    if array.ndim != 1:
        hint = f"give one signal at a time, such as {name}[:, 0]" if array.ndim == 2 else None
        raise NavSimError(f"{name}: {array.ndim} dimensions, and one is needed", hint=hint)
    return array


def _floats(value: npt.ArrayLike, name: str) -> FloatArray:
    try:
        raw = np.asanyarray(value)
        if raw.size == 0:
            raise NavSimError(f"{name}: there is nothing in it")
        if raw.dtype.kind == "c":
            raise NavSimError(f"{name}: complex numbers, and real ones are needed")
        if raw.dtype.kind in "mM":
            raise NavSimError(f"{name}: dates, and seconds are needed")
        # what is masked is missing
        return np.asarray(np.ma.filled(raw.astype(float, copy=False), np.nan))
    except (TypeError, ValueError) as e:
        raise NavSimError(f"{name}: not an array of numbers: {e}") from None


def columns(table: Table, name: str) -> dict[str, FloatArray]:
    """The columns of a table, all of one length."""
    if isinstance(table, np.ndarray):
        names: Iterable[Any] = table.dtype.names or ()
    elif isinstance(table, Mapping):
        names = table.keys()
    elif is_table(table):
        names = table.columns
    else:
        hint = "a path, a dict of arrays, a data frame or a structured array"
        raise NavSimError(f"{name}: a {type(table).__name__} is no table", hint=hint)
    found = {str(key): vector(table[key], f"{name}[{str(key)!r}]") for key in names}
    # a pandas frame may have its time as the index
    index = getattr(table, "index", None)
    label = getattr(index, "name", None)
    if "datetime64" in str(getattr(index, "dtype", "")):
        index, label = (index - index[0]) / np.timedelta64(1, "s"), "t_s"  # type: ignore[index]
    if isinstance(label, str) and label not in found:
        found = {label: vector(index, f"{name}.index"), **found}  # type: ignore[arg-type]
    if not found:
        raise NavSimError(f"{name}: there are no columns in it", hint="give columns by name")
    first, rows = next((key, len(values)) for key, values in found.items())
    for key, values in found.items():
        if len(values) != rows:
            raise NavSimError(f"{name}: {key} has {len(values)} rows, {first} has {rows}")
    return found


class Staging:
    """A directory for what came as arrays; it is made when it is needed, and removed at the end."""

    def __init__(self) -> None:
        self._directory: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Staging:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._directory is not None:
            self._directory.cleanup()

    @property
    def hidden(self) -> str:
        """What no text is to show."""
        return "" if self._directory is None else self._directory.name + os.sep

    def _place(self, name: str) -> Path:
        if self._directory is None:
            self._directory = tempfile.TemporaryDirectory(prefix="nav-sim-")
        return Path(self._directory.name) / name

    def text(self, name: str, contents: str) -> str:
        """A file of that text."""
        path = self._place(name)
        path.write_text(contents, encoding="utf-8")
        return str(path)

    def arrays(self, name: str, named: Mapping[str, npt.ArrayLike]) -> str:
        """Arrays by name."""
        path = self._place(f"{name}.npz")
        # as keyword arguments "file" could not be a column
        with open(path, "wb") as file:
            np.savez(file, **named)  # type: ignore[arg-type]
        return str(path)

    def columns(self, value: StrPath | Table, name: str) -> str:
        """A table as arrays by name."""
        if is_path(value):
            return os.fspath(value)
        return self.arrays(name, columns(value, name))  # type: ignore[arg-type]

    def table(self, value: StrPath | Table, name: str) -> str:
        """A table as text with a header."""
        if is_path(value):
            return os.fspath(value)
        found = columns(value, name)  # type: ignore[arg-type]
        rows = zip(*(values.tolist() for values in found.values()))
        lines = [",".join(found), *(",".join(map(repr, row)) for row in rows)]
        return self.text(f"{name}.csv", "\n".join(lines) + "\n")

    def settings(self, value: StrPath | Mapping[str, Any], name: str) -> str:
        """Settings as TOML."""
        if isinstance(value, Mapping):
            return self.text(f"{name}.toml", as_toml(value))
        return path(value, name)

    def recordings(self, value: Any, name: str, channel: str | None) -> list[str]:
        """One recording or several."""
        if is_path(value):
            return [os.fspath(value)]
        if isinstance(value, Sequence) and not _is_numbers(value):
            if not value:
                raise NavSimError(f"{name}: there is nothing in it")
            return [self._recording(one, f"{name}[{k}]", channel) for k, one in enumerate(value)]
        return [self._recording(value, name, channel)]

    def _recording(self, value: Any, name: str, channel: str | None) -> str:
        if is_path(value):
            return os.fspath(value)
        found = columns(value, name) if is_table(value) else _channels(value, name, channel)
        return self.arrays(name, found)


def _is_numbers(value: object) -> bool:
    is_list = isinstance(value, (list, tuple)) and len(value) > 0
    return is_list and all(isinstance(entry, (int, float, np.number)) for entry in value)  # type: ignore[attr-defined]


def _channels(value: npt.ArrayLike, name: str, channel: str | None) -> dict[str, FloatArray]:
    """The columns of an array without names: one channel that is named, three of a sensor, or six."""
    array = _floats(value, name)
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        raise NavSimError(f"{name}: {array.ndim} dimensions; rows are samples, columns are channels")
    names = _names(array.shape[1], channel)
    if names is None:
        hint = (
            'give a dict of columns such as {"gyro_x_rad_s": x}, or axes="gyro.x" for one signal, axes="gyro" for three'
        )
        raise NavSimError(f"{name}: {array.shape[1]} columns whose channels are not known", hint=hint)
    return {column: np.ascontiguousarray(array[:, k]) for k, column in enumerate(names)}


def _names(count: int, channel: str | None) -> Sequence[str] | None:
    if count == 6:
        return SIX
    sensor, _, axis = (channel or "").partition(".")
    unit = {"accel": "m_s2", "gyro": "rad_s"}.get(sensor)
    if unit is None:
        return None
    if count == 3 and not axis:
        return [f"{sensor}_{each}_{unit}" for each in "xyz"]
    return [f"{sensor}_{axis}_{unit}"] if count == 1 and axis in ("x", "y", "z") else None
