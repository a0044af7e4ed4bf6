"""How a pair's slave maps to its master: scale, power, offset."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.config import Pair as PairKeys
from tautwave.config import Rig


class PairScale(NamedTuple):
    """How slave units map to master units: x_slave = sign * scale * x_master + offset.

    `power` is the energy of the slave device per energy of the pair (force_scale * scale).
    """

    scale: float
    force_scale: float
    sign: float
    power: float


def pair_scale(keys: PairKeys) -> PairScale:
    """Return the mapping from slave units to the pair's."""
    force = keys.effective_force_scale
    return PairScale(keys.position_scale, force, float(keys.sign), force * keys.position_scale)


def end_energy(rig: Rig, axis_name: str, energy: float) -> float:
    """Return an energy of a pair [J] as the device at one of its ends gives it."""
    side, _, pair = axis_name.partition(".")
    return energy * (pair_scale(rig.coupling.pairs[pair]).power if side == "slave" else 1.0)


def slave_offset(keys: PairKeys) -> tuple[float | None, float]:
    """Return the slave position for master 0 (None: set at engagement), and the tolerance.

    The rig file gives both in master units; here they are in the slave's.
    """
    tolerance = math.inf
    if keys.engage_tolerance is not None:
        tolerance = keys.engage_tolerance * keys.position_scale
    if isinstance(keys.offset, str):
        return None, tolerance
    return -keys.sign * keys.position_scale * keys.offset, tolerance


def scaled(rig: Rig, factor: float) -> Rig:
    """Return a rig with the `position_scale` of all pairs multiplied by `factor` [1]."""
    pairs = {
        name: pair.model_copy(update={"position_scale": factor * pair.position_scale})
        for name, pair in rig.coupling.pairs.items()
    }
    coupling = rig.coupling.model_copy(update={"pairs": pairs})
    name = f"{rig.name} at scale {factor:g}"
    return rig.model_copy(update={"coupling": coupling, "name": name})
