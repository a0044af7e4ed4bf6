"""From a rig file to its certificate: every element, every pair, three verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.beside.brakes import brake_elements
from tautwave.certificate.beside.compensation import (
    compensation_elements,
    inertia_elements,
    lightened_loop,
)
from tautwave.certificate.beside.dampers import damper_elements
from tautwave.certificate.beside.loads import load_element
from tautwave.certificate.buses import bus_elements, policy_elements
from tautwave.certificate.couplings import coupling_verdict
from tautwave.certificate.data import Certificate, Element, Verdict, join_verdicts
from tautwave.certificate.derate import derate_walls
from tautwave.certificate.hooks import certificate_hooks
from tautwave.certificate.loops import pair_loop
from tautwave.certificate.tuning.prompt import sum_elements
from tautwave.certificate.walls import wall_element
from tautwave.config import Rig
from tautwave.rig import allowances, at_axis_rate, axis_allowance
from tautwave.types import CommandDelay

PASSES = {
    "passive": "no element gives back more energy than it received, for any passive hand and "
    "environment within the bounds stated for its ports.",
    "passive_quantised": "also passive with encoder steps.",
    "coupled_stable": "every pair is stable with the stated hand, free and in contact.",
}

UNKNOWN = Verdict(
    False, "coupled_stable: not claimed for a single site, which knows neither the other device "
    "nor the network's delay; where both ends return less of a wave than arrives, any "
    "delay is stable."
)  # fmt: skip


def certify(
    rig: Rig, *, coulomb: Mapping[str, float] | None = None, brief: bool = False
) -> Certificate:
    """Return the certificate of a rig; touches no device.

    Parameters
    ----------
    rig : Rig
        A checked rig. The simulation is used for two things only: its hand and environment, and to
        find beliefs that its truth contradicts.
    coulomb : mapping, optional
        Lower bound of Coulomb friction by full axis name [N m or N]; default: the rig's
        `coulomb.lower`.
    brief : bool
        Leave out numbers and sentences that no verdict rests on, such as the stiffest spring that a
        port tolerates: most of the time goes into them.

    Raises
    ------
    ConfigError
        A driver is not installed, or a number is out of range.
    """
    delays = declared_delays(rig)
    if rig.scene is not None:
        return certificate_hooks().certificate(rig, delays, PASSES)
    brakes = tuple(brake_elements(rig, delays))
    compensations = (*compensation_elements(rig, delays), *inertia_elements(rig, delays))
    friction = {
        name: (coulomb or {}).get(name, has.coulomb) - (has.coulomb - has.coupling_coulomb)
        for name, has in allowances(rig, delays).items()
    }
    rig, walls = derate_walls(rig, delays, friction)
    asked = {axis: wall["asked_stiffness"] for axis, wall in walls.items()}
    own = tuple(e for e in compensations if e.axis not in rig.axes or e.axis in rig.own_axes)
    elements = (
        *_elements(rig, delays, friction, asked),
        *own,
        *brakes,
        *damper_elements(rig, delays),
        *bus_elements(rig, delays),
        *policy_elements(rig, delays),
    )
    elements = (*elements, *sum_elements(rig, delays, elements))
    if not brief:
        elements = tuple(element.whole() for element in elements)
    # Of a half the other end is not known, and neither is the network.
    whole = rig.coupling.pairs if rig.site is None else ()
    loops = tuple(lightened_loop(rig, pair_loop(rig, name, delays)) for name in whole)
    verdicts = {
        "passive": join_verdicts([e.passive for e in elements], PASSES["passive"]),
        "passive_quantised": join_verdicts(
            [e.passive_quantised for e in elements], PASSES["passive_quantised"]
        ),
        "coupled_stable": UNKNOWN
        if rig.site is not None
        else join_verdicts([p.verdict for p in loops], PASSES["coupled_stable"]),
    }
    return Certificate(rig.name, rig.require, verdicts, elements, loops, walls)


def _elements(
    rig: Rig,
    delays: Mapping[str, CommandDelay],
    coulomb: Mapping[str, float],
    asked: Mapping[str, float],
) -> Iterator[Element]:
    verdict = coupling_verdict(rig)
    for pair in rig.coupling.pairs:
        for side in rig.own_sides:
            axis_name = f"{side}.{pair}"
            own = at_axis_rate(rig, axis_name)
            wall = wall_element(own, axis_name, delays, coulomb, asked.get(axis_name, 0.0))
            if wall is not None:
                yield wall
            load = load_element(rig, axis_name, delays)
            if load is not None:
                yield load
            has = axis_allowance(rig, axis_name, delays[axis_name])
            taken = has.wall_damping + has.own_load_damping
            yield from verdict.axis_elements(rig, axis_name, delays, taken)
        yield from verdict.pair_elements(rig, pair, delays)
