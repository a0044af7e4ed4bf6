"""A run against a recording of the same motion: what was measured there, what came out here."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.errors import ConfigError
from tautwave.motion import longest_step, resample
from tautwave.recordings.columns import MADE, column_names, read_columns
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.recordings.times import time_columns
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import units_of

Array = NDArray[np.float64]
Column = tuple[str, float]
"""A column of the recording, and what it is to be multiplied with."""

_WORDS = {"position": ("position", "angle"), "commanded": ("command", "motor")}
_MAPPED = re.compile(r"(?P<ours>[^=]+)=(?P<sign>-?)(?:(?P<factor>[0-9.eE+]+)\*)?(?P<theirs>.+)")
_LEAST = 100


class Compared(NamedTuple):
    """One quantity of both, on the times of the run; SI of the run."""

    name: str
    unit: str
    time_s: Array
    recorded: Array
    ours: Array

    @property
    def rms(self) -> tuple[float, float, float]:
        """Of the recording, of the run, and of their difference."""
        return _rms(self.recorded), _rms(self.ours), _rms(self.ours - self.recorded)

    @property
    def explained(self) -> float | None:
        """Share of the recorded variance that the run explains; below 0: none, None without any."""
        spread = float(np.var(self.recorded))
        return 1.0 - float(np.var(self.ours - self.recorded)) / spread if spread else None

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        recorded, ours, apart = self.rms
        return {
            "unit": self.unit,
            "recorded_rms": recorded,
            "run_rms": ours,
            "ratio": ours / recorded if recorded else None,
            "difference_rms": apart,
            "difference_max": float(np.max(np.abs(self.ours - self.recorded))),
            "explained": self.explained,
        }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))


def mapped_columns(
    run: Run, file: Path, given: Sequence[str], stated: Stated = UNSTATED
) -> dict[str, Column]:
    """Return which column of the recording stands for which of the run.

    Those of `given`, `OURS=THEIRS` each, THEIRS with a sign or factor (`-tau`, `0.5*f_n`); and
    without any, those of the same name, or positions and commands whose names say master or slave.

    Raises
    ------
    ConfigError
        There is no such column, or none that fits.
    """
    theirs = column_names(file, stated)
    mapped: dict[str, Column] = {}
    for text in given:
        match = _MAPPED.fullmatch(text)
        if match is None:
            raise ConfigError(f"--map {text}: write OURS=THEIRS, such as slave.lever.position=x_s")
        factor = float(match["factor"] or 1.0) * (-1.0 if match["sign"] else 1.0)
        for name, known, whose in (
            (match["ours"], run.columns, str(run.directory)),
            (match["theirs"], theirs, str(file)),
        ):
            if name not in known:
                raise ConfigError(
                    f"--map {text}: {whose} has no column {name!r}; it has "
                    f"{', '.join(list(known)[:20])}{', ...' if len(known) > 20 else ''}"
                )
        mapped[match["ours"]] = match["theirs"], factor
    if not mapped:
        mapped = _by_names(run, theirs)
    if not mapped:
        raise ConfigError(
            f"{file}: no column is named as a position or command of master or slave; assign them "
            f"with --map OURS=THEIRS (columns: {', '.join(theirs[:20]) or 'none'})"
        )
    return mapped


def _by_names(run: Run, theirs: Sequence[str]) -> dict[str, Column]:
    by_name: dict[str, Column] = {}
    wanted = [
        (side, pair, what)
        for pair in run.pairs
        for side in ("master", "slave")
        for what in ("position", "commanded")
    ]
    for side, pair, what in wanted:
        ours = f"{side}.{pair}.{what}"
        if ours not in run.columns:
            continue
        if ours in theirs:
            by_name[ours] = ours, 1.0
            continue
        able = [
            name
            for name in theirs
            if side in name.lower()
            and any(word in name.lower() for word in _WORDS[what])
            and not name.lower().startswith("minus")
        ]
        if len(run.pairs) > 1:
            able = [name for name in able if pair in name]
        if len(able) == 1:
            by_name[ours] = able[0], 1.0
    return by_name


def compare_recording(
    run: Run,
    file: Path,
    given: Sequence[str] = (),
    *,
    time: str | None = None,
    begin_s: float | None = None,
    end_s: float | None = None,
    stated: Stated = UNSTATED,
    notes: list[str] | None = None,
) -> list[Compared]:
    """Return the quantities that a run and a recording have in common, on the times of the run.

    The run's time 0 is the recording's first row, as a replay has it; gaps in it are left out. Of
    a pair whose positions are both there, the position error is one of the quantities. `stated` is
    what the file does not say itself; `notes` gets a sentence on times that are no seconds.

    Raises
    ------
    ConfigError, RecordingError
        A column is missing, or too little of the time is in both.
    """
    columns = mapped_columns(run, file, given, stated)
    made = MADE if stated.rate_hz is not None else None
    clock = time or made or next(iter(time_columns(column_names(file, stated))), MADE)
    read = read_columns(
        file, [name for name, _ in columns.values()], clock, stated=stated, holes=True, notes=notes
    )
    good = np.all([np.isfinite(values) for values in read.values()], axis=0)
    if np.count_nonzero(good) < 2:
        raise ConfigError(
            f"{file}: has fewer than two rows in which all compared columns are known"
        )
    times = (read[clock] - read[clock][0])[good]
    now = run.read("time_s")["time_s"]
    after = np.clip(np.searchsorted(times, now, side="right"), 1, len(times) - 1)
    measured = (now >= times[0]) & (times[after] - times[after - 1] <= longest_step(times))
    inside = (
        measured
        & (now >= (begin_s or 0.0))
        & (now <= min(times[-1], np.inf if end_s is None else end_s))
    )
    if np.count_nonzero(inside) < _LEAST:
        raise ConfigError(
            f"{file}: fewer than {_LEAST} cycles of the run lie within the recording's "
            f"{times[-1]:.4g} s and between --from and --to"
        )
    now = now[inside]
    compared = []
    values: dict[str, tuple[Array, Array]] = {}
    for ours, (theirs, factor) in columns.items():
        recorded = factor * np.asarray(resample(times, read[theirs][good], now), dtype=np.float64)
        values[ours] = recorded, run.read(ours)[ours][inside]
        compared.append(Compared(ours, _unit(run, ours), now, *values[ours]))
    for pair in run.pairs:
        both = [f"{side}.{pair}.position" for side in ("master", "slave")]
        if all(name in values for name in both):
            gain = _gain(run, pair)
            recorded, ours_ = (
                values[both[0]][which] - values[both[1]][which] / gain for which in (0, 1)
            )
            unit = units_of(run, pair)[0]
            compared.append(Compared(f"{pair}.position_error", unit, now, recorded, ours_))
    return compared


def _gain(run: Run, pair: str) -> float:
    keys: Mapping[str, Any] = run.rig.get("coupling", {}).get("pairs", {}).get(pair, {})
    return float(keys.get("sign", 1)) * float(keys.get("position_scale", 1.0))


def _unit(run: Run, column: str) -> str:
    pair = next((pair for pair in run.pairs if f".{pair}." in f".{column}."), None)
    if pair is None:
        return ""
    position, effort = units_of(run, pair)
    leaf = column.rpartition(".")[2]
    if leaf in ("position", "reference"):
        return position
    if leaf == "velocity":
        return f"{position}/s"
    return effort if "effort" in leaf or leaf == "commanded" else ""
