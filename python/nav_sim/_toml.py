"""TOML, as far as settings need it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from nav_sim._errors import NavSimError


class Inline(list[Any]):
    """Tables that are written in one line each."""


def dumps(table: Mapping[str, Any], place: str = "") -> str:
    """The text of a table: values first, then the tables in it."""
    lines: list[str] = []
    inner: list[str] = []
    for key, value in table.items():
        name = f"{place}.{key}" if place else key
        if isinstance(value, Mapping):
            inner.append(f"\n[{name}]\n{dumps(value, name)}")
        elif _is_tables(value):
            inner.extend(f"\n[[{name}]]\n{dumps(entry, name)}" for entry in value)
        elif value is not None:
            lines.append(f"{key} = {_value(value, name)}\n")
    return "".join(lines + inner)


def _is_tables(value: Any) -> bool:
    is_list = isinstance(value, (list, tuple)) and not isinstance(value, Inline)
    return is_list and len(value) > 0 and all(isinstance(entry, Mapping) for entry in value)


def _value(value: Any, name: str) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        # a float that is whole stays one, and repr reads back to the same bits
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(entry, name) for entry in value) + "]"
    if isinstance(value, Mapping):
        inner = ((key, _value(entry, f"{name}.{key}")) for key, entry in value.items() if entry is not None)
        return "{ " + ", ".join(f"{key} = {text}" for key, text in inner) + " }"
    if isinstance(value, int):
        return str(value)
    raise NavSimError(f"{name}: a {type(value).__name__} is neither a number nor a text")
