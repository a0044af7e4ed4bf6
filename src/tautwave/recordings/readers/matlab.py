"""MATLAB files: version 5 by SciPy, 7.3, which is HDF5, by h5py."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.errors import ConfigError
from tautwave.reading import open_file
from tautwave.recordings.readers.shared import Array, chosen, flatten, library
from tautwave.recordings.stated import Stated


def matlab_names(path: Path, stated: Stated) -> list[str]:
    """Return the names of the numeric vectors of a MATLAB file."""
    return list(_vectors(path))


def matlab_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read numeric vectors of a MATLAB file: `name`, `struct.field`, `matrix[0]`."""
    return chosen(path, _vectors(path), wanted)


def _vectors(path: Path) -> dict[str, Array]:
    io = library(path, "scipy.io", "analysis")
    vectors: dict[str, Array] = {}
    try:
        with open_file(path) as file:
            content = io.loadmat(file, simplify_cells=True)
    except NotImplementedError:
        return _hdf5(path)
    except (OSError, ValueError, TypeError, IndexError, io.matlab.MatReadError) as err:
        raise ConfigError(f"{path}: cannot be read as a MATLAB file: {err}") from err
    for name, value in content.items():
        if not name.startswith("__"):
            flatten(name, value, vectors)
    return vectors


def _hdf5(path: Path) -> dict[str, Array]:
    """Return the vectors of a file of version 7.3; its matrices are stored column by column."""
    h5py = library(path, "h5py", "hdf5")
    vectors: dict[str, Array] = {}
    try:
        with open_file(path) as raw, h5py.File(raw, "r") as file:
            for name, value in file.items():
                if not name.startswith("#"):
                    flatten(name, _plain(h5py, value), vectors)
    except OSError as err:
        raise ConfigError(f"{path}: cannot be read as a MATLAB 7.3 file: {err}") from err
    return vectors


def _plain(h5py: Any, value: Any) -> Any:
    """Return a group as a mapping, and numbers as MATLAB shows them: a vector without its one."""
    if isinstance(value, h5py.Group):
        return {name: _plain(h5py, inner) for name, inner in value.items()}
    if value.dtype.kind not in "fiub" or "MATLAB_empty" in value.attrs:
        return None  # text, and references into cells
    array = np.asarray(value)
    return array.ravel() if array.ndim == 2 and 1 in array.shape else array.T
