"""Columns of recordings by name: the same numbers from CSV, MAT and our own files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave.recordings.columns import (
    column_names,
    read_column,
    read_columns,
)

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


def test_two_rows_are_a_recording_and_one_is_not(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,x\n0,1\n0.1,2\n")
    assert [one.tolist() for one in read_column(path, "x", "t")] == [[0.0, 0.1], [1.0, 2.0]]
    both = mat(tmp_path / "a.mat", t=[0.0, 0.1], x=[1.0, 2.0])
    assert read_column(both, "x", "t")[1].tolist() == [1.0, 2.0]
    path.write_text("t,x\n0,1\n")
    with pytest.raises(ConfigError, match="at least two rows, it has 1"):
        read_column(path, "x", "t")


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


@pytest.mark.parametrize(
    "text",
    [
        "t,x,y\n0,1.5,2\n0.1,-1,3\n",
        "t;x;y\r\n0;1,5;2\r\n0,1;-1;3\r\n",
        "t\tx\ty\n0\t1,5\t2\n0.1\t-1\t3\n",
        "# a bench\n# of ours\nt;x;y\n0;1.5;2\n0.1;-1;3\n",
        '\ufeff"t","x","y"\n0,1.5,2\n\n0.1,-1,3\n',
    ],
)
def test_csv_of_other_programs_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8", newline="")
    assert column_names(path) == ["t", "x", "y"]
    found = read_columns(path, ["y", "x"], "t")
    assert [found[name].tolist() for name in "txy"] == [[0.0, 0.1], [1.5, -1.0], [2.0, 3.0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0,1\n0.5,2\n", "a.csv:1: starts with numbers"),
        ("t,x\n0,1\n0.5,\n", "a.csv:3: column 'x' holds '', not a finite number; fill the gap"),
        ("# unit\nt,x\ns,rad\n0,1\n", "a.csv:3: column 't' holds 's'"),
        ("# unit\nt,x\n1,1\n0,1\n", "a.csv:4: time must increase"),
        ("t_ms,x\n0,1\n1,2\n", "'t_ms' is in milliseconds by the column's name; state its unit"),
    ],
)
def test_what_is_no_table_of_numbers_is_said(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(ConfigError) as refused:
        read_column(path, "x", column_names(path)[0])
    assert said in str(refused.value)


def test_values_may_be_missing_where_gaps_are_allowed_and_times_never(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,x\n0,1\n0.1,NaN\n0.2,\n0.3,2\n")
    found = read_columns(path, ["x"], "t", holes=True)["x"]
    np.testing.assert_array_equal(found, [1.0, np.nan, np.nan, 2.0])
    late = np.where(np.arange(len(X)) < 10, np.nan, X)
    whole = read_columns(mat(tmp_path / "a.mat", t=T, x=late), ["x"], "t", holes=True)
    np.testing.assert_array_equal(whole["x"], late)
    path.write_text("t,x\n0,1\nnan,2\n1,2\n")
    with pytest.raises(ConfigError, match=r"a\.csv:3: column 't'"):
        read_columns(path, ["x"], "t", holes=True)


def test_a_pause_is_no_unit(tmp_path: Path) -> None:
    times = np.where(np.arange(50) < 25, T, T + 1e5)
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([times, X]), "%.17g", ",", header="t,x", comments="")
    assert read_column(path, "x", "t")[0][-1] > 1e5
