"""Hashes of the rows of every shipped rig, kept in `row_hashes.txt`: they change for a reason only.

    python -m tests.rigs.row_hashes                       compares all, names case and column
    python -m tests.rigs.row_hashes --record "REASON"     writes the file anew, with its reason
    python -m tests.rigs.row_hashes --record "REASON" RIG ...    runs these rigs, keeps the others:
                                                          only where the file was made

A case is a rig, what is changed in it, an engine (`live`: the loop on the fake clock, with the
simulators of the rig's own buses; `compiled` and `python`: `simulate`) and a duration. Each has one
line: rows, hash of all rows, kind of error that ended the run, and 16 bits of a hash for each
column, so that a difference has a name. Columns stand once for each rig and engine that has
others, in their order.

Hashed are the bits of the numbers; every NaN counts as the same one. Sums, products, quotients and
roots are the same on any machine (IEEE 754, no `fastmath`, no contraction). Sine, exponential and
power are the C library's or NumPy's, whose last bit depends on the version and on what the
processor can do; hands, signals and foams use them. So the file names what they gave where it was
made (`math`); where they give something else, a difference says so instead of failing.
"""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave import load_rig, simulate
from tautwave.config import Rig
from tests.rigs.running import run_rig

ROOT = Path(__file__).parents[2]
KEPT = Path(__file__).with_name("row_hashes.txt")
SHIPPED = tuple(
    path.stem
    for path in sorted((ROOT / "configs").glob("*.yaml"))
    if (simulated := path.read_text().partition("\nsimulation:")[2])
    and "\n  arm:\n" not in simulated
    and "\n  tissues:\n" not in path.read_text()
)
"""Arms and tissues are left out: a cycle takes ms, and sines decide an arm's last bits."""
ENGINES = ("live", "compiled", "python")
SHORT_S = 2.5
"""All of a run is simulated compiled; so much of it in Python."""
SCENE_CYCLES = 1500

MISSING = "simulation.faults.missing_probability="
OVERRUN = "simulation.faults.overrun_probability="
SLOTS = "simulation.faults.overrun_slots="
FAULTS = (f"{MISSING}0.02", f"{OVERRUN}0.01", f"{SLOTS}2")
CHANGED: dict[str, tuple[str, ...]] = {
    "bench-1dof-loopback": (
        "master.axes.lever.position_range=[-0.5,0.1]",
        "coupling.pairs.lever.matched_master=true",
        "coupling.pairs.lever.wave_filter_hz=null;coupling.delay_s=0",
        "coupling.pairs.lever.wall_master.passivity_control=true;"
        "coupling.pairs.lever.wall_master.position=0.1;"
        "coupling.pairs.lever.wall_master.side=above",
        "buses.arm.options={command_delay_s: 0.0025}",
        "coupling.pairs.lever.position_scale=2;coupling.pairs.lever.sign=-1;"
        "coupling.pairs.lever.offset=0.01;coupling.pairs.lever.engage_tolerance=0.05",
        ";".join(FAULTS),
    ),
    "bench-2axis-loopback": (
        "master.axes.wrist.velocity_limit=0.1",
        ";".join((*FAULTS, "buses.hand.options={command_delay_s: 0.0015}")),
    ),
    "bench-admittance-loopback": (";".join(FAULTS),),
    "bench-multirate-loopback": (
        ";".join(FAULTS),
        "buses.hand.divisor=4",
        "master.axes.lever.velocity_limit=0.3",
    ),
    "bench-position-coupling": (
        ";".join(FAULTS),
        "coupling.delay_s=0",
        f"{MISSING}0.4;loop.missing_limit=6",
    ),
    "bench-saturation-loopback": (f"{OVERRUN}0.01;{SLOTS}7;loop.overrun_limit=7",),
    "network-loopback": (";".join((*FAULTS, "link.play_out=newest")), "buses.arm.divisor=4"),
    "scene-resonator": (";".join(FAULTS),),
}
"""What else is run: ways to stop, faults, command delays with a remainder, laws left out."""

FAST = ("bench-1dof-loopback", "bench-multirate-loopback", "bench-position-coupling")
"""Rigs that every `pytest` compares, as they are shipped; `-m slow` takes all cases."""


class Case(NamedTuple):
    """One run of a rig; `changes` are those of `--set`, with semicolons between."""

    rig: str
    changes: str
    engine: str

    def __str__(self) -> str:
        return " ".join(filter(None, (self.rig, self.engine, self.changes)))


class Rows(NamedTuple):
    """What is kept of a run; `each` by column."""

    columns: tuple[str, ...]
    count: int
    all: str
    ended: str
    each: tuple[str, ...]


def cases() -> Iterator[Case]:
    """Yield every case."""
    for rig in SHIPPED:
        for changes in ("", *CHANGED.get(rig, ())):
            for engine in ENGINES:
                yield Case(rig, changes, engine)


def rig_of(case: Case) -> Rig:
    """Return the checked rig of a case."""
    changes = [change for change in case.changes.split(";") if change]
    return load_rig(ROOT / "configs" / f"{case.rig}.yaml", changes)


