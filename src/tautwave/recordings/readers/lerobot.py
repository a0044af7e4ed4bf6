"""LeRobot datasets, format 2.1 and 3.0, by PyArrow alone: one episode at a time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.errors import ConfigError
from tautwave.reading import read_file
from tautwave.recordings.readers.arrays import parquet_table
from tautwave.recordings.readers.shared import Array, chosen
from tautwave.recordings.stated import Stated

INFO = Path("meta") / "info.json"
MAX_BYTES = 1 << 24
"""Of that file."""


def is_dataset(path: Path) -> bool:
    """Return whether a directory is a LeRobot dataset."""
    return (path / INFO).is_file()


def dataset_names(path: Path, stated: Stated) -> list[str]:
    """Return the numeric columns of a dataset: `timestamp`, `action.NAME`."""
    return list(_episode(path, stated))


def dataset_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read columns of one episode of a dataset."""
    return chosen(path, _episode(path, stated), wanted)


def _episode(path: Path, stated: Stated) -> dict[str, Array]:
    try:
        info = json.loads(read_file(path / INFO, MAX_BYTES))
        features: dict[str, Any] = dict(info["features"])
        count = int(info["total_episodes"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as err:
        raise ConfigError(f"{path / INFO}: is not that of a LeRobot dataset: {err!r}") from err
    number = 0 if stated.episode is None and count == 1 else stated.episode
    if number is None or not 0 <= number < count:
        raise ConfigError(
            f"{path}: a dataset of {count} episodes; choose one with --episode N (0 to "
            f"{count - 1}), in a rig with `episode: N`"
        )
    names = {key: _names(feature) for key, feature in features.items()}
    files = sorted((path / "data").rglob("*.parquet"))
    own = [file for file in files if file.stem == f"episode_{number:06d}"]  # format 2.1
    parts = []
    for file in own or files:
        part = parquet_table(file, [("episode_index", "=", number)], names)
        if part and len(next(iter(part.values()))):
            parts.append(part)
    if not parts:
        raise ConfigError(f"{path}: its data have no row of episode {number}")
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _names(feature: Any) -> list[str]:
    """Return the names of a feature's elements: a list, or lists by kind."""
    given = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(given, dict):
        lists = [one for one in given.values() if isinstance(one, list)]
        given = [name for one in lists for name in one] if lists else list(given)
    return [str(name) for name in given or ()]
