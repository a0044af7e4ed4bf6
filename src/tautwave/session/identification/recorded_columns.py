"""Position and effort of a recording, from a run or a CSV file, on even times. SI units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import Array
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.columns import MADE, column_names, is_own, read_columns, recording_file
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.recordings.times import time_columns

MAX_SAMPLES = 100_000
"""Most samples used of a recording; more would take minutes without improving the fit."""

MIN_CHANGE = 1e-50
"""Change in SI whose squares are still numbers."""

UNEVEN = 0.6  # share of a period: a larger gap in time is filled in and not used
_EFFORTS = ("effort", "torque", "force")


class Series(NamedTuple):
    """Two columns of a recording on a uniform grid: position, effort, and which were measured."""

    source: str
    position_name: str
    effort_name: str
    rotary: bool | None
    start_s: float
    period: float
    position: Array
    effort: Array
    known: NDArray[np.bool_]
    notes: tuple[str, ...]


def read_series(
    source: Path,
    position: str | None,
    effort: str | None,
    time: str | None,
    axis: str | None,
    part: tuple[float | None, float | None],
    stated: Stated = UNSTATED,
) -> Series:
    """Read position and effort of a recording onto a uniform grid.

    Raises
    ------
    ConfigError, RecordingError
        No such recording or column, or names that leave the columns ambiguous.
    """
    return _even(*_read(source, position, effort, time, axis, stated), part)


def changing(series: Series) -> Series:
    """Return a series from which something can be found.

    Raises
    ------
    RecordingError
        Its position or its effort never changes.
    """
    for name, values in (
        (series.position_name, series.position),
        (series.effort_name, series.effort),
    ):
        if not np.ptp(values) > MIN_CHANGE:
            raise RecordingError(
                f"{series.source}: {name} never changes, so nothing can be identified"
            )
    return series


def too_little(series: Series, why: ValueError) -> RecordingError:
    """Return why nothing can be found in a series, with what is missing in it."""
    missing = np.count_nonzero(~series.known)
    gaps = (
        f"; {missing} of {len(series.known)} samples are missing, and the filter does not fill "
        "gaps: choose a part without gaps with --from and --to"
    )
    return RecordingError(f"{series.source}: {why}{gaps if missing else ''}")


def read_positions(
    source: Path,
    position: str | None,
    time: str | None,
    axis: str | None,
    part: tuple[float | None, float | None],
    stated: Stated = UNSTATED,
) -> Series:
    """Read the positions of a recording as they were measured, each on the slot nearest its time.

    Raises
    ------
    ConfigError, RecordingError
        No such recording or column, or names that leave the column ambiguous.
    """
    source = recording_file(source)
    if position is None and source.exists():
        position = _only_position(source, axis, stated)
    series, times = _read(source, position, position, time, axis, stated)
    inside, notes = _inside(series, times, part)
    t = times[inside]
    period = _period(series, t)
    slots = np.rint((t - t[0]) / period).astype(np.int64)
    slots = slots[slots < 4 * MAX_SAMPLES]
    count = int(slots[-1]) + 1
    values = np.zeros(count)
    known = np.zeros(count, dtype=bool)
    values[slots] = series.position[inside][: len(slots)]
    known[slots] = True
    return series._replace(
        start_s=float(t[0]), period=period, position=values, effort=values, known=known,
        notes=notes,
    )  # fmt: skip


def _only_position(source: Path, axis: str | None, stated: Stated) -> str:
    """Return the column of the given axis' position, or of the only one."""
    if not is_own(source):
        header = column_names(source, stated)
        places = [name for name in header if "position" in name.lower() or "angle" in name.lower()]
        return _one(source, "position", "--position", places, header)
    from tautwave.recordings.recording import read_recording

    names = read_recording(source, rows=slice(0, 1)).axes()
    if axis is None and len(names) > 1:
        raise ConfigError(f"{source}: choose an axis with --axis: {', '.join(names)}")
    if axis is not None and axis not in names:
        raise ConfigError(f"{source}: there is no axis {axis!r}; there are {', '.join(names)}")
    return f"{axis or names[0]}.position"


