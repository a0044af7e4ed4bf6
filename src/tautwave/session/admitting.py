"""What may move: libraries, bus time and certificate of a rig, judged before a device is opened."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.errors import BusBudgetError
from tautwave.rig import BusWay, Simulate, as_taken, bus_ways
from tautwave.session.certified import (
    UNCERTIFIED,
    certificate_of,
    certificates_of,
    certified_rig,
    refuse_uncertified,
)
from tautwave.session.checking import bus_budgets, over_budget, require_drivers
from tautwave.session.operating import refuse_endless
from tautwave.session.scales import scales_of
from tautwave.session.viewing.pointing import refuse_pointers


class Admitted(NamedTuple):
    """A rig as it may run, the ways of its buses, and its certificate."""

    rig: Rig
    ways: Mapping[str, BusWay]
    certificate: dict[str, Any]


def admit(
    rig: Rig,
    *,
    clock: str,
    simulate: Simulate,
    attach: bool,
    allow_uncertified: bool = False,
    remedy: str = UNCERTIFIED,
) -> Admitted:
    """Return a rig as it may run; touches no device. `remedy` is said of one without certificate.

    Raises
    ------
    TautwaveError
        It may not.
    """
    require_drivers(rig)
    ways = bus_ways(rig, clock=clock, simulate=simulate, attach=attach)
    refuse_endless(rig, list(ways.values()))
    refuse_pointers(rig, ways, clock)
    problems = over_budget(rig, bus_budgets(rig))
    if problems:
        raise BusBudgetError("\n".join(problems))
    certificate = certificate_of(rig, ways)
    if not allow_uncertified:
        refuse_uncertified(rig, certificate, remedy)
    rig = certified_rig(as_taken(rig, ways), certificate)
    scales = [] if allow_uncertified else scales_of(rig)
    for at_scale, certified in zip(scales, certificates_of(scales, ways), strict=True):
        refuse_uncertified(at_scale, certified, remedy)
    return Admitted(rig, ways, certificate)
