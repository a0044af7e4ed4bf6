"""A run directory as the report sees it: the rig, the summary and a recording read by columns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig, parse_rig
from tautwave.config.keys.coupling import STANDARD_LAW
from tautwave.errors import ConfigError
from tautwave.registry import coupling_messages
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.scratch import Scratch
from tautwave.report.units import number
from tautwave.runtime.operate.states import ENGAGED, STATES
from tautwave.summary import Summary
from tautwave.summary.model import Pair, Side
from tautwave.wording import CouplingMessages

if TYPE_CHECKING:
    from tautwave.recordings.recording import Recording
    from tautwave.report.columns import Described

WHOLE_CELLS = (
    12_000_000  # up to about 100 MB a recording is held in memory, above it is read by columns
)
AT_ONCE = 5  # columns of a long recording held together: 150 MB of an hour at 1 kHz
SIDES: tuple[Side, Side] = ("master", "slave")


@dataclass
class Run:
    """One finished, broken or partly recovered run. Times in s, everything else SI.

    `result` is its summary; `whole` the recording in memory, None where it is too long and read by
    columns instead; `time` its time column, `scratch` its columns spread out in a file.
    """

    directory: Path
    rig: dict[str, Any]
    rig_text: str
    result: Summary
    columns: tuple[str, ...] = ()
    rows: int = 0
    truncated: bool = False
    metadata: Mapping[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    whole: Recording | None = None
    time: Floats | None = None
    scratch: Scratch | None = None

    def result_of(self, pair: str) -> Pair:
        """Return what the summary has on a pair; all of it unknown where it has nothing."""
        return self.result.pairs.get(pair, Pair())

    def read(self, *names: str, rows: slice = slice(None)) -> dict[str, Floats]:
        """Full columns by name; unrecorded names are omitted."""
        present = tuple(dict.fromkeys(name for name in names if name in self.columns))
        if not present:
            return {}
        if self.whole is not None:
            return {name: self.whole[name][rows] for name in present}
        if self.time is not None and present == ("time_s",):
            return {"time_s": self.time[rows]}
        if self.scratch is not None:
            return {name: self.scratch.read(name, rows) for name in present}
        from tautwave.recordings.recording import read_recording

        part = read_recording(self.directory / "recording.mcap", present, rows=rows)
        return {name: part[name] for name in present}

    def each(self, names: Iterable[str]) -> Iterator[tuple[str, Floats]]:
        """Columns one after the other, a few per pass over a long recording."""
        wanted = list(names)
        step = AT_ONCE if self.scratch is None else 1
        for at in range(0, len(wanted), step):
            yield from self.read(*wanted[at : at + step]).items()

    @cached_property
    def checked_rig(self) -> Rig:
        """The rig as the run had it, read and checked once.

        Raises
        ------
        ConfigError
            There is no rig file, or it is wrong here: of another version, or its parts are missing.
        """
        path = self.directory / "rig.yaml"
        if not self.rig_text:
            raise ConfigError(f"{path} is missing")
        return parse_rig(self.rig_text, path)

    @cached_property
    def described(self) -> dict[str, Described]:
        """Unit and meaning of each column that is known."""
        from tautwave.report.columns import described  # of all that writes columns

        axes = {
            f"{side}.{name}": (str(keys.get("kind")), str(keys.get("causality")))
            for side in SIDES
            for name in block(self.rig, side, "axes")
            if (keys := block(self.rig, side, "axes", name))
        }
        elements = [f"{pair}.{one}.absorbed" for pair in self.pairs for one in self.elements(pair)]
        return described([*self.columns, *elements], self.metadata, axes)

    def meaning(self, column: str) -> str:
        """Return what a column is, "" where that is not known."""
        of = self.described.get(column)
        return "" if of is None else of.meaning

    @property
    def began(self) -> bool:
        """Whether there was a cycle, or it is unknown; without one there is nothing to show."""
        return self.rows > 0 or self.result.cycles != 0

    @property
    def name(self) -> str:
        """The rig's name."""
        return str(self.rig.get("name") or self.result.rig or self.directory.name)

    @property
    def rate_hz(self) -> float:
        """Loop rate [Hz], NaN if unknown."""
        known = (self.rig.get("rate_hz"), self.result.rate_hz, self.metadata.get("rate_hz"))
        for stated in known:
            try:
                rate = float(stated)  # type: ignore[arg-type]
            except (TypeError, ValueError):
                continue
            if rate > 0.0 and math.isfinite(rate):
                return rate
        return math.nan

    @property
    def pairs(self) -> list[str]:
        """Names of the pairs, in the rig's order."""
        if "scene" in self.rig:
            return []
        declared = list(block(self.rig, "coupling", "pairs")) or list(self.result.pairs)
        if declared:
            return declared
        ends = {c.split(".")[1] for c in self.columns if c.startswith("master.")}
        return sorted(ends)

    @property
    def site(self) -> Side | None:
        """Which of two sites recorded this, None where one machine ran both sides."""
        here = block(self.rig, "sites").get("here")
        return next((side for side in SIDES if side == here), None)

    @property
    def sides(self) -> tuple[Side, ...]:
        """The sides that were recorded."""
        return SIDES if self.site is None else (self.site,)

    @property
    def ports(self) -> list[str]:
        """Names of the axes that touch a scene, in the rig's order; none without a scene."""
        ports = block(self.rig, "scene", "ports")
        # In three dimensions a port has several axes, or one of its own name.
        axes = [block(ports, name).get("axes") or [name] for name in ports]
        return [name for of_port in axes for name in of_port]

    def elements(self, pair: str) -> list[str]:
        """Controller elements of `pair` with an energy account, from summary and recording."""
        named = list(self.result_of(pair).elements)
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