def _read(
    source: Path,
    position: str | None,
    effort: str | None,
    time: str | None,
    axis: str | None,
    stated: Stated,
) -> tuple[Series, Array]:
    """Return the two columns as they were recorded, and their times [s]."""
    source = recording_file(source)
    if not source.exists():
        raise RecordingError(f"{source}: no such recording")
    notes: list[str] = []
    if not is_own(source):
        if axis is not None:
            raise ConfigError(
                f"{source}: is no recording of ours and has no axes; use --position and --effort"
            )
        header = column_names(source, stated)
        made = MADE if stated.rate_hz is not None else None
        clock = time or made or _one(source, "time", "--time", time_columns(header), header)
        position, effort = csv_columns(source, header, position, effort)
        read = read_columns(
            source, [position, effort], clock, stated=stated, holes=True, notes=notes
        )
        times, places, efforts = read[clock], read[position], read[effort]
        valid = np.ones(len(times), dtype=bool)
        rotary = _rotary(position, effort)
    else:
        from tautwave.recordings.recording import read_recording

        clock = time or "time_s"
        names = read_recording(source, rows=slice(0, 1))
        position, effort = mcap_columns(source, names.columns, names.axes(), axis, position, effort)
        flag = position.rpartition(".")[0] + ".valid"
        wanted = [clock, position, effort, *([flag] if flag in names.columns else [])]
        recording = read_recording(source, list(dict.fromkeys(wanted)))
        times, places, efforts = recording[clock], recording[position], recording[effort]
        valid = recording[flag] > 0.5 if flag in names.columns else np.ones(len(times), dtype=bool)
        rotary = _kind_of(names.attachments, position)
    series = Series(
        str(source), position, effort, rotary, 0.0, 1.0, places, efforts, valid, tuple(notes)
    )
    return series, times


