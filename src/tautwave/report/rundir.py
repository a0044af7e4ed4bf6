"""A run directory as the report sees it: the rig, the summary and a recording read by columns."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
import yaml

from tautwave.errors import RecordingError
from tautwave.report.envelope import Floats

WHOLE_CELLS = 12_000_000  # up to about 100 MB a recording is held in memory, above it is read by columns
SIDES = ("master", "slave")


class Recorded(Protocol):
    """What the report needs of `tautwave.report.recording.Recording`."""

    @property
    def columns(self) -> tuple[str, ...]: ...

    @property
    def truncated(self) -> bool: ...

    @property
    def metadata(self) -> Mapping[str, Any]: ...

    def __getitem__(self, column: str) -> Floats: ...


@dataclass
class Run:
    """One finished, broken or half recovered run. Times in s, everything else SI."""

    directory: Path
    rig: dict[str, Any]
    rig_text: str
    summary: dict[str, Any]
    columns: tuple[str, ...] = ()
    rows: int = 0
    truncated: bool = False
    metadata: Mapping[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _whole: Recorded | None = None

    def read(self, *names: str) -> dict[str, Floats]:
        """Full columns by name; names that were not recorded are left out of the answer."""
        present = tuple(dict.fromkeys(name for name in names if name in self.columns))
        if not present:
            return {}
        source = self._whole
        if source is None:
            source = _read(self.directory / "recording.mcap", present)
        return {name: np.asarray(source[name], dtype=np.float64) for name in present}

    @property
    def name(self) -> str:
        """The rig's name."""
        return str(self.rig.get("name") or self.summary.get("rig") or self.directory.name)

    @property
    def rate_hz(self) -> float:
        """Loop rate [Hz], NaN where nobody wrote it down."""
        for place in (self.rig, self.summary, self.metadata):
            try:
                rate = float(place["rate_hz"])
            except (KeyError, TypeError, ValueError):
                continue
            if rate > 0.0 and math.isfinite(rate):
                return rate
        return math.nan

    @property
    def pairs(self) -> list[str]:
        """Names of the pairs, in the rig's order."""
        declared = list(block(self.rig, "coupling", "pairs")) or list(block(self.summary, "pairs"))
        if declared:
            return declared
        ends = {c.split(".")[1] for c in self.columns if c.startswith("master.")}
        return sorted(ends)

    def elements(self, pair: str) -> list[str]:
        """Controller elements of `pair` with an energy account, from summary and recording."""
        named = list(block(self.summary, "pairs", pair, "elements"))
        for column in self.columns:
            parts = column.split(".")
            if len(parts) == 3 and parts[0] == pair and parts[2] == "absorbed":
                named.append(parts[1])
        return list(dict.fromkeys(named))


def block(tree: Any, *keys: str) -> dict[str, Any]:
    """The mapping under `keys`, empty where any of them is missing or not a mapping."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, Mapping) else None
    return dict(tree) if isinstance(tree, Mapping) else {}


def load_run(directory: Path) -> Run:
    """Read what a run left in `directory`, however little that is.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    notes: list[str] = []
    rig_text = _text(directory / "rig.yaml", notes)
    summary = _summary(directory / "summary.json", notes)
    run = Run(directory, _rig(rig_text, notes), rig_text, summary, notes=notes)
    path = directory / "recording.mcap"
    try:
        _attach(run, path)
    except (RecordingError, OSError) as error:
        if not summary:
            raise RecordingError(
                f"{directory}: nothing to report on, no summary.json and no readable "
                f"recording.mcap ({error})"
            ) from error
        notes.append(f"There are no figures, because the recording cannot be read: {error}.")
    if run.truncated:
        notes.append(
            "The recording is cut short: its writer was stopped before it closed the file. "
            f"The {run.rows} rows that could be recovered are shown."
        )
    if not summary:
        from tautwave.report.rebuild import rebuild_summary

        run.summary = rebuild_summary(run)
        notes.append(
            "summary.json is missing, so the run ended before it could be written (a crash or a "
            "kill). The numbers here are rebuilt from the recording; what only the loop knew, "
            "such as device faults and why it ended, is not recorded."
        )
    return run


def _read(path: Path, names: tuple[str, ...]) -> Recorded:
    from tautwave.report.recording import read_recording

    return cast(Recorded, read_recording(path, columns=names))


def _attach(run: Run, path: Path) -> None:
    if not path.is_file():
        raise RecordingError(f"{path.name} is missing")
    head = _read(path, ("time_s",))
    run.columns = _all_columns(path)
    run.rows = len(head["time_s"])
    run.truncated = bool(head.truncated)
    run.metadata = head.metadata
    if run.rows * len(run.columns) <= WHOLE_CELLS:
        run._whole = _read(path, run.columns)


def _all_columns(path: Path) -> tuple[str, ...]:
    from tautwave.report.recording import read_recording

    return tuple(read_recording(path, stride=1 << 62).columns)


def _text(path: Path, notes: list[str]) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        notes.append(f"{path.name} cannot be read ({error.strerror}); units are those of N and m.")
        return ""


def _rig(text: str, notes: list[str]) -> dict[str, Any]:
    try:
        loaded = yaml.safe_load(text)
    except yaml.YAMLError as error:
        notes.append(f"rig.yaml is not valid YAML: {' '.join(str(error).split())}.")
        return {}
    return loaded if isinstance(loaded, dict) else {}


def _summary(path: Path, notes: list[str]) -> dict[str, Any]:
    try:
        loaded = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        notes.append(f"summary.json cannot be read: {error}.")
        return {}
    return loaded if isinstance(loaded, dict) else {}


def pair_settings(run: Run, pair: str) -> dict[str, Any]:
    """What the rig file says of `pair`, empty where there is no rig file."""
    return block(run.rig, "coupling", "pairs", pair)


def kind_of(run: Run, pair: str) -> str:
    """`rotary` or `linear`, from the summary, else the rig's master axis."""
    told = block(run.summary, "pairs", pair).get("kind")
    return str(told or block(run.rig, "master", "axes", pair).get("kind") or "linear")


def axis_kind(run: Run, side: str, pair: str) -> str:
    """`rotary` or `linear` of one axis; the pair's kind where the rig file does not say."""
    return str(block(run.rig, side, "axes", pair).get("kind") or kind_of(run, pair))
