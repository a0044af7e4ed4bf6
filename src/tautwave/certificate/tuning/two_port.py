"""Whether a law of positions is passive by its tuning: the sampled two-port and its devices.

The law is asked, not modelled: its own steps run in its own controller, limits and walls apart,
with one sample of one side off by 1. The answers are E(z), from both positions to both efforts;
with the command delays it acts through holds. Devices with dampers b on which anything passive is
hung have sampled impedances of real part at least b in v = (z - 1) x / T. Hence, with
W = diag(b) + T E / (z - 1) at every theta:

(a) the pair is passive as a whole, whatever hand and environment, even one that holds both ends,
    iff the Hermitian part of W is >= 0 (the condition of Colgate and Schenkel for a matrix);
(b) it is stable with every passive hand and environment that do not know of each other iff
    Re w11, Re w22 >= 0 and 2 Re w11 Re w22 >= Re w12 w21 + |w12 w21| (Llewellyn).

Both on a grid of angles. Energies of the slave count in the pair's units.

Sources: Colgate & Schenkel 1997; Llewellyn 1952; Jazayeri & Tavakoli 2011 (a sampled teleoperator
by Llewellyn); the matrix form and the devices' bounds in it are derived here. SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.laws.limit import LimitParams
from tautwave.rig import axis_allowance, coupling_law, make_control, pair_scale
from tautwave.types import CommandDelay, JointState

Complexes = npt.NDArray[np.complex128]
Floats = npt.NDArray[np.float64]

ANGLES = 4096
LONGEST = 20000
"""Slots after which an answer that does not die away is given up."""

QUIET = 1e-10
LOUDEST = 1e15
"""Effort per sample [N m/rad or N/m] beyond which a law runs away by itself."""

WIDE = LimitParams(math.inf, math.inf, 0.0, math.inf, -math.inf, math.inf, 0.0)


class Tuning(NamedTuple):
    """What a law needs of its devices, in the master's units [N m s/rad or N s/m].

    needed: damping of each device, were both the same, for (a); short: what both lack for (a), and
    `short_apart` for (b), 0 or less where it holds; at [Hz]: where (a) is worst. Infinite where no
    damping would do.
    """

    needed: float
    short: float
    short_apart: float
    at: float


def tuning(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Tuning | None:
    """Return what the bare law of a pair needs; None where it is not covered.

    Covered are axes that take effort, on buses served every cycle, whose commands act after whole
    periods, a constant delay (over a network it is not known), and laws that read no effort sensor:
    what one shows is no function of the positions. A law that learns what it renders has no
    response to a sample.
    """
    if rig.link is not None or coupling_law(rig).holding is not None:
        return None
    if reads_sensors(rig, pair, delays):
        return None
    names = [f"{side}.{pair}" for side in ("master", "slave")]
    for name in names:
        whole = delays[name].remainder_s == 0.0 and rig.axis_divisor(name) == 1
        if not whole or rig.axes[name].causality != "impedance":
            return None
    theta = np.linspace(0.0, math.pi, ANGLES + 1)[1:]
    efforts = law_response(rig, pair, delays, theta)
    if efforts is None:
        return None
    weight = 1.0 / pair_scale(rig.coupling.pairs[pair]).power
    left = [axis_allowance(rig, name, delays[name]).coupling_damping for name in names]
    have = np.array(left) * (1.0, weight)
    z = np.exp(1j * theta)
    own = rig.period_s * efforts * np.array([1.0, weight])[:, None] / (z - 1.0)[:, None, None]
    # a common motion of a spring costs nothing: what rounding leaves of it grows as 1 / theta
    lack = -np.linalg.eigvalsh(0.5 * (own + own.conj().swapaxes(1, 2)))[:, 0]
    bound = -np.linalg.eigvalsh(0.5 * (own + own.conj().swapaxes(1, 2)) + np.diag(have))[:, 0]
    worst = int(np.argmax(lack))
    return Tuning(
        needed=_bounded(lack, float(lack[worst])),
        short=_bounded(lack, float(np.max(bound))),
        short_apart=_bounded(lack, _short_apart(own, have)),
        at=float(theta[worst]) / (2.0 * math.pi * rig.period_s),
    )


def reads_sensors(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> bool:
    """Return whether the law of a pair answers what an effort sensor of its axes shows."""
    for side, name in enumerate(("master", "slave")):
        if rig.axes[f"{name}.{pair}"].effort_sensor is not None:
            answer = _answer(rig, pair, delays, side, felt=True)
            if answer is None or bool(np.any(answer != 0.0)):
                return True
    return False


def _bounded(lack: Floats, value: float) -> float:
    """Return a need, infinite where it still grows towards theta = 0."""
    grows = lack[0] > 1.5 * max(float(lack[3]), 0.0) and lack[0] >= float(np.max(lack))
    return math.inf if grows and lack[0] > 0.0 else value


def _short_apart(own: Complexes, have: Floats) -> float:
    """Return the damping that both devices lack for Llewellyn's condition [N m s/rad or N s/m]."""
    product = own[:, 0, 1] * own[:, 1, 0]
    aside = product.real + np.abs(product)
    one, two = own[:, 0, 0].real + have[0], own[:, 1, 1].real + have[1]
    # 2 (one + s) (two + s) = aside, the greater root; and both factors >= 0
    middle = 0.5 * (one + two)
    root = -middle + np.sqrt(0.25 * (one - two) ** 2 + 0.5 * aside)
    return float(np.max(np.maximum(root, np.maximum(-one, -two))))


