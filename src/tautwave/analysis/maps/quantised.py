"""Planes of a quantised wall's stiffness: where an adversary gains energy, simulated and predicted.

Nothing of the rule is used in the simulation: an operator moves the device to and fro around an
encoder edge, once per sample at constant speed; the live wall law answers the quantised position
and its effort is held. What the wall gives against what friction takes is exact per period.

Source of the prediction: Abbott & Okamura, IEEE Trans. Robotics 21(5) 952, 2005, in
`tautwave.analysis.walls.rules.quantised_stiffness`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from tautwave.analysis.maps.stability import GROWING, ROUNDS, Column, StabilityPlane
from tautwave.analysis.walls.rules import quantised_stiffness
from tautwave.errors import ConfigError
from tautwave.laws.wall import WallParams, wall_depth, wall_effort
from tautwave.models.encoder import quantise

Floats = npt.NDArray[np.float64]

MARGIN = 0.1
"""Part of a step by which a long stroke passes its outer edges: far above rounding."""
WITHIN = tuple(10.0 ** (0.5 * power) for power in range(-20, 0))
"""Strokes around one edge, in steps: the shorter, the less viscous friction counts."""
ACROSS = tuple(round(10.0 ** (0.5 * power)) for power in range(25))
"""Strokes over many edges, in steps: the longer, the less Coulomb friction counts."""


def cycle_energy(
    stiffness: float,
    damping: float,
    coulomb: float,
    period: float,
    quantum: float,
    low: float,
    high: float,
) -> tuple[float, float]:
    """Return what a wall gives and what friction takes in a cycle low - high - low [J].

    Parameters
    ----------
    stiffness, damping, coulomb : float
        K of the wall [N/m or N m/rad], friction b and c of the device.
    period, quantum : float
        T [s] and encoder step Q [m or rad].
    low, high : float
        Positions at the samples; the wall begins at the reading of `low`, so that nothing cancels.
    """
    law = WallParams(quantise(low, quantum), 1.0, stiffness, 0.0, controlled=False)
    given = lost = 0.0
    for here, there in itertools.pairwise((low, high, low)):
        moved = there - here
        given -= wall_effort(law, wall_depth(law, quantise(here, quantum)), 0.0) * moved
        lost += damping * moved * moved / period + coulomb * abs(moved)
    return given, lost


def adversary_gain(
    stiffness: float, damping: float, coulomb: float, period: float, quantum: float
) -> float:
    """Return the greatest energy a cycle returns per energy it costs [1]; a gain above 1.

    The best of strokes from 1e-10 to 1e12 encoder steps; inf without friction.
    """
    edge = 0.5 * quantum
    motions = [(edge - 0.5 * part * quantum, edge + 0.5 * part * quantum) for part in WITHIN]
    aside = MARGIN * quantum
    motions += [(edge - aside, edge + count * quantum + aside) for count in ACROSS]
    best = 0.0
    for low, high in motions:
        given, lost = cycle_energy(stiffness, damping, coulomb, period, quantum, low, high)
        if given > 0.0:
            best = max(best, given / lost if lost > 0.0 else math.inf)
    return best


def paying_stiffness(
    damping: float, coulomb: float, period: float, quantum: float, low: float, high: float
) -> float:
    """Return the K between two at which a cycle begins to gain energy, bisected [N/m or N m/rad].

    NaN if it already gains at `low` or does not at `high`.
    """

    def pays(stiffness: float) -> bool:
        return adversary_gain(stiffness, damping, coulomb, period, quantum) > 1.0

    if pays(low) or not pays(high):
        return math.nan
    for _ in range(ROUNDS):
        middle = math.sqrt(low * high)
        if pays(middle):
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)


def quantised_plane(
    columns: Sequence[Column],
    stiffness: Floats,
    progress: Callable[[float], None] | None = None,
) -> StabilityPlane:
    """Return predicted and simulated limits of prompt springs read with an encoder step.

    `passive` is Abbott and Okamura's limit, `simulated` where the adversary's motion begins to
    pay, `growth` ln of its gain per cycle; `stable` is nan, since no hand is in it.

    Raises
    ------
    ConfigError
        No columns, stiffnesses that do not rise from above 0, or a wall that is not a prompt
        spring with an encoder step.
    """
    if not columns or len(stiffness) < 2 or stiffness[0] <= 0.0 or np.any(np.diff(stiffness) <= 0):
        raise ConfigError("a plane needs columns, and stiffnesses that rise from above 0")
    for column in columns:
        late = column.wall.delay + column.device.command_delay
        if late != 0.0 or column.wall.damping != 0.0 or column.quantum <= 0.0:
            raise ConfigError(
                "the quantised limit is of springs without damping and delay, with an encoder step"
            )
    passive, simulated, growths = [], [], []
    for at, column in enumerate(columns):
        device = (column.own_damping, column.coulomb, column.wall.period, column.quantum)
        passive.append(quantised_stiffness(*device))
        gains = np.array([adversary_gain(float(value), *device) for value in stiffness])
        growths.append(np.log(np.maximum(gains, 1e-300)))
        fine = growths[-1] <= GROWING
        place = math.nan
        if fine[0] and not fine[-1]:
            first = int(np.argmin(fine))
            place = paying_stiffness(*device, float(stiffness[first - 1]), float(stiffness[first]))
        simulated.append(place)
        if progress is not None:
            progress((at + 1) / len(columns))
    x = np.array([column.x for column in columns])
    predicted = np.array(passive)
    return StabilityPlane(
        x,
        stiffness,
        predicted,
        np.full(len(columns), math.nan),
        np.array(simulated),
        np.array(growths).T,
        stiffness[:, None] <= predicted,
        tuple(
            (float(at), place, limit)
            for at, place, limit in zip(x, simulated, passive, strict=True)
            if not math.isnan(place)
        ),
    )
