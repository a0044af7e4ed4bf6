"""A spring without mass, noise or delay between the levers, at a rigid wall: what is left at least.

While the hand is beyond the wall the levers are apart by what the slave does not press. A spring of
K leaves the gap K_w / (K_w + K) of the way into a wall of K_w, and a motor at its limit F leaves
F / K_w less than the way. What the spring presses follows the hand, and its part above 20 Hz is no
chatter of any law, but is counted with it. A spring that gives way slower (a lag) presses without
that part, and is late; a passive line with the compliance 1 / K and the lag tau weighs at least
K tau**2 in the hand (docs/explanation/standing-offset.md).
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from tautwave.bench.result import Table, Value
from tests.lab.port.hands import PERIOD, Hand
from tests.lab.port.tracking import RELEASED_S, SETTLED_S, chatter, rms

Float = npt.NDArray[np.float64]

WALL, LIMIT = 250.0, 1.125
"""The bench's rigid contact [N m/rad], which begins at 0, and its motors' limit [N m]."""

STIFFNESSES = (8.1, 27.0, 50.0, 100.0, 150.0, 250.0, math.inf)
"""Of the spring [N m/rad]: the laboratory's, about that of auto, up to none of the gap left."""

CORNERS = (math.inf, 50.0, 20.0, 5.0)
"""Of a spring that gives way slowly [Hz]."""


def pressed(way: Float, stiffness: float, corner: float) -> Float:
    """Return what a spring between levers presses on the wall, the hand moving as given.

    Parameters
    ----------
    way : ndarray, shape (N,)
        Of the hand beyond the wall, negative outside [rad].
    stiffness : float
        Of the spring [N m/rad].
    corner : float
        Of its lag of first order [Hz].

    Returns
    -------
    ndarray, shape (N,)
        Effort [N m]; none outside, where the slave follows at once.
    """
    share = 1.0 / (1.0 / stiffness + 1.0 / WALL)
    if math.isinf(corner):
        return np.clip(share * way, 0.0, LIMIT)
    step = -math.expm1(-math.tau * corner * PERIOD * (stiffness / share))
    effort, efforts = 0.0, np.zeros_like(way)
    for at, beyond in enumerate(way.tolist()):
        effort += step * (share * beyond - effort)
        effort = min(max(effort, 0.0), LIMIT)
        efforts[at] = effort
    return efforts


def left(hand: Hand, stiffness: float, corner: float) -> tuple[float, float]:
    """Return what is left between the levers [rad], and the effort above 20 Hz [N m]."""
    part = slice(round(SETTLED_S / PERIOD), len(hand.positions) - round(RELEASED_S / PERIOD))
    efforts = pressed(hand.positions, stiffness, corner)
    gaps = np.where((hand.positions > 0.0) | (efforts > 0.0), hand.positions - efforts / WALL, 0.0)
    return rms(gaps[part]), chatter(efforts[part])


def ideal_tables(hands: Sequence[Hand], labs: Mapping[str, float]) -> list[Table]:
    """Return what springs leave of the recorded error at a rigid wall, for how much chatter.

    Parameters
    ----------
    hands : sequence of Hand
        At the wall, recorded; others are left out.
    labs : mapping of str to float
        Effort above 20 Hz of the laboratory's law on each hand [N m].
    """
    part = slice(round(SETTLED_S / PERIOD), -round(RELEASED_S / PERIOD))
    known = [(hand, rms(hand.recorded[part])) for hand in hands if hand.recorded is not None]
    rows: list[list[Value]] = []
    for stiffness in STIFFNESSES if known else ():
        for corner in CORNERS if math.isfinite(stiffness) else CORNERS[:1]:
            each = [left(hand, stiffness, corner) for hand, _ in known]
            errors = [gap / by for (gap, _), (_, by) in zip(each, known, strict=True)]
            louds = [
                loud / labs[hand.name] for (_, loud), (hand, _) in zip(each, known, strict=True)
            ]
            weight = 0.0
            if math.isfinite(corner):
                weight = stiffness / (math.tau * corner) ** 2
            middle, worst = statistics.median(errors), max(errors)
            typical = errors.index(statistics.median_low(errors))
            shown = [f"{it:g}" if math.isfinite(it) else "none" for it in (stiffness, corner)]
            shown[0] = shown[0].replace("none", "rigid")
            rows.append([*shown, middle, worst, louds[typical], 1e3 * weight])
    return [
        Table(
            "Rigid wall, master imposed: a spring without mass, noise or delay",
            "Error over the recorded (median, worst), effort above 20 Hz over the laboratory's on "
            "the hand of that median; a lag of the spring, and the inertia that a passive line "
            f"with it adds to the hand. Wall {WALL:g} N m/rad, motors {LIMIT:g} N m.",
            ("stiffness", "lag_hz", "error", "worst", "chatter", "inertia_g_m2"),
            rows,
        )
    ]
