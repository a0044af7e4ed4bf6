"""The unit of times: every unit, rate, origin and kind of name gives seconds, or is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave.recordings.columns import read_columns
from tautwave.recordings.stated import Stated
from tautwave.recordings.times import (
    LONGEST_STEP_S,
    UNITS,
    named_unit,
    time_columns,
    unit_of_times,
)

X = np.sin(np.arange(60.0))
DATE = 1.7e9


def log(path: Path, column: str, times: np.ndarray) -> Path:
    table = np.column_stack([times, X[: len(times)]])
    np.savetxt(path, table, "%.17g", ",", header=f"{column},x", comments="")
    return path


@pytest.mark.parametrize("rate", [10.0, 50.0, 333.0, 1000.0, 4000.0])
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("begin", [0.0, 12.5, DATE])
@pytest.mark.parametrize("name", ["timestamp", "stamp", "t [{}]", "time_{}", "log.t_{}"])
def test_times_are_read_in_seconds_or_refused_with_their_factor(
    tmp_path: Path, rate: float, unit: str, begin: float, name: str
) -> None:
    """A reader that says what it took never takes a wrong unit: all that is left is a refusal."""
    column = name.format(unit)
    seconds = begin + np.arange(60) / rate
    path = log(tmp_path / "log.csv", column, seconds / UNITS[unit])
    notes: list[str] = []
    told = "{}" in name or begin == DATE or unit == "s"
    step = float(np.median(np.diff(seconds))) / UNITS[unit]
    if not told and step <= LONGEST_STEP_S:
        pytest.skip("milliseconds of more than 5 kHz from zero on are seconds to everybody")
    if not told:
        with pytest.raises(ConfigError) as caught:
            read_columns(path, ["x"], column, notes=notes)
        assert "a factor of " in str(caught.value)
        assert "--time-unit" in str(caught.value)
        if 1e-3 <= 1.0 / rate <= 0.1 and unit != "s":
            assert f"--time-unit {unit}`" in str(caught.value)
    else:
        found = read_columns(path, ["x"], column, notes=notes)[column]
        np.testing.assert_allclose(np.diff(found), 1.0 / rate, rtol=1e-2 if begin == DATE else 1e-6)
        assert bool(notes) == (unit != "s")
    # what the sentence says to state works, whatever the file is
    found = read_columns(path, ["x"], column, stated=Stated(unit))[column]
    np.testing.assert_allclose(np.diff(found), 1.0 / rate, rtol=1e-2 if begin == DATE else 1e-6)


def test_nobody_hears_of_a_unit_in_a_rig_so_it_is_stated(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", "t_ms", np.arange(60.0))
    with pytest.raises(ConfigError, match="in a rig with `time_unit: ms`"):
        read_columns(path, ["x"], "t_ms")
    assert read_columns(path, ["x"], "t_ms", stated=Stated("ms"))["t_ms"][1] == 1e-3


def test_a_name_that_contradicts_its_date_is_refused(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", "t_ms", DATE * 1e9 + 1e6 * np.arange(60.0))
    with pytest.raises(ConfigError, match="milliseconds by its name and, by its date, in nano"):
        read_columns(path, ["x"], "t_ms", notes=[])


def test_a_slow_recording_is_read_when_that_is_stated(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", "t", 5.0 * np.arange(60.0))
    with pytest.raises(ConfigError, match="or `s` where it was recorded that slowly"):
        read_columns(path, ["x"], "t", notes=[])
    assert read_columns(path, ["x"], "t", stated=Stated("s"))["t"][1] == 5.0


@pytest.mark.parametrize(
    ("column", "begin", "unit"),
    [("t", 0.0, "s"), ("t_s", 0.0, "s"), ("time_ns", 0.0, "ns"), ("t", DATE * 1e9, "ns")],
)
def test_the_longest_step_is_still_one_of_its_unit_however_that_is_known(
    column: str, begin: float, unit: str
) -> None:
    step = LONGEST_STEP_S / UNITS[unit]
    assert step * UNITS[unit] == LONGEST_STEP_S
    assert unit_of_times(Path("log.csv"), column, np.array([begin, begin + step]), None)[0] == unit
    with pytest.raises(ConfigError, match="with steps of"):
        unit_of_times(Path("log.csv"), column, np.array([begin, begin + 1.01 * step]), None)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("t", None), ("time_ms", "ms"), ("Time [ms]", "ms"), ("t (µs)", "us"), ("stamp.nsec", "ns"),
        ("timestamp_ns", "ns"), ("seconds", "s"), ("t_s", "s"), ("forms", None), ("columns", None),
    ],
)  # fmt: skip
def test_a_unit_is_the_last_word_of_a_name(name: str, unit: str | None) -> None:
    assert named_unit(name) == unit


def test_a_time_is_found_by_its_name() -> None:
    assert time_columns(["x", "Time [s]", "log.t"]) == ["Time [s]", "log.t"]
    assert time_columns(["t", "time_s"]) == ["time_s"]
    assert time_columns(["time_ms", "torque"]) == ["time_ms"]
    assert time_columns(["forms", "params", "s", "angle_s"]) == []
