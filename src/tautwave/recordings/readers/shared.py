"""What all readers of recordings share: numbers, and messages about what is wrong."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautwave.errors import ConfigError

Array = NDArray[np.float64]

MEND = "fill the gap or cut the recording there"
GREATEST = 1e50
"""Of a number in a recording: far beyond all that is measured, and its square is a number."""


def library(path: Path, name: str, extra: str) -> Any:
    """Import an optional library.

    Raises
    ------
    ConfigError
        It is not installed: what to install.
    """
    try:
        return importlib.import_module(name)
    except ImportError as err:
        package = name.partition(".")[0]
        raise ConfigError(f"{path}: this needs {package}; pip install 'tautwave[{extra}]'") from err


def chosen(path: Path, columns: Mapping[str, Array], wanted: Sequence[str]) -> dict[str, Array]:
    """Return the wanted columns of a table.

    Raises
    ------
    ConfigError
        There is no such column.
    """
    for name in wanted:
        if name not in columns:
            raise ConfigError(
                f"{path}: there is no column {name!r}; "
                f"available: {', '.join(columns) or 'none, the file is empty'}"
            )
    return {name: columns[name] for name in wanted}


def flatten(name: str, value: Any, series: dict[str, Array]) -> None:
    """Add the numeric vectors in a value to `series`: `name`, `struct.field`, `matrix[0]`."""
    if isinstance(value, dict):
        for key, inner in value.items():
            flatten(f"{name}.{key}", inner, series)
        return
    if isinstance(value, list):
        for at, inner in enumerate(value):
            flatten(f"{name}[{at}]", inner, series)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2):
        return
    if array.ndim == 1:
        series[name] = array.astype(np.float64)
        return
    if array.shape[0] < array.shape[1]:  # samples are along the longer side
        array = array.T
    for at, column in enumerate(array.T):
        series[f"{name}[{at}]"] = column.astype(np.float64)


def wrong(number: float | None) -> str:
    """Return what is wrong with a number, None where there is none."""
    if number is None or not math.isfinite(number):
        return "not a finite number"
    return f"beyond the plausible limit {GREATEST:g}"
