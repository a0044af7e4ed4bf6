"""A network as plain data: nodes by name, links between them. No motion is computed here.

Node names are unique over masses, ports and grounds; `ground` at 0 always exists. `place` is the
line of an element in its file, for messages. 1-D: one coordinate a node; the arrays made of it
(`compiling`) are indexed by node, so that three coordinates are three more arrays.
"""

from __future__ import annotations

from typing import NamedTuple

GROUND = "ground"


class Mass(NamedTuple):
    """A mass [kg], its initial position and velocity [m, m/s], its damping to ground [N s/m]."""

    name: str
    mass: float
    position: float = 0.0
    velocity: float = 0.0
    damping: float = 0.0


class Link(NamedTuple):
    """A link from node `a` to node `b`; stretch is x_a - x_b - rest. See `models.interaction`.

    `kind` is one of `models.link_kinds`; `limit` is the yield or friction force [N] or a source's
    power [W]; `loss` Hunt and Crossley's [s/m]; `scale` the speed [m/s] at which friction
    saturates. Between points of three dimensions (`networks3d`) stretch is their distance less
    `rest`, along a `normal` if there is one: a plane. With `solid`, `b` is one, and stretch is the
    distance from its surface, below 0 inside.
    """

    name: str
    kind: str
    a: str
    b: str
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0
    exponent: float = 1.0
    loss: float = 0.0
    limit: float = 0.0
    scale: float = 1e-3
    normal: tuple[float, float, float] | None = None
    solid: bool = False


class String(NamedTuple):
    """A string at its contact point, as two terminated transmission lines.

    `impedance` [N s/m] is sqrt(tension * mass per length). A wave needs `near` and `far` samples
    to an end and comes back after 2 near + 2 or 2 far + 2, turned over, times `reflection`, through
    a one-pole low-pass whose step is `smoothing` (1: none). The point is a node without mass.
    """

    name: str
    impedance: float
    near: int
    far: int
    reflection: float = 1.0
    smoothing: float = 1.0


class Network(NamedTuple):
    """Masses, links, ports (moved from outside) and grounds (name, position [m]).

    `forced` are masses with an external force, `recorded` those to record; `gravity` [m/s**2] acts
    downward on every mass.
    """

    masses: tuple[Mass, ...]
    links: tuple[Link, ...]
    ports: tuple[str, ...] = ()
    grounds: tuple[tuple[str, float], ...] = ((GROUND, 0.0),)
    forced: tuple[str, ...] = ()
    recorded: tuple[str, ...] = ()
    gravity: float = 0.0
    strings: tuple[String, ...] = ()

    def nodes(self) -> tuple[str, ...]:
        """Return the names of all nodes: masses, strings, ports, grounds."""
        names = [mass.name for mass in self.masses] + [string.name for string in self.strings]
        return (*names, *self.ports, *(name for name, _ in self.grounds))
