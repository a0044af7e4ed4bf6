"""Kinds of links of a network: what a file calls them, and what each room has to know of a kind.

A row is all that is said of a kind beside its keys (`config.keys`) and its law, which `interaction`
has by number: which sentence of the certificate it falls under, how steep it may become, how much
it bears, how it is drawn. Checks, certificate, pictures and measurements ask a row; none of them
knows a kind by its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

from tautwave_scenes.models import interaction as law

Proof = Literal["linear", "curved", "sliding", "active"]
"""What a certificate rests on.

`linear`: a theorem of sampled control. `curved`: the same, closed and where it is steepest; opening
and closing is a condition unless `potential`. `sliding`: dissipates at any rate, a condition.
`active`: supplies energy; no rig with one is certified.
"""

Symbol = Literal["spring", "damper", "contact", "other"]
"""As what a link is drawn."""


class Constants(NamedTuple):
    """Constants of a link: k [N/m**e], e, z [N s/m], loss [s/m], limit [N or W], scale [m/s].

    `depth` is the greatest depth to which it can be pressed [m], inf if none is known.
    """

    k: float
    e: float
    z: float
    loss: float
    limit: float
    scale: float
    depth: float


Slopes = Callable[[Constants], tuple[float, float]]
"""Greatest stiffness [N/m] and damping [N s/m] of a link; 0 where there is no greatest."""


class LinkKind(NamedTuple):
    """A kind of link.

    Attributes
    ----------
    number : int
        Of its law in `interaction`.
    proof : str
        What a certificate rests on.
    symbol : str
        As what it is drawn.
    steepest : callable
        Its greatest stiffness and damping.
    one_way : bool
        It only pushes, and is open most of the time.
    potential : bool
        Its elastic force depends on the stretch alone; otherwise it keeps a set, which no scheme
        that evaluates a step several times can follow.
    bounded : bool
        Its spring bears `limit` at most.
    """

    number: int
    proof: Proof
    symbol: Symbol
    steepest: Slopes
    one_way: bool = False
    potential: bool = True
    bounded: bool = False


def _nothing(c: Constants) -> tuple[float, float]:
    return 0.0, 0.0


def _spring(c: Constants) -> tuple[float, float]:
    return c.k, c.z


def _contact(c: Constants) -> tuple[float, float]:
    if math.isfinite(c.depth):
        return c.e * c.k * c.depth ** (c.e - 1.0), c.loss * c.k * c.depth**c.e
    return (c.k, 0.0) if c.e == 1.0 else (0.0, 0.0)


def _friction(c: Constants) -> tuple[float, float]:
    return 0.0, c.limit / c.scale


def _bow(c: Constants) -> tuple[float, float]:
    return 0.0, 2.0 * c.limit / c.scale


LINK_KINDS = {
    "contact": LinkKind(law.CONTACT, "curved", "contact", _contact, one_way=True),
    "spring": LinkKind(law.SPRING, "linear", "spring", _spring),
    "damper": LinkKind(law.SPRING, "linear", "damper", _spring),
    "nonlinear": LinkKind(law.POWER, "curved", "spring", _nothing),
    "plastic": LinkKind(law.PLASTIC, "curved", "spring", _spring, potential=False, bounded=True),
    "friction": LinkKind(law.FRICTION, "sliding", "other", _friction),
    "bow": LinkKind(law.BOW, "sliding", "other", _bow),
    "negative_damper": LinkKind(law.NEGATIVE, "active", "other", _nothing),
    "energy_source": LinkKind(law.SOURCE, "active", "other", _nothing),
}
"""By name in a rig file, in the order in which a network's arrays have their links."""

BY_NUMBER = {kind.number: kind for kind in reversed(LINK_KINDS.values())}
"""By number of their law; a damper is a spring without stiffness."""


def is_linear(kind: str) -> bool:
    """Return whether links of a kind are springs and dampers."""
    return LINK_KINDS[kind].proof == "linear"


def is_active(kind: str) -> bool:
    """Return whether links of a kind supply energy."""
    return LINK_KINDS[kind].proof == "active"
