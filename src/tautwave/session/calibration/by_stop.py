"""Zero by a mechanical stop: an axis goes there, no faster and no harder than it may."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping

from tautwave.config import Rig
from tautwave.errors import SafetyStop
from tautwave.laws.rest.alignment import (
    AlignParams,
    align_effort,
    align_law,
    lead_reference,
    move_reference,
)
from tautwave.rig import axis_allowance, command_delays
from tautwave.session.guided.control import GuidedControl
from tautwave.types import CommandDelay

SHARE = 0.2
"""Of the effort limit, with which a stop is pressed."""

SPEED, ACCELERATION = 0.2, 1.0
"""[rad/s or m/s, and per s] of the way there."""

REST_S = 0.3
STILL = 0.1
"""Share of the speed below which an axis that is pushed stands."""

LONGEST_S = 60.0
FAR = 1e6


def stop_law(rig: Rig, name: str, delay: CommandDelay) -> AlignParams:
    """Return the law that takes an axis to its stop; needs its inertia's lower bound."""
    axis = rig.axes[name]
    if axis.inertia is None:
        raise SafetyStop(
            f"{name} is velocity-controlled, so its stop cannot be searched for; use the zero pose"
        )
    has = axis_allowance(rig, name, delay)
    period = has.period
    return align_law(
        has.inertia,
        has.rest_coulomb,
        SHARE * has.shared_effort,
        min(SPEED, 0.5 * (SPEED if math.isinf(has.velocity) else has.velocity)),
        ACCELERATION,
        period,
        period,
        2.0 * period + axis.velocity_filter_s,
        rate=has.shared_rate,
    )


def find_stops(
    rig: Rig, ways: Mapping[str, int], control: GuidedControl
) -> Generator[None, None, dict[str, float]]:
    """Return where the stops of axes are, as their devices count [rad or m].

    Parameters
    ----------
    ways : mapping
        By axis +1 or -1: which way, in device coordinates.

    Raises
    ------
    SafetyStop
        An axis finds no stop.
    """
    yield from control.ask(
        f"{', '.join(ways)}: the drives are enabled, and each axis moves to its stop in turn; "
        "keep clear, then press Enter"
    )
    stops, delays = {}, command_delays(rig)
    for name, way in ways.items():
        stops[name] = yield from _find(control, name, way, stop_law(rig, name, delays[name]))
        control.say(f"  {name}: stop at {stops[name]:+.4f} in device coordinates")
    return stops


def _find(
    control: GuidedControl, name: str, way: int, law: AlignParams
) -> Generator[None, None, float]:
    reference, rate = control.position(name), 0.0
    begun, moved_ns = control.now_ns, control.now_ns
    while control.now_ns - moved_ns < 1e9 * REST_S:
        if control.now_ns - begun > 1e9 * LONGEST_S:
            raise SafetyStop(
                f"{name}: no stop found within {LONGEST_S:g} s; is there one in that direction? "
                "The effort limit may be too low to reach it"
            )
        position, velocity = control.position(name), control.velocity(name)
        reference, rate = move_reference(law, reference, rate, way * FAR)
        reference, rate = lead_reference(law, reference, rate, position)
        effort = align_effort(law, reference, rate, position, velocity)
        control.push(name, effort)
        pressed = way * effort >= 0.9 * law.effort
        if not pressed or abs(velocity) > STILL * law.speed:
            moved_ns = control.now_ns
        control.show(lambda: f"{name} {control.position(name):+.3f}")
        yield
    control.push(name, 0.0)
    return control.position(name)