def _inside(
    series: Series, times: Array, part: tuple[float | None, float | None]
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which samples are used, with a note if that is not the whole part."""
    begin, end = part
    inside = np.ones(len(times), dtype=bool)
    if begin is not None:
        inside &= times >= begin
    if end is not None:
        inside &= times <= end
    asked = np.count_nonzero(inside)
    inside &= np.isfinite(series.position) & np.isfinite(series.effort) & series.known
    missing = asked - np.count_nonzero(inside)
    if np.count_nonzero(inside) < 3:
        raise RecordingError(
            f"{series.source}: no samples between --from and --to"
            + (f" in which both {series.position_name} and {series.effort_name} are known"
               if missing else "")
        )  # fmt: skip
    notes = list(series.notes)
    if missing:
        notes.append(f"{missing} of {asked} samples are missing or not valid, and were left out.")
    if np.count_nonzero(inside) > MAX_SAMPLES:
        inside[np.flatnonzero(inside)[MAX_SAMPLES:]] = False
        last = times[inside][-1]
        notes.append(f"Only the part up to {last:.4g} s is used; --from and --to choose another.")
    return inside, tuple(notes)


def _period(series: Series, times: Array) -> float:
    period = float(np.median(np.diff(times)))
    if not period > 0.0:
        raise RecordingError(f"{series.source}: its timestamps do not increase")
    return period


def _even(series: Series, times: Array, part: tuple[float | None, float | None]) -> Series:
    """Cut out a part and resample it to a uniform grid, with gaps filled and marked."""
    inside, notes = _inside(series, times, part)
    t, x, force = times[inside], series.position[inside], series.effort[inside]
    period = _period(series, t)
    count = min(round((t[-1] - t[0]) / period) + 1, 4 * MAX_SAMPLES)
    grid = t[0] + period * np.arange(count)
    return series._replace(
        start_s=float(t[0]),
        period=period,
        position=np.interp(grid, t, x),
        effort=np.interp(grid, t, force),
        known=_near(grid, t, period),
        notes=notes,
    )


def _near(grid: Array, times: Array, period: float) -> NDArray[np.bool_]:
    """Return which slots of a grid have a sample."""
    after = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
    away = np.minimum(np.abs(times[after] - grid), np.abs(times[after - 1] - grid))
    return np.asarray(away < UNEVEN * period)


def with_beside(
    series: Series,
    source: Path,
    column: str,
    time: str | None,
    axis: str | None,
    stated: Stated = UNSTATED,
) -> tuple[Series, Array]:
    """Return another column on the grid of a series, which is known only where both are.

    Raises
    ------
    ConfigError, RecordingError
        There is no such column, or it holds no numbers.
    """
    raw, times = _read(source, series.position_name, column, time, axis, stated)
    good = np.isfinite(raw.effort) & raw.known
    if np.count_nonzero(good) < 3:
        raise RecordingError(f"{source}: {column} holds no numbers")
    slots: Array = np.arange(len(series.position), dtype=np.float64)
    grid = series.start_s + series.period * slots
    known = series.known & _near(grid, times[good], series.period)
    return series._replace(known=known), np.interp(grid, times[good], raw.effort[good])


def motor_column(
    source: Path, axis: str | None, effort: str | None, stated: Stated = UNSTATED
) -> str | None:
    """Return the column of a motor's effort: the given one, else found by its name."""
    if effort is not None:
        return effort
    file = recording_file(source)
    if not file.exists():
        return None  # reported where it is read
    names = column_names(file, stated)
    if is_own(file):
        able = [name for name in names if name.rpartition(".")[2] == "motor_effort"]
        able = able or [name for name in names if name.rpartition(".")[2] == "commanded"]
        able = [name for name in able if axis is None or name.rpartition(".")[0] == axis]
    else:
        able = [name for name in names if "command" in name.lower() or "motor" in name.lower()]
    return _one(file, "motor's effort", "--effort", able, names, None, ("slave",))


def csv_columns(
    path: Path, header: Sequence[str], position: str | None, effort: str | None
) -> tuple[str, str]:
    """Columns of position and effort: those given, else found by their names.

    Of several, the slave's position with the environment's effort; a given one determines the
    other.
    """
    places = [name for name in header if "position" in name.lower() or "angle" in name.lower()]
    efforts = [
        name
        for name in header
        if any(word in name.lower() for word in _EFFORTS) and "command" not in name.lower()
    ]
    hand = (effort is not None and "hand" in effort) or (
        position is not None and "master" in position
    )
    return (
        _one(path, "position", "--position", places, header, position,
             ("master", "hand") if hand else ("slave",)),
        _one(path, "effort", "--effort", efforts, header, effort,
             ("hand", "master") if hand else ("environment", "slave")),
    )  # fmt: skip


def _one(
    path: Path,
    what: str,
    option: str,
    able: Sequence[str],
    header: Sequence[str],
    given: str | None = None,
    preferred: Iterable[str] = (),
) -> str:
    """The column given, the only one that fits, or the only one with a preferred word."""
    if given is not None:
        if given not in header:
            raise ConfigError(
                f"{path}: there is no column {given!r}; there are {', '.join(header) or 'none'}"
            )
        return given
    if len(able) == 1:
        return able[0]
    for word in preferred:
        fitting = [name for name in able if word in name.lower()]
        if len(fitting) == 1:
            return fitting[0]
    if able:
        raise ConfigError(
            f"{path}: several columns could be the {what} ({', '.join(able)}); choose with {option}"
        )
    rate = ", or with --rate HZ where rows are evenly spaced" if option == "--time" else ""
    raise ConfigError(
        f"{path}: no column name matches the {what}; give it with {option}{rate}"
        f" (there are {', '.join(header) or 'none'})"
    )


def mcap_columns(
    path: Path,
    columns: Sequence[str],
    axes: Sequence[str],
    axis: str | None,
    position: str | None,
    effort: str | None,
) -> tuple[str, str]:
    """Columns of a run: of the given axis, else of the only one with a measured external effort."""
    for name in (position, effort):
        if name is not None and name not in columns:
            raise ConfigError(f"{path}: there is no column {name!r}")
    if position is not None and effort is not None:
        return position, effort
    if axis is not None and axis not in axes:
        raise ConfigError(f"{path}: there is no axis {axis!r}; there are {', '.join(axes)}")
    outside = {}
    for name in axes:
        side = "environment" if name.startswith("slave.") else "hand"
        for column in (f"{name}.measured_effort", f"true.{name}.{side}_effort"):
            if column in columns:
                outside[name] = column
                break
    if effort is not None and axis is None:
        axis = next((name for name in axes if name in effort), None)
    if axis is None:
        slaves = [name for name in outside if name.startswith("slave.")]
        able = slaves or list(outside)
        if len(able) > 1:
            raise ConfigError(f"{path}: choose an axis with --axis: {', '.join(outside)}")
        if not able:
            raise ConfigError(
                f"{path}: no axis measured an external effort; give --position and --effort"
            )
        axis = able[0]
    if effort is None and axis not in outside:
        raise ConfigError(
            f"{path}: {axis} did not measure external effort; name the column with --effort"
        )
    return position or f"{axis}.position", effort or outside[axis]


def _rotary(*names: str) -> bool | None:
    """Kind of the axis from units in the names, None if they have none."""
    parts = {part for name in names for part in name.lower().split("_")}
    if parts & {"rad", "nm"}:
        return True
    return False if parts & {"m", "n"} else None


def _kind_of(attachments: dict[str, bytes], column: str) -> bool | None:
    """Kind of the column's axis from the rig in the recording."""
    try:
        from tautwave.config import parse_rig

        rig = parse_rig(attachments["rig.yaml"].decode())
        return rig.axes[".".join(column.split(".")[-3:-1])].kind == "rotary"
    except (KeyError, UnicodeDecodeError, ConfigError):
        return None
