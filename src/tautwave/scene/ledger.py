"""The energy of a network, element by element, and whether the account closes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from tautwave.scene.compiling import Arrays


class LinkSums(Protocol):
    """What links and ports have summed up [J], in one dimension or three."""

    @property
    def count(self) -> Sequence[int]:
        """Masses, ports and links."""

    @property
    def stored(self) -> Sequence[float]:
        """Energy in each link."""

    @property
    def lost(self) -> Sequence[float]:
        """Dissipated by each link."""

    @property
    def made(self) -> Sequence[float]:
        """Made by each active link."""

    @property
    def numeric(self) -> Sequence[float]:
        """Made by the scheme in each link."""

    @property
    def port_work(self) -> Sequence[float]:
        """Work done by each port."""


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
    return Ledger(*tally(s))


def tally(s: Arrays) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the numbers of a `Ledger`, added up in order; compiled by numba as well."""
    kinetic = 0.0
    lifted = 0.0
    dragged = 0.0
    mass_numeric = 0.0
    pumped = 0.0
    for m in range(s.count[0]):
        kinetic += 0.5 * s.mass[m] * s.v[m] * s.v[m]
        lifted += s.weight[m] * s.x[m]
        dragged += s.dragged[m]
        mass_numeric += s.mass_numeric[m]
        pumped += s.pumped[m]
    return add_links(s, kinetic, lifted, dragged, mass_numeric, pumped)


def add_links(
    s: LinkSums,
    kinetic: float,
    lifted: float,
    dragged: float,
    mass_numeric: float,
    pumped: float,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the numbers of a `Ledger`: sums over the masses [J], and those over links and ports.

    `lifted` is weight times height, positive along the weight.
    """
    stored = 0.0
    lost = 0.0
    made = 0.0
    numeric = 0.0
    for i in range(s.count[2]):
        stored += s.stored[i]
        lost += s.lost[i]
        made += s.made[i]
        numeric += s.numeric[i]
    work = 0.0
    for port in range(s.count[1]):
        work += s.port_work[port]
    return (
        kinetic,
        stored,
        -lifted,
        lost + dragged,
        made,
        numeric + mass_numeric,
        work,
        pumped,
    )