def law_response(
    rig: Rig, pair: str, delays: Mapping[str, CommandDelay], theta: Floats
) -> Complexes | None:
    """Return E at e^(j theta), of shape (n, 2, 2): efforts that act per positions, by side.

    None if an answer does not die away.
    """
    found = np.empty((len(theta), 2, 2), np.complex128)
    for side in (0, 1):
        answer = _answer(rig, pair, delays, side)
        if answer is None:
            return None
        slots = np.arange(len(answer))
        for first in range(0, len(theta), 512):
            part = slice(first, first + 512)
            found[part, :, side] = np.exp(-1j * np.outer(theta[part], slots)) @ answer
    for row, name in enumerate((f"master.{pair}", f"slave.{pair}")):
        found[:, row, :] *= np.exp(-1j * theta * delays[name].periods)[:, None]
    return found


def _answer(
    rig: Rig, pair: str, delays: Mapping[str, CommandDelay], side: int, *, felt: bool = False
) -> npt.NDArray[np.float64] | None:
    """Return both efforts after one sample of a side was off by 1, of shape (n, 2).

    It is the position's, or, if it is `felt`, the external effort's.
    """
    bare = rig.model_copy(update={"coupling": rig.coupling.model_copy(update={"account": None})})
    control = make_control(bare, delays, 2 * LONGEST)
    control.params = [
        p._replace(
            site=p.site._replace(limit=WIDE, has_wall=False, compensates=False, lightens=False),
            ceiling=math.inf,
        )
        for p in control.params
    ]
    control.run = control.run._replace(engage_cycles=0)
    q = control.pairs[control.pair_names.index(pair)]
    ends = (q.master, q.slave)
    efforts: list[tuple[float, float]] = []
    greatest, still = 0.0, 0
    patience = 2 * rig.delay_samples + max(delay.periods for delay in delays.values()) + 8
    for slot in range(LONGEST):
        for which in range(len(control.params)):
            off = 1.0 if slot == 1 and which == ends[side] else 0.0
            zero = control.params[which].sensor_zero
            shown = JointState(0.0 if felt else off, math.nan, zero + off * felt, True, 0)
            control.take(which, shown, slot)
        control.step(slot, 0)
        if slot == 0:
            continue
        now = tuple(control.axes[end].port_effort for end in ends)
        efforts.append((now[0], now[1]))
        size = max(abs(now[0]), abs(now[1]))
        if not size <= LOUDEST:
            return None
        greatest = max(greatest, size)
        still = still + 1 if size <= QUIET * greatest else 0
        if still > patience:
            return np.array(efforts)
    return None
