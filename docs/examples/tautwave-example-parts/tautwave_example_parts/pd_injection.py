"""PD with damping injection: spring and damper between the sides, and dampers against ground.

What each side sees of the other, a delay old, and the books of the spring are `controller.seen`'s.

Nuno, Basanez and Ortega, "Passivity-based control for bilateral teleoperation", Automatica 47
(2011): 4 B_m B_s > (T_m + T_s)^2 K_m K_s, in continuous time. SI, in the master's units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import Field

from tautwave.plugin import (
    OWN_GUARDS,
    AxisParams,
    AxisState,
    Column,
    CoupledAxis,
    Coupling,
    CouplingMessages,
    CouplingPlugin,
    Guard,
    Pair,
    PairParams,
    Rig,
    seen_law,
)

SIDES = ("master", "slave")


class InjectedPair(Pair):
    """A pair with a spring, a damper, and damping injected at both ends."""

    stiffness: float = Field(gt=0, description="[N m/rad | N/m] Spring between the sides.")
    damping: float = Field(ge=0, description="[N m s/rad | N s/m] Damper between the sides.")
    injection: float = Field(ge=0, description="[N m s/rad | N s/m] Damper to ground, each side.")
    reach: float = Field(default=1e3, gt=0, description="[rad | m] The run stops beyond it.")


class InjectedCoupling(Coupling):
    """PD with damping injection."""

    pairs: Mapping[str, InjectedPair] = Field(description="The pairs by name.")


STRETCHED = OWN_GUARDS
"""Guard: the sides are further apart than the spring may be stretched."""


class PdParams(NamedTuple):
    """What acts on one device, in its units; `reach` [rad or m] is the spring's longest stretch."""

    stiffness: float
    damping: float
    injection: float
    reach: float


def constants(pair: InjectedPair, side: str) -> PdParams:
    """Return what acts on one device, in its units."""
    return PdParams(
        stiffness=pair.in_device_units(side, pair.stiffness),
        damping=pair.in_device_units(side, pair.damping),
        injection=pair.in_device_units(side, pair.injection),
        reach=pair.reach if side == "master" else pair.reach * pair.position_scale,
    )


def end_constants(pair: InjectedPair, side: str, axis: CoupledAxis) -> PdParams:
    """Return the constants of one end; they are the same on any axis."""
    return constants(pair, side)


def spring(q: PairParams, p1: AxisParams, p2: AxisParams) -> float:
    """Return the spring whose energy is booked, in master units."""
    stiffness: float = p1.end.stiffness
    return stiffness


def effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort: spring and damper to the far side, and a damper to ground."""
    e = s.end
    k = p.end
    stretch = s.position - e.far_position
    if stretch > k.reach or stretch < -k.reach:
        s.alarm = STRETCHED
    pull: float = k.stiffness * stretch + k.damping * (s.velocity - e.far_velocity)
    return pull + k.injection * s.velocity


SIGNALS = (
    Column(
        "stretch",
        "rad, m",
        "of the spring, as this side sees it",
        lambda s, p: s.position - s.end.far_position,
    ),
)
"""What is recorded of each axis for this law."""

law = seen_law(
    "pd_injection",
    effort,
    spring=spring,
    signals=SIGNALS,
    guards={STRETCHED: Guard("spring_stretched", "is further from the other side than its reach")},
)


def elements(rig: Rig, name: str, delays: Mapping[str, Any]) -> Iterator[Any]:
    """Yield what is known of one pair's passivity; what it needs is imported only now."""
    from tautwave.plugin import Element, Verdict

    pair = rig.coupling.pairs[name]
    assert isinstance(pair, InjectedPair)
    there, have, wanted = [], 1.0, 1.0
    for side in SIDES:
        delay = delays[f"{side}.{name}"]
        late = rig.period_s * (0.5 + delay.periods) + delay.remainder_s
        there.append(rig.coupling.delay_s + late)
        have *= constants(pair, side).injection + rig.axes[f"{side}.{name}"].damping.lower
        wanted *= constants(pair, side).stiffness
    ratio = 4.0 * have / (sum(there) ** 2 * wanted)
    said = (
        f"coupling of {name}: 4 B_m B_s is {ratio:.3g} times (T_m + T_s)^2 K_m K_s with a delay of "
        f"{1e3 * sum(there):.3g} ms there and back (Nuno et al. 2011)"
    )
    holds = Verdict(ratio > 1.0, said, ("continuous time stands for sampled",), ratio - 1.0)
    steps = Verdict(False, f"{said}; nothing is known of encoder steps")
    yield Element(f"coupling of {name}", "coupling", name, holds, steps, {"ratio": ratio}, (said,))


messages = CouplingMessages(
    coupling=lambda rig: f"PD with damping injection, {rig.coupling.delay_s:g} s each way"
)

plugin = CouplingPlugin(
    summary="spring and damper between the sides, damping injected at both",
    keys=InjectedCoupling,
    law=law,
    end_constants=end_constants,
    verdict=elements,
    messages=messages,
)
