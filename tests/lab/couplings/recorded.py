"""Law `position` with a laboratory's gains on its recorded hands: how credible the bench is."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from tautwave.simulation import simulate
from tests.lab.port.hands import LEAD_S, PERIOD, Hand, recorded_hands
from tests.lab.port.rigs import CONTACTS, IMPOSED, bench_rig
from tests.lab.port.tracking import RELEASED_S, SETTLED_S, rms

GAINS = {"ad": (8.1, 0.091), "be": (15.2, 0.083), "cf": (25.4, 0.121)}
"""Slave's law of the laboratory's controllers, by regression of its logged commands: two of each
[N m/rad, N m s/rad]."""

COULOMB, VISCOUS = 0.03, 0.015
"""Friction of the levers in the recordings, by torque balance [N m, N m s/rad]."""

MET = {**CONTACTS, "spring": "{type: spring, stiffness: 4.5, position: -0.09}"}
"""What the slave meets; the spring as torque balance finds it, always attached."""


class Likeness(NamedTuple):
    """rms of master minus slave [rad]: of the recording, and of our simulation of it."""

    name: str
    recorded: float
    ours: float

    @property
    def ratio(self) -> float:
        """Ours over the recorded."""
        return self.ours / self.recorded


def controllers(name: str) -> str:
    """Return the pair of controllers of whose recordings this is one, by its name; else none."""
    letter = re.search(r"(?:^|[^a-z])([a-f])(?=[^a-z])", name.lower())
    return next((pair for pair in GAINS if letter is not None and letter[1] in pair), "")


def likeness(hand: Hand, folder: Path, engine: str = "compiled") -> Likeness:
    """Impose a recorded motion on the simulated bench, without noise."""
    assert hand.recorded is not None
    stiffness, damping = GAINS[controllers(hand.name)]
    law = f"{{law: position, pairs: {{lever: {{stiffness: {stiffness}, damping: {damping}}}}}}}"
    reference = f"{{type: recording, file: {hand.write(folder)}, column: hand, repeat: false}}"
    rig = bench_rig(
        law,
        reference,
        MET[hand.contact],
        noise=0.0,
        seconds=hand.seconds,
        grip=IMPOSED,
        coulomb=COULOMB,
        viscous=VISCOUS,
    )
    run = simulate(rig, engine=engine)
    first, last = (round(it / PERIOD) for it in (SETTLED_S, RELEASED_S))
    lead, count = round(LEAD_S / PERIOD), len(hand.positions)
    ours = rms(run["lever.position_error"][lead + first : lead + count - last])
    return Likeness(hand.name, rms(hand.recorded[first : count - last]), ours)


def likenesses(recordings: Path) -> list[Likeness]:
    """Return every recording of a folder that was made with one of the controllers."""
    hands = [hand for hand in recorded_hands(recordings) if controllers(hand.name)]
    with TemporaryDirectory() as folder:
        return [likeness(hand, Path(folder)) for hand in hands]


def median_ratio(found: list[Likeness]) -> float:
    """Return the median of ours over the recorded [1], nan of none."""
    if not found:
        return float("nan")
    return float(np.median([each.ratio for each in found]))
