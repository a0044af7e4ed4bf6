"""What the hand feels of the rig of a run, as the operator's two figures, for page and comparison.

They are of the rig, not of this run: `tautwave.certificate.haptics.feel` simulates it.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from tautwave.certificate.haptics.feel import Feel, rig_feel
from tautwave.config import parse_rig
from tautwave.errors import ConfigError
from tautwave.report.run.rundir import Run
from tautwave.report.units import quantity
from tautwave.tables import Table


def feel_of(run: Run) -> dict[str, Feel]:
    """Return the figures by pair; none of a rig that cannot be read here, or has no figures."""
    return _simulated(run.rig_text) if run.rig_text else {}


@lru_cache(maxsize=8)
def _simulated(text: str) -> dict[str, Feel]:
    """Return the figures of a kept rig, which names other files by their whole path."""
    try:
        rig = parse_rig(text, Path("rig.yaml"))
    except ConfigError:
        return {}
    return {one.pair: one for one in rig_feel(rig)[0]}


def feel_table(feels: dict[str, Feel]) -> Table:
    """Return the figures of a rig as a table."""
    rows: list[tuple[str, ...]] = []
    for name, one in feels.items():
        missing = "–" if not one.ended else "; ".join(one.ended)
        felt = missing if one.stiffness is None else quantity(one.stiffness, _stiffness(one), 3)
        drag = missing if one.drag is None else quantity(one.drag, _effort(one), 3)
        speed = quantity(one.speed, "rad/s" if one.rotary else "m/s", 3)
        wall, own = quantity(one.wall, _stiffness(one), 3), quantity(one.own, _effort(one), 3)
        rows.append((name, wall, felt, drag, speed, own))
    return Table(
        "What the operator feels of this rig",
        ("pair", "wall", "feels like", "free drag", "at", "the master's own friction"),
        tuple(rows),
        "Simulated with the rig's law, delay, friction and noise, whatever the run did: a slow "
        "hand presses a stiff wall at the slave, and moves the master to and fro.",
    )


def feel_values(feels: dict[str, Feel], pair: str) -> dict[str, tuple[float | None, str]]:
    """Return the two figures of a pair, by what they are, each with its unit."""
    one = feels.get(pair)
    if one is None:
        return {}
    return {
        f"felt stiffness of {one.wall:g} {_stiffness(one)}": (one.stiffness, _stiffness(one)),
        "free drag": (one.drag, _effort(one)),
    }


def _effort(one: Feel) -> str:
    return "N m" if one.rotary else "N"


def _stiffness(one: Feel) -> str:
    return "N m/rad" if one.rotary else "N/m"
