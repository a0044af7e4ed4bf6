"""What a law of positions needs of its devices: clipped anyhow, never clipped, or apart.

The law's own steps are asked (`answers`), limits and walls apart; with the command delays its
answers are efforts that act. `analysis.ports.clipped_spring` has what the pair needs as a whole,
whatever hand and environment, even one that holds both ends. With a hand and an environment that do
not know of each other, and W = diag(d) + T E / (z - 1), it is stable if Re w11, Re w22 >= 0 and
2 Re w11 Re w22 >= Re w12 w21 + |w12 w21| (Llewellyn), here at many angles.

Sources: Colgate & Schenkel 1997; Llewellyn 1952; Jazayeri & Tavakoli 2011 (a sampled teleoperator
by Llewellyn). Energies of the slave count in the pair's units. SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.clipped_spring import (
    POINTS,
    clipped_lack,
    closed_answers,
    linear_lack,
    spring_of,
)
from tautwave.certificate.tuning.answers import asked_of_law, reads_sensors
from tautwave.config import Rig
from tautwave.rig import axis_allowance, coupling_law, pair_scale
from tautwave.types import CommandDelay

Floats = npt.NDArray[np.float64]
Delays = Mapping[str, CommandDelay]


class Tuning(NamedTuple):
    """What a law needs of its devices, in the master's units [N m s/rad or N s/m].

    needed, short: damping of each device, were both the same, and what both lack, for a pair that
    is never clipped; `clipped_needed`, `clipped_short`: clipped anyhow; `short_apart` for hand and
    environment apart; 0 or less where it holds, infinite where no damping would do. at [Hz]: where
    `needed` is worst. stiffness of the spring [N m/rad or N/m]; answers: sum |a[j]| by end and by
    end that was off. hears: what is asked depends on what was sent.
    """

    needed: float
    short: float
    short_apart: float
    at: float
    clipped_needed: float
    clipped_short: float
    stiffness: float
    answers: tuple[tuple[float, float], tuple[float, float]]
    hears: bool


def tuning(rig: Rig, pair: str, delays: Delays) -> Tuning | None:
    """Return what the bare law of a pair needs; None where it is not covered.

    Covered are axes that take effort, on buses served every cycle, a constant delay (over a network
    it is not known), and laws that read no effort sensor: what one shows is no function of the
    positions. A law that learns what it renders has no response to a sample.
    """
    if rig.link is not None or coupling_law(rig).holding is not None:
        return None
    names = [f"{side}.{pair}" for side in ("master", "slave")]
    for name in names:
        if rig.axis_divisor(name) != 1 or rig.axes[name].causality != "impedance":
            return None
    if reads_sensors(rig, pair, delays):
        return None
    asked = asked_of_law(rig, pair, delays)
    if asked is None:
        return None
    answers, rest, hears = asked.to_sample, 0.0, bool(np.any(asked.to_effort != 0.0))
    if hears:
        closed = closed_answers(asked)
        if closed is None:
            return None
        answers, rest = closed
    acting = _delayed(answers, [delays[name].periods for name in names])
    one, two = (delays[name].remainder_s / rig.period_s for name in names)
    spring = spring_of(acting, rig.period_s, (one, two), rest)
    have = coupling_damping(rig, pair, delays)
    whole = one == two == 0.0
    linear = spring if whole else None
    worst = None if linear is None else linear_lack(linear)
    ends = not hears and not np.any(answers[-1])
    clipped = spring if ends else None
    sums = np.sum(np.abs(answers), axis=0)
    return Tuning(
        needed=math.inf if worst is None else worst.damping,
        short=math.inf if linear is None else linear_lack(linear, have).damping,
        short_apart=_short_apart(acting, rig.period_s, np.array(have)) if whole else math.inf,
        at=0.0 if worst is None else worst.angle / (2.0 * math.pi * rig.period_s),
        clipped_needed=math.inf if clipped is None else clipped_lack(clipped),
        clipped_short=math.inf if clipped is None else clipped_lack(clipped, have),
        stiffness=0.0 if spring is None else spring.stiffness,
        answers=((sums[0, 0], sums[0, 1]), (sums[1, 0], sums[1, 1])),
        hears=hears,
    )


def coupling_damping(rig: Rig, pair: str, delays: Delays) -> tuple[float, float]:
    """Return what both devices have left for their coupling, in the master's units."""
    scale = pair_scale(rig.coupling.pairs[pair])
    names = [f"{side}.{pair}" for side in ("master", "slave")]
    master, slave = (axis_allowance(rig, name, delays[name]).coupling_damping for name in names)
    return master, slave * scale.scale / scale.force_scale


def _delayed(answers: Floats, late: list[int]) -> Floats:
    """Return answers as efforts that act, each end's so many periods later."""
    out = np.zeros((len(answers) + max(late), 2, 2))
    for end, periods in enumerate(late):
        out[periods : periods + len(answers), end] = answers[:, end]
    return out


def _short_apart(acting: Floats, period: float, have: Floats) -> float:
    """Return the damping that both devices lack for Llewellyn's condition [N m s/rad or N s/m]."""
    points = 1 << max(12, (POINTS * (len(acting) + 1) - 1).bit_length())
    efforts = np.fft.rfft(acting, points, axis=0)[1:]
    z = np.exp(2j * np.pi * np.arange(1, len(efforts) + 1) / points)
    own = period * efforts / (z - 1.0)[:, None, None]
    product = own[:, 0, 1] * own[:, 1, 0]
    aside = product.real + np.abs(product)
    one, two = own[:, 0, 0].real + have[0], own[:, 1, 1].real + have[1]
    # 2 (one + s) (two + s) = aside, the greater root; and both factors >= 0
    middle = 0.5 * (one + two)
    root = -middle + np.sqrt(0.25 * (one - two) ** 2 + 0.5 * aside)
    lack = np.maximum(root, np.maximum(-one, -two))
    grows = lack[0] > 1.5 * max(float(lack[3]), 0.0) and lack[0] >= float(np.max(lack))
    return math.inf if grows and lack[0] > 0.0 else float(np.max(lack))
