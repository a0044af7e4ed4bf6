"""The energy of a network, element by element, and whether the account closes."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.scene.compiling import Arrays


class Ledger(NamedTuple):
    """Energies of a network [J]; all but the first three are sums since the start.

    `kinetic` of the masses, `stored` in links, `lifted` against gravity; `lost` in dampers,
    friction, plastic links and contacts; `made` by negative dampers and sources; `numeric` made by
    a scheme that holds forces (discrete gradients make none); `port_work` done by the ports,
    `pumped` by outside forces. `gross` is the sum of what was moved, to judge a residual by.
    """

    kinetic: float
    stored: float
    lifted: float
    lost: float
    made: float
    numeric: float
    port_work: float
    pumped: float

    @property
    def energy(self) -> float:
        """What is in the network now [J]."""
        return self.kinetic + self.stored + self.lifted

    def residual(self, start: Ledger) -> float:
        """What came in less what is there, since `start` [J]: 0 but for rounding."""
        came = self.port_work + self.pumped + self.made + self.numeric - self.lost
        came -= start.port_work + start.pumped + start.made + start.numeric - start.lost
        return came - (self.energy - start.energy)


def take_ledger(s: Arrays) -> Ledger:
    """Return the energies of a network as it is now."""
    masses = range(s.count[0])
    links = range(s.count[2])
    return Ledger(
        kinetic=sum(0.5 * s.mass[m] * s.v[m] * s.v[m] for m in masses),
        stored=sum(s.stored[i] for i in links),
        lifted=-sum(s.weight[m] * s.x[m] for m in masses),
        lost=sum(s.lost[i] for i in links) + sum(s.dragged[m] for m in masses),
        made=sum(s.made[i] for i in links),
        numeric=sum(s.numeric[i] for i in links) + sum(s.mass_numeric[m] for m in masses),
        port_work=sum(s.port_work[p] for p in range(s.count[1])),
        pumped=sum(s.pumped[m] for m in masses),
    )
