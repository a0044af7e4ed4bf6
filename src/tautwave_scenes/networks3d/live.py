"""A 3D network at run time: positions of the axes in, their efforts out, once per period."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave_scenes.models.interaction import FRICTION, elastic_tension
from tautwave_scenes.networks.ledger import Ledger, element_books
from tautwave_scenes.networks3d.arrays import Compiled3d, compile_network3d
from tautwave_scenes.networks3d.ledger import kinetic_energy, take_ledger3d
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.networks3d.solving import NEWTON, ONE, step_gradient3d
from tautwave_scenes.networks3d.stepping import (
    axis_effort,
    move_port3d,
    place_port,
    set_forces3d,
    step_network3d,
)
from tautwave_scenes.networks3d.tension import jump_links, length_of, link_way

SPACE_SCHEMES = ("symplectic", "discrete_gradient", "linearly_implicit")
ITERATIONS = {"discrete_gradient": NEWTON, "linearly_implicit": ONE}


class Model3d:
    """A 3D network that is advanced one period at a time, like a `SceneModel`.

    Parameters
    ----------
    network : Network3d
        Without problems; it is not pruned here.
    scheme : str
        One of `SPACE_SCHEMES`.
    period : float
        T [s].
    keep_books : bool
        Take the ledger in every step, for a recorder: `booked`.

    Raises
    ------
    ConfigError
        The scheme is none of these.
    """

    def __init__(
        self, network: Network3d, scheme: str, period: float, *, keep_books: bool = False
    ) -> None:
        if scheme not in SPACE_SCHEMES:
            raise ConfigError(
                f"scheme {scheme}: a network in three dimensions is not linear, as its links turn; "
                f"use {' or '.join(SPACE_SCHEMES)}"
            )
        self.network = network
        self.scheme = scheme
        self.period = period
        self.keep_books = keep_books
        self._axes = range(len(network.coordinates))
        self._ports = range(len(network.ports))
        self._carried = network.carried() if network.tools else None
        self.reset([0.0] * len(network.axes))

    def _spread(self, positions: Sequence[float]) -> Sequence[float]:
        """Return the coordinates of the ports."""
        return positions if self._carried is None else self._carried.spread(positions)

    def reset(self, positions: Sequence[float]) -> None:
        """Reset to the start, with the devices' axes at `positions` [m or rad]."""
        self.compiled: Compiled3d = compile_network3d(self.network, self._spread(positions))
        self.arrays = self.compiled.arrays
        self._forced = [
            (3 * self.compiled.masses.index(name), way) for name, way in self.network.forced
        ]
        if self.scheme == "symplectic":
            set_forces3d(self.arrays)
        self.start = self.booked = self.ledger()

    def advance(self, positions: Sequence[float], pushes: Sequence[float] = ()) -> list[float]:
        """Take axis positions [m or rad] and external forces [N]; step; return the efforts.

        Returns
        -------
        list of float
            Resisting effort on each axis [N or N m], to be held until the next call.
        """
        if self._carried is None:
            return self._advance(positions, pushes)
        efforts = self._advance(self._carried.spread(positions), pushes)
        return self._carried.gather(efforts)

    def _advance(self, positions: Sequence[float], pushes: Sequence[float]) -> list[float]:
        """Step, with the ports' coordinates at `positions` [m]; return the efforts on them [N]."""
        s = self.arrays
        period = self.period
        places = list(positions)
        if pushes:
            for at, _ in self._forced:
                s.pushed[at] = s.pushed[at + 1] = s.pushed[at + 2] = 0.0
            for (at, way), push in zip(self._forced, pushes, strict=False):
                for c in range(3):
                    s.pushed[at + c] += push * way[c]
        if self.scheme == "symplectic":
            for port in self._ports:
                move_port3d(s, port, places, period)
            set_forces3d(s)
            efforts = [axis_effort(s, axis) for axis in self._axes]
            if self.keep_books:
                self.booked = self.ledger()  # between the links' books and the masses' next step
            step_network3d(s, period)
            return efforts
        for port in self._ports:
            place_port(s, port, places, period)
            jump_links(s, port)
        step_gradient3d(s, period, ITERATIONS[self.scheme])
        if self.keep_books:
            self.booked = self.ledger()
        return [axis_effort(s, axis) for axis in self._axes]

    def resting_efforts(self) -> list[float]:
        """Return the static efforts of springs and contacts on the axes [N or N m]."""
        s = self.arrays
        efforts = [0.0] * len(self._axes)
        ports = self._ports
        for i in range(s.count[2]):
            ends = (s.a[i] - s.count[0], -1.0), (s.b[i] - s.count[0], 1.0)
            if s.kind[i] >= FRICTION or s.k[i] == 0.0 or not any(at in ports for at, _ in ends):
                continue
            d = length_of(s, i) - s.rest[i] - s.set_in[i]
            pull = elastic_tension(s.kind[i], s.k[i], s.e[i], d)
            way = link_way(s, i)
            for axis in self._axes:
                along = sum(way[c] * s.axis_way[3 * axis + c] for c in range(3))
                efforts[axis] -= sum(
                    sign * pull * along for at, sign in ends if at == s.axis_port[axis]
                )
        return efforts if self._carried is None else self._carried.gather(efforts)

    def ledger(self) -> Ledger:
        """Return the present energies."""
        return take_ledger3d(self.arrays)

    def residual(self) -> float:
        """Return the residual of the account since the start [J].

        With the symplectic scheme the account is a step behind: call it before the ports move.
        """
        if self.scheme == "symplectic":
            set_forces3d(self.arrays)
        return self.ledger().residual(self.start)

    def elements(self) -> dict[str, dict[str, float]]:
        """Return the account of every mass, link, tissue and port [J], by name."""
        s = self.arrays
        accounts = element_books(s, self.compiled.masses, self.compiled.links, kinetic_energy)
        for e, name in enumerate(self.compiled.tissues):
            account = accounts.setdefault(name, {"stored": 0.0, "lost": 0.0})
            account["stored"] += s.elements.kept[e]
            account["lost"] += s.elements.dissipated[e]
        for port in self._ports:
            accounts[self.network.ports[port].name] = {"work": s.port_work[port]}
        return accounts
