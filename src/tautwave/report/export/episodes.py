"""Which rows of a run are an episode, and what each column of them is."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.config.guard import parse_json, read_guarded
from tautwave.config.text.document import open_document
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.recording import Recording, read_recording
from tautwave.report.columns import described
from tautwave.report.run.rundir import SIDES, block
from tautwave.report.units import number
from tautwave.summary.file import LARGEST

EPISODE = "operation.episode"


class Episode(NamedTuple):
    """Rows of a run that belong together; `success` is None where it was not said.

    `discarded`: it was recorded again.
    """

    number: int
    name: str
    task: str
    success: bool | None
    rows: slice
    discarded: bool = False

    @property
    def stem(self) -> str:
        """Name of its file, without an ending."""
        name = re.sub(r"[^\w-]+", "-", self.name).strip("-")[:60] or "episode"
        return name if not self.number else f"{self.number:03d}-{name}"


def episodes(directory: Path) -> list[Episode]:
    """Return the episodes of a run, or all of it where there are none.

    The rows say where an episode is, also in a run that was killed; names and tasks are those of
    its summary.

    Raises
    ------
    RecordingError
        There is no recording.
    """
    try:
        marks = read_recording(directory, [EPISODE])[EPISODE]
    except RecordingError:
        read_recording(directory, ["time_s"])  # no recording at all: let it say so
        marks = np.zeros(0)
    stated = _summary(directory / "summary.json")
    edges = np.flatnonzero(np.diff(marks, prepend=0.0, append=0.0))
    kept = []
    for begin, end in itertools.pairwise(edges):
        number = int(marks[begin])
        if number:
            one = stated.get(number, {})
            name = str(one.get("name") or f"episode-{number}")
            task, success = str(one.get("task") or ""), one.get("success")
            rows, discarded = slice(int(begin), int(end)), bool(one.get("discarded"))
            kept.append(Episode(number, name, task, success, rows, discarded))
    return kept or [Episode(0, "run", "", None, slice(None))]


def _summary(path: Path) -> dict[int, dict[str, Any]]:
    """Return what the summary states of each episode, {} without any."""
    try:
        blocks = parse_json(read_guarded(path, "summary", LARGEST))["operation"]["episodes"]
        return {int(one["number"]): dict(one) for one in blocks}
    except (ConfigError, ValueError, KeyError, TypeError):
        return {}


def _rig(attachments: Mapping[str, bytes]) -> Any:
    """Return the rig in a recording as it was resolved, {} without a readable one."""
    try:
        text = attachments.get("rig.yaml", b"").decode("utf-8")
        return open_document(text, "rig.yaml", Path()).value if text else {}
    except (UnicodeDecodeError, ConfigError):
        return {}


def pair_ratios(attachments: Mapping[str, bytes]) -> dict[str, float]:
    """Return slave motion per master motion of each pair, with its sign, at the scale 1."""
    rig = _rig(attachments)
    ratios = {}
    for name in block(rig, "coupling", "pairs"):
        keys = block(rig, "coupling", "pairs", name)
        scale, sign = number(keys.get("position_scale", 1.0)), number(keys.get("sign", 1))
        if scale is not None and sign is not None:
            ratios[str(name)] = sign * scale
    return ratios


def axis_blocks(attachments: Mapping[str, bytes]) -> dict[str, dict[str, Any]]:
    """Return the rig's block of each axis by its full name, such as `master.lever`.

    Empty without a readable rig in the recording.
    """
    rig = _rig(attachments)
    return {
        f"{side}.{name}": axis
        for side in SIDES
        for name in block(rig, side, "axes")
        if (axis := block(rig, side, "axes", name))
    }


def units(rows: Recording) -> dict[str, str]:
    """Return the unit of each column that has one, by the axes of the run's own rig."""
    axes = {
        name: (str(keys.get("kind", "rotary")), str(keys.get("causality", "impedance")))
        for name, keys in axis_blocks(rows.attachments).items()
    }
    descriptions = described(rows.columns, rows.metadata, axes)
    return {column: of.unit for column, of in descriptions.items() if of.unit}
