"""A network at run time, live: ports in, efforts out, once a period. Without NumPy."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave_scenes.models.interaction import FRICTION, PLASTIC, elastic_tension
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks.compiling import Compiled, compile_network
from tautwave_scenes.networks.ledger import Ledger, element_books, kinetic_energy, take_ledger
from tautwave_scenes.networks.network import Network
from tautwave_scenes.networks.schemes.exact import Island, exact_islands, step_exact
from tautwave_scenes.networks.schemes.gradient import step_gradient
from tautwave_scenes.networks.schemes.kutta import aim_ports, step_kutta
from tautwave_scenes.networks.schemes.stepping import move_ports, pull_links, step_symplectic
from tautwave_scenes.networks.schemes.tension import jump_ports
from tautwave_scenes.networks.strings import TouchedString

SCHEMES = ("exact", "symplectic", "rk4", "discrete_gradient")


class SceneModel:
    """A network that is advanced one period at a time.

    Parameters
    ----------
    network : Network
        Without problems; it is not pruned here.
    scheme : str
        One of `SCHEMES`: exact for linear networks, symplectic for w T < 2, rk4 for w T < 2.8 and
        no plastic links, discrete_gradient for everything, and the only one for strings.
    period : float
        T [s].
    keep_books : bool
        Take the ledger in every step, for a recorder: `booked`.

    Raises
    ------
    ConfigError
        The scheme does not support this network.
    """

    def __init__(
        self, network: Network, scheme: str, period: float, *, keep_books: bool = False
    ) -> None:
        if scheme not in SCHEMES:
            raise ConfigError(f"there is no scheme {scheme}; there are {', '.join(SCHEMES)}")
        if network.strings and scheme != "discrete_gradient":
            raise ConfigError("a string needs scheme discrete_gradient: its node has no mass")
        keeps = [link.kind for link in network.links if not LINK_KINDS[link.kind].potential]
        if scheme == "rk4" and keeps:
            raise ConfigError(
                f"rk4 does not support {keeps[0]} links: use discrete_gradient or symplectic"
            )
        self.network = network
        self.scheme = scheme
        self.period = period
        self.keep_books = keep_books
        self._ports = range(len(network.ports))
        self._islands: tuple[Island, ...] = ()
        self.reset([0.0] * len(network.ports))

    def reset(self, positions: Sequence[float]) -> None:
        """Reset to the start, with the ports at `positions` [m]."""
        self.compiled: Compiled = compile_network(self.network, positions)
        self.arrays = arrays = self.compiled.arrays
        if self.scheme == "exact" and not self._islands:
            self._islands = exact_islands(arrays, self.period)
        first = len(self.network.masses)
        self.strings = tuple(
            TouchedString(string, first + at, self.period)
            for at, string in enumerate(self.network.strings)
        )
        self._forced = [self.compiled.masses.index(name) for name in self.network.forced]
        self._first_port = arrays.count[0]
        if self.scheme == "symplectic":
            pull_links(arrays)
        self.start = self.booked = self.ledger()

    def advance(self, positions: Sequence[float], pushes: Sequence[float] = ()) -> list[float]:
        """Take port positions [m] and external forces [N]; step; return efforts.

        Returns
        -------
        list of float
            Resisting effort of the network on each port [N], to be held until the next call.
        """
        s = self.arrays
        period = self.period
        pushed = s.pushed
        for mass, push in zip(self._forced, pushes, strict=False):
            pushed[mass] = push
        first = self._first_port
        if self.scheme == "symplectic":
            for port in self._ports:
                move_ports(s, port, positions[port], period)
            pull_links(s)
            efforts = [-s.force[first + port] for port in self._ports]
            if self.keep_books:
                self.booked = self.ledger()  # between the links' books and the masses' next step
            step_symplectic(s, period)
            return efforts
        if self.scheme == "rk4":
            for port in self._ports:
                aim_ports(s, port, positions[port], period)
            step_kutta(s, period)
            if self.keep_books:
                self.booked = self.ledger()
            return [-s.force[first + port] for port in self._ports]
        for port in self._ports:
            jump_ports(s, port, positions[port], period)
        if self.scheme == "exact":
            step_exact(s, self._islands, period)
        else:
            for string in self.strings:
                string.push(s)
            step_gradient(s, period)
            for string in self.strings:
                string.carry_on(s)
        if self.keep_books:
            self.booked = self.ledger()
        return [-s.force[first + port] for port in self._ports]

    def resting_efforts(self) -> list[float]:
        """Return the static forces of springs and contacts on the ports [N]."""
        s = self.arrays
        efforts = [0.0] * (s.count[0] + s.count[1])
        for i in range(s.count[2]):
            if s.kind[i] < FRICTION and s.k[i] > 0.0:
                d = s.x[s.a[i]] - s.x[s.b[i]] - s.rest[i] - (s.kind[i] == PLASTIC) * s.set_in[i]
                pull = elastic_tension(s.kind[i], s.k[i], s.e[i], d)
                for end, sign in ((s.a[i], 1.0), (s.b[i], -1.0)):
                    if end < len(efforts):
                        efforts[end] += sign * pull
        return efforts[self._first_port :]

    def ledger(self) -> Ledger:
        """Return the present energies; what a string's node gave is stored on its lines."""
        return self.with_strings(take_ledger(self.arrays))

    def with_strings(self, ledger: Ledger) -> Ledger:
        """Return a network's ledger with its strings included."""
        for at, string in enumerate(self.strings):
            node = len(self.network.masses) + at
            ledger = ledger._replace(
                stored=ledger.stored + string.stored,
                lost=ledger.lost - self.arrays.dragged[node] + string.lost,
                pumped=ledger.pumped - self.arrays.pumped[node],
            )
        return ledger

    def residual(self) -> float:
        """Return the residual of the account since the start [J].

        With the symplectic scheme the account is a step behind: call it before the ports move.
        """
        if self.scheme == "symplectic":
            pull_links(self.arrays)
        return self.ledger().residual(self.start)

    def elements(self) -> dict[str, dict[str, float]]:
        """Return the account of every mass, link, port and string [J], by name."""
        s = self.arrays
        accounts = element_books(s, self.compiled.masses, self.compiled.links, kinetic_energy)
        for port in self._ports:
            accounts[self.network.ports[port]] = {"work": s.port_work[port]}
        for string in self.strings:
            accounts[string.string.name] = {
                "absorbed": string.absorbed(s),
                "stored": string.stored,
                "lost": string.lost,
            }
        return accounts