def pair_settings(run: Run, pair: str) -> dict[str, Any]:
    """The rig file's block for `pair`, empty without a rig file."""
    return block(run.rig, "coupling", "pairs", pair)


def kind_of(run: Run, pair: str) -> str:
    """`rotary` or `linear`, from the summary, else the rig's master axis."""
    kind = run.result_of(pair).kind
    return str(kind or block(run.rig, "master", "axes", pair).get("kind") or "linear")


def axis_kind(run: Run, side: str, pair: str) -> str:
    """`rotary` or `linear` of one axis; the pair's kind where the rig file does not say."""
    return str(block(run.rig, side, "axes", pair).get("kind") or kind_of(run, pair))


def served_rows(run: Run, axis: str) -> slice | npt.NDArray[np.bool_]:
    """Rows in which an axis' bus was read: all, or with a divisor those of its slots.

    `axis` is the full name; to index a column with.
    """
    side, _, name = axis.partition(".")
    bus = str(block(run.rig, side, "axes", name).get("bus"))
    divisor = int(number(block(run.rig, "buses", bus).get("divisor")) or 1)
    skipped = run.read("skipped_slots").get("skipped_slots") if divisor > 1 else None
    if skipped is None:
        return slice(None)
    slots = np.cumsum(1.0 + np.nan_to_num(skipped)) - 1.0
    return np.asarray(slots % divisor == divisor - 1)


def engaged_rows(run: Run) -> npt.NDArray[np.bool_] | None:
    """Return in which rows the pairs were coupled; None where they always were."""
    state = run.read("operation.state").get("operation.state")
    return None if state is None else np.asarray(state == STATES.index(ENGAGED))


def engaged_s(run: Run) -> float | None:
    """Return for how long the pairs were coupled [s]; None where they always were."""
    engaged = engaged_rows(run)
    if engaged is None or not np.isfinite(run.rate_hz):
        return None
    return int(engaged.sum()) / run.rate_hz


def delay_of(run: Run, pair: str) -> float:
    """Effective one-way delay [s] of `pair`, from the summary, else from the rig."""
    delay = run.result_of(pair).coupling_delay_s
    if delay is None:
        delay = number(block(run.rig, "coupling").get("delay_s"))
    return delay or 0.0


def law_wording(run: Run) -> CouplingMessages:
    """The messages of the run's coupling; the default ones if it is not installed here."""
    try:
        law = block(run.rig, "coupling").get("law", STANDARD_LAW)
        return coupling_messages(str(law))
    except ConfigError:
        return CouplingMessages()


def offset_per_effort(run: Run, pair: str) -> float | None:
    """Offset between master and slave per held effort [rad/(N m) or m/N]."""
    offset = run.result_of(pair).offset_per_effort
    if offset is None:
        impedance = number(pair_settings(run, pair).get("wave_impedance"))
        offset = delay_of(run, pair) / impedance if impedance else None
    return offset if offset is not None and offset > 0.0 else None
