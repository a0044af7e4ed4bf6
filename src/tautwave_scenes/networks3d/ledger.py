"""The energy of a 3D network, in the account of `networks.ledger`."""

from __future__ import annotations

from tautwave_scenes.networks.ledger import Ledger, add_links
from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.straining import strain_energies


def take_ledger3d(s: Arrays3d) -> Ledger:
    """Return the present energies of a network."""
    return Ledger(*tally3d(s))


def kinetic_energy(s: Arrays3d, m: int) -> float:
    """Return the kinetic energy of a mass [J]."""
    vx = s.v[3 * m]
    vy = s.v[3 * m + 1]
    vz = s.v[3 * m + 2]
    return float(0.5 * s.mass[m] * (vx * vx + vy * vy + vz * vz))


def tally3d(s: Arrays3d) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the numbers of a `Ledger`, added up in order; compiled by numba as well."""
    kinetic = 0.0
    lifted = 0.0
    dragged = 0.0
    mass_numeric = 0.0
    pumped = 0.0
    for m in range(s.count[0]):
        kinetic += kinetic_energy(s, m)
        for c in range(3 * m, 3 * m + 3):
            lifted += s.weight[c] * s.x[c]
        dragged += s.dragged[m]
        mass_numeric += s.mass_numeric[m]
        pumped += s.pumped[m]
    energies = add_links(s, kinetic, lifted, dragged, mass_numeric, pumped)
    if s.elements.size[0] == 0:
        return energies
    kept, dissipated = strain_energies(s)
    return (
        energies[0],
        energies[1] + kept,
        energies[2],
        energies[3] + dissipated,
        energies[4],
        energies[5],
        energies[6],
        energies[7],
    )
