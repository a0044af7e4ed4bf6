"""Constants and state of one end of a mediated pair, in its device's own units."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.controller.seen import SeenEnd
from tautwave.couplings.mediated.contact import Contact, ContactParams, Surface
from tautwave.couplings.mediated.model import ModelParams
from tautwave.couplings.mediated.signals import Filter, SignalParams, Slope
from tautwave.laws.observer import ReactionParams


class MediatedEndParams(NamedTuple):
    """Constants of one end.

    stiffness, damping [N m/rad, N m s/rad or N/m, N s/m], force [1]: how it follows; press [N m or
    N], lead [1]: in contact it presses with that and that share of what is rendered; follows,
    measures; read_stiffness, read_damping [1]: what the far side's are here, of the numbers that
    come; greatest [N m/rad or N/m], of the stiffness that it renders; smoothing: of velocities, per
    period [1].
    """

    follows: bool
    measures: bool
    stiffness: float
    damping: float
    force: float
    press: float
    lead: float
    read_stiffness: float
    read_damping: float
    stiffest: float
    outside: ReactionParams
    signals: SignalParams
    contact: ContactParams
    model: ModelParams
    smoothing: float


@dataclass(slots=True)
class MediatedEnd(SeenEnd):
    """One end: its observer (position, velocity, acceleration) and filtered signals, and a model.

    Of a slave `contact` is what it found; of a master the surfaces in it are what it heard, and
    `above` and `below` as they are rendered. `paid` [J]: what rises of their stiffness have cost
    so far, less what falls gave back. `funds` [J]: what they may hold; `count`: periods of this
    sample. `smooth` [rad/s or m/s]: velocity, smoothed.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    smooth: float = 0.0
    place: Filter = field(default_factory=Filter)
    speed: Slope = field(default_factory=Slope)
    force: Filter = field(default_factory=Filter)
    contact: Contact = field(default_factory=Contact)
    above: Surface = field(default_factory=Surface)
    below: Surface = field(default_factory=Surface)
    paid: float = 0.0
    count: float = 1.0
    funds: float = math.inf
