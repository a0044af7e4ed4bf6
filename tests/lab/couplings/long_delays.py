"""`python -m tests.lab couplings --delays`: what is left of a contact behind 0.2 to 0.5 s.

On the lever as its recordings identify it, a hand that holds it moves in and out of what the slave
touches. Tracking is of the motion that had arrived: x_m(t - tau) - x_s(t).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.fast_motion import fast_share
from tautwave.analysis.felt import slope
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.config import Rig
from tautwave.config.load import parse_rig
from tautwave.rig import command_delays
from tautwave.session.facts import port_claims
from tautwave.simulation import simulate
from tests.lab.couplings.measure import SIDES
from tests.lab.couplings.rigs import BENCH, HAND, RIG

Floats = npt.NDArray[np.float64]
Tell = Callable[[str], None]

DELAYS = (0.2, 0.3, 0.5)
SECONDS = 15.0
SETTLED_S = 5.0
"""Until then a coupling may learn, and fill its tanks."""

LEVER = BENCH._replace(lower=1.0e-3, damping=0.01, coulomb=0.02, noise=1.5e-5)
COULOMB = ", coulomb: {value: 0.025, lower: 0.02, source: identified}"
TRUE = LEVER._replace(damping=0.015, coulomb=0.025)

CASES: Mapping[str, tuple[str, str]] = {
    "wave, b 0.1": (
        "law: wave, pairs: {lever: {wave_impedance: 0.1, wave_filter_hz: 200, pole_master: 0.5, "
        "pole_slave: 0.5",
        "null",
    ),
    "wave, b 0.03": (
        "law: wave, pairs: {lever: {wave_impedance: 0.03, wave_filter_hz: 200, pole_master: 0.5, "
        "pole_slave: 0.5",
        "null",
    ),
    "position, K 20": ("law: position, pairs: {lever: {stiffness: 20, damping: 0.1", "{}"),
    "position, K 2": ("law: position, pairs: {lever: {stiffness: 2, damping: 0.1", "{}"),
    "mediated": ("law: mediated, pairs: {lever: {", "{}"),
    "mediated, tank 0.2 J": ("law: mediated, pairs: {lever: {", "{tank: 0.2}"),
}
"""Blocks up to more keys of the pair, and accounts."""

SURFACES: Mapping[str, tuple[float, float]] = {
    "free": (math.inf, 0.0),
    "soft": (0.0, 5.0),
    "rigid": (0.05, 200.0),
}
"""Where a wall begins [rad], and its stiffness [N m/rad]."""


class Contact(NamedTuple):
    """What was left of a contact, after the coupling had settled.

    behind: rms of what the slave is off the motion that had arrived [rad]; drag: rms of the hand's
    effort out of contact [N m]; felt: slope of the hand's effort over its position while it is
    beyond the surface [N m/rad]; beyond: how far it got [rad]; fast: share of motion power above
    8 Hz [1]; made: most energy that both motors had given [J]; whether the run ended early.
    """

    behind: float
    drag: float
    felt: float
    beyond: float
    fast: float
    made: float
    ended: bool


def long_rig(case: str, delay: float, surface: str, seconds: float = SECONDS) -> Rig:
    """Return the lever with a law of `CASES` and a surface of `SURFACES`."""
    block, account = CASES[case]
    at, stiffness = SURFACES[surface]
    contact = "{type: free}"
    if stiffness > 0.0:
        contact = f"{{type: wall, position: {at!r}, stiffness: {stiffness!r}}}"
    text = RIG.format(
        name="long-delay",
        rate=2000.0,
        seconds=seconds,
        seed=2,
        late=0.0,
        master=LEVER.axis + COULOMB,
        slave=LEVER.axis + COULOMB,
        true_master=TRUE.truth,
        true_slave=TRUE._replace(inertia=1.7e-3).truth,
        delay=delay,
        account=account,
        law=block,
        reference=HAND,
        contact=contact,
        missing=0.0,
        overrun=0.0,
    )
    return parse_rig(text, Path("long-delay.yaml"))


def claimed(rig: Rig) -> float:
    """Return what both ends claim to give at most, an end that begins with energy included [J]."""
    each: dict[str, float] = port_claims(rig, "lever", command_delays(rig))["claim_j"]
    return sum(each.values())


def contact_left(
    at: Mapping[str, Floats], delay: float, surface: float, period: float, *, ended: bool
) -> Contact:
    """Return the measures of a run, from its columns by name."""
    late = round(delay / period)
    first = round(SETTLED_S / period)
    master, slave = (at[f"true.{side}.lever.position"] for side in SIDES)
    hand = at["true.master.lever.hand_effort"][first:]
    there = master[first:]
    made = sum(at[f"plant.{side}.lever.motor_work"] for side in SIDES)
    if len(there) == 0:
        nothing = math.nan
        return Contact(nothing, nothing, nothing, nothing, nothing, float(np.max(made)), ended)
    pressed = there > surface
    apart = master[first - late : len(master) - late] - slave[first:]
    return Contact(
        behind=float(np.sqrt(np.mean(apart**2))),
        drag=float(np.sqrt(np.mean(hand[~pressed] ** 2))),
        felt=slope(there[pressed], hand[pressed]),
        beyond=max(0.0, float(np.max(there)) - surface),
        fast=max(fast_share(each[first:], period) for each in (master, slave)),
        made=max(0.0, float(np.max(made))),
        ended=ended,
    )


def run_long(case: str, delay: float, surface: str, engine: str = "compiled") -> Contact:
    """Simulate a law behind a delay and measure it."""
    rig = long_rig(case, delay, surface)
    run = simulate(rig, engine=engine)
    at = {name: run.data[:, place] for place, name in enumerate(run.columns)}
    return contact_left(at, delay, SURFACES[surface][0], rig.period_s, ended=run.error is not None)


def long_delays(*, tell: Tell, delays: Sequence[float] = DELAYS) -> Suite:
    """Run every law behind every delay and against every surface.

    Parameters
    ----------
    tell : callable
        Called with the name of each law as it starts.
    delays : sequence of float
        One way [s].
    """
    found: dict[tuple[str, float, str], Contact] = {}
    for case in CASES:
        tell(case)
        for delay in delays:
            for surface in SURFACES:
                found[case, delay, surface] = run_long(case, delay, surface)
    rows: list[list[Value]] = [
        [
            case,
            1e3 * delay,
            surface,
            1e3 * it.behind,
            1e3 * it.drag,
            None if math.isnan(it.felt) else it.felt,
            1e3 * it.beyond if surface != "free" else None,
            f"{it.fast:.0%}",
            1e3 * it.made,
            "early" if it.ended else "",
        ]
        for (case, delay, surface), it in found.items()
    ]
    table = Table(
        "Couplings behind long delays",
        "The lever as identified, a hand for 15 s, of which 5 count for nothing. Slave behind the "
        "motion that had arrived, the hand's effort out of contact, the slope of its effort over "
        "its position beyond the surface (rigid: 200 N m/rad, soft: 5), how far it got there.",
        ("coupling", "delay_ms", "surface", "behind_mrad", "drag_mNm", "felt_Nm/rad", "beyond_mrad",
         "above 8 Hz", "made_mJ", "ended"),
        rows,
    )  # fmt: skip
    goals = []
    for delay in delays:
        felt = {case: found[case, delay, "rigid"].felt for case in CASES}
        others = max(value for case, value in felt.items() if "mediated" not in case)
        best = felt["mediated"]
        goals.append(
            Goal(f"felt of a rigid wall over other laws, {1e3 * delay:g} ms", 5.0, "times",
                 best / others if others > 0.0 else math.inf, at_least=True)
        )  # fmt: skip
    share = max(it.made / claimed(long_rig(*which)) for which, it in found.items())
    goals.append(Goal("energy made in accounts and ports, over what they claim", 1.0, "1", share))
    return Suite("long delays", [table], goals)
