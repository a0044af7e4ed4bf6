"""Columns of recordings by name: the same numbers from CSV, MAT and our own files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave.recordings.columns import column_names, read_column, read_columns

T = 1e-3 * np.arange(50)
X = np.sin(T)


def mat(path: Path, **content: object) -> Path:
    io = pytest.importorskip("scipy.io")
    io.savemat(path, content)
    return path


def test_a_matlab_file_has_vectors_fields_and_matrix_columns(tmp_path: Path) -> None:
    log = {"time": T, "signals": {"values": np.column_stack([X, 2.0 * X])}}
    path = mat(tmp_path / "log.mat", t=T[:, None], x=X, log=log, note="hand", scalar=3.0)
    assert set(column_names(path)) == {
        "t", "x", "log.time", "log.signals.values[0]", "log.signals.values[1]",
    }  # fmt: skip
    found = read_columns(path, ["x", "log.signals.values[1]"], "log.time")
    np.testing.assert_array_equal(found["log.time"], T)
    np.testing.assert_array_equal(found["x"], X)
    np.testing.assert_array_equal(found["log.signals.values[1]"], 2.0 * X)


def test_csv_and_matlab_agree(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.csv", np.column_stack([T, X]), "%.17g", ",", header="t,x", comments="")
    one = read_column(tmp_path / "a.csv", "x", "t")
    two = read_column(mat(tmp_path / "a.mat", t=T, x=X), "x", "t")
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"t": T, "y": X}, "there is no column 'x'; available: t, y"),
        ({"t": T, "x": X[:-1]}, "'x' has 49 values, 't' has 50"),
        ({"t": T, "x": np.where(T[7] == T, np.nan, X)}, "row 8: 'x' is not a finite number"),
        ({"t": np.where(T[7] == T, 0.0, T), "x": X}, "row 8: time must increase"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, content: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=r"a\.mat: ") as found:
        read_column(mat(tmp_path / "a.mat", **content), "x", "t")
    assert said in str(found.value)


def test_what_is_no_matlab_file_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_text("hello")
    with pytest.raises(ConfigError, match="cannot be read as a MATLAB file"):
        column_names(tmp_path / "a.mat")
