"""The energy of a network of points, in the account of `tautwave.scene.ledger`."""

from __future__ import annotations

from tautwave.scene.ledger import Ledger
from tautwave.scene.space.arrays import SpaceArrays


def take_space_ledger(s: SpaceArrays) -> Ledger:
    """Return the energies of a network as it is now."""
    masses = range(s.count[0])
    links = range(s.count[2])
    return Ledger(
        kinetic=sum(kinetic_energy(s, m) for m in masses),
        stored=sum(s.stored[i] for i in links),
        lifted=-sum(s.weight[c] * s.x[c] for c in range(3 * s.count[0])),
        lost=sum(s.lost[i] for i in links) + sum(s.dragged[m] for m in masses),
        made=sum(s.made[i] for i in links),
        numeric=sum(s.numeric[i] for i in links) + sum(s.mass_numeric[m] for m in masses),
        port_work=sum(s.port_work[p] for p in range(s.count[1])),
        pumped=sum(s.pumped[m] for m in masses),
    )


def kinetic_energy(s: SpaceArrays, m: int) -> float:
    """Return the kinetic energy of a mass [J]."""
    vx, vy, vz = s.v[3 * m], s.v[3 * m + 1], s.v[3 * m + 2]
    return float(0.5 * s.mass[m] * (vx * vx + vy * vy + vz * vz))