def rows_of(case: Case) -> Rows:
    """Run a case."""
    rig = rig_of(case)
    seconds = rig.duration_s if case.engine == "compiled" else SHORT_S
    if rig.scene is not None:
        seconds = SCENE_CYCLES / rig.rate_hz
    seconds = min(seconds, rig.duration_s)
    if case.engine == "live":
        run = run_rig(rig, raises=False, duration_s=seconds)
        return hashed(run.columns, run.table, run.result.error)
    done = simulate(rig, duration_s=seconds, engine=case.engine)
    return hashed(done.columns, done.data, done.error)


def hashed(
    columns: Sequence[str], data: npt.NDArray[np.float64], ended: BaseException | None
) -> Rows:
    """Return the hashes of a table and of how its run ended."""
    bits = np.where(np.isnan(data), np.nan, data).astype("<f8")
    return Rows(
        tuple(columns),
        len(data),
        _hash(bits.tobytes())[:24],
        "-" if ended is None else type(ended).__name__,
        tuple(_hash(np.ascontiguousarray(column).tobytes())[:4] for column in bits.T),
    )


def math_of_this_machine() -> str:
    """Return a hash of what C library and NumPy make of some angles and powers here."""
    at = np.linspace(-9.0, 9.0, 4001)
    own = [f(x) for x in at.tolist() for f in (math.sin, math.cos, math.exp, math.tanh, math.atan)]
    own += [math.pow(abs(x), 1.5) for x in at.tolist()]
    numpy = [f(at) for f in (np.sin, np.cos, np.exp, np.tanh)]
    return _hash(np.array(own).tobytes() + b"".join(map(np.ndarray.tobytes, numpy)))[:16]


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def read_kept() -> tuple[str, dict[Case, Rows]]:
    """Return `math` and the rows of the file."""
    made, columns, found = "", (), {}
    for line in KEPT.read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word == "math":
            made = rest
        elif word == "columns":
            columns = tuple(rest.split())
        elif word == "case":
            rig, engine, count, whole, ended, changes = rest.split(" ", 5)
        elif word == "each":
            case = Case(rig, changes.strip("'"), engine)
            found[case] = Rows(columns, int(count), whole, ended, tuple(rest.split()))
    return made, found


def write_kept(reason: str, found: dict[Case, Rows]) -> None:
    """Write the file; its first lines say which tool, commit and machine made it."""
    git = ("git", "-C", str(ROOT), "rev-parse", "--short=12", "HEAD")
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    lines = [
        "# Hashes of rows; made by `python -m tests.rigs.row_hashes --record REASON`, which says",
        f"# what they are. Commit {commit}, Python {sys.version.split()[0]}, "
        f"NumPy {np.__version__}.",
        f"# Reason: {reason}",
        f"math {math_of_this_machine()}",
    ]
    columns: tuple[str, ...] = ()
    for case, rows in found.items():
        if rows.columns != columns:
            columns = rows.columns
            lines.append(f"columns {' '.join(columns)}")
        lines.append(
            f"case {case.rig} {case.engine} {rows.count} {rows.all} {rows.ended} '{case.changes}'"
        )
        lines.append(f"each {' '.join(rows.each)}")
    KEPT.write_text("\n".join(lines) + "\n")


def difference(kept: Rows, now: Rows) -> str | None:
    """Return in what two runs of a case differ, or None."""
    if kept == now:
        return None
    if kept.columns != now.columns:
        gone = [name for name in kept.columns if name not in now.columns]
        new = [name for name in now.columns if name not in kept.columns]
        if not gone and not new:
            return "columns: another order"
        both = [name for name in now.columns if name in kept.columns]
        rest = difference(of_columns(kept, both), of_columns(now, both))
        return f"columns: gone {gone}, new {new}; the others: {rest or 'equal'}"
    if kept.count != now.count:
        return f"{now.count} rows, was {kept.count}"
    if kept.ended != now.ended:
        return f"ended with {now.ended}, was {kept.ended}"
    others = [
        name for name, was, is_ in zip(now.columns, kept.each, now.each, strict=True) if was != is_
    ]
    return f"other numbers in {', '.join(others)}"


def of_columns(rows: Rows, names: Sequence[str]) -> Rows:
    """Return what is kept of some columns of a run alone."""
    each = dict(zip(rows.columns, rows.each, strict=True))
    return rows._replace(columns=tuple(names), all="", each=tuple(each[name] for name in names))


def main(arguments: Sequence[str]) -> int:
    """Compare, or record."""
    record = arguments[1] if arguments[:1] == ["--record"] and len(arguments) >= 2 else ""
    only = arguments[2:] or SHIPPED
    if arguments and not record:
        print(__doc__)
        return 2
    made, kept = read_kept() if KEPT.exists() else ("", {})
    if made and made != math_of_this_machine():
        print("C library or NumPy round otherwise here than where the file was made")
        if record and len(arguments) > 2:
            print(f"{KEPT.name} would mix two machines: record all rigs, without naming any")
            return 2
    found = {}
    others = 0
    for case in cases():
        kept_as_it_is = case in kept and case.rig not in only
        found[case] = kept[case] if kept_as_it_is else rows_of(case)
        reported = "new" if case not in kept else difference(kept[case], found[case])
        if reported is not None:
            others += 1
            print(f"{case}: {reported}", flush=True)
    print(f"{len(found)} cases, {others} differ from {KEPT.name}")
    if record:
        write_kept(record, found)
    return 1 if others and not record else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
