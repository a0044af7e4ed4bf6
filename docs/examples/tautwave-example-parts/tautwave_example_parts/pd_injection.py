"""PD with damping injection: spring and damper between the sides, and dampers against ground.

Both sides see the far one's position and velocity, a delay old, through four rings in the table:
positions of master and slave, velocities of master and slave. The books have one element: what
both devices gave less what the spring between their present positions holds.

Nuno, Basanez and Ortega, "Passivity-based control for bilateral teleoperation", Automatica 47
(2011): 4 B_m B_s > (T_m + T_s)^2 K_m K_s, in continuous time. SI, in the master's units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableSequence, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pydantic import Field

from tautwave.config import Coupling, Pair, Rig
from tautwave.contracts import CoupledAxis, CouplingPlugin, Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.controller.steps import OWN_GUARDS, Guard, Law, Steps
from tautwave.wording import CouplingMessages

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


@dataclass(slots=True)
class PdEnd:
    """What one side sees of the other, in its own units, and the energy it gave [J]."""

    far_position: float = 0.0
    far_velocity: float = 0.0
    given: float = 0.0


@dataclass(slots=True)
class PdLink:
    """The spring's energy now and at the start [J], and the place in the rings."""

    stored: float = 0.0
    stored_at_start: float = 0.0
    at: int = 0


def spring_energy(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, p1: AxisParams
) -> float:
    """Return the energy of the spring between the present positions, in master units [J]."""
    stretch = one.position - q.to_master * (two.position - c.offset)
    energy: float = 0.5 * p1.end.stiffness * stretch * stretch
    return energy


def start(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    gap: float,
    table: MutableSequence[float],
) -> None:
    """Forget what was: both stand where they are, and have stood there for the delay."""
    for i in range(q.samples):
        table[q.line + i] = one.position
        table[q.line + q.samples + i] = two.position
        table[q.line + 2 * q.samples + i] = 0.0
        table[q.line + 3 * q.samples + i] = 0.0
    one.end.given = 0.0
    two.end.given = 0.0
    link = c.link
    link.at = 0
    link.stored = spring_energy(c, q, one, two, p1)
    link.stored_at_start = link.stored


def look(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
) -> tuple[float, float, float, float]:
    """Pass one slot; return position and velocity of the slave, then of the master, a delay old."""
    if q.samples == 0:
        return two.position, two.velocity, one.position, one.velocity
    link = c.link
    at = q.line + link.at
    master = table[at]
    table[at] = one.position
    at = at + q.samples
    slave = table[at]
    table[at] = two.position
    at = at + q.samples
    master_velocity = table[at]
    table[at] = one.velocity
    at = at + q.samples
    slave_velocity = table[at]
    table[at] = two.velocity
    link.at += 1
    if link.at == q.samples:
        link.at = 0
    return slave, slave_velocity, master, master_velocity


def engage(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> None:
    """Let both see each other, each in its own units."""
    slave, slave_velocity, master, master_velocity = look(c, q, one, two, table)
    here = one.end
    there = two.end
    here.far_position = q.to_master * (slave - c.offset)
    here.far_velocity = q.to_master * slave_velocity
    there.far_position = q.ratio * master + c.offset
    there.far_velocity = q.ratio * master_velocity


def exchange(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
    here: bool,
    due_one: bool,
    due_two: bool,
) -> None:
    """Pass one slot; where the loop saw it, book the spring and let both see each other."""
    if here:
        c.link.stored = spring_energy(c, q, one, two, p1)
        engage(c, q, one, two, p1, p2, table)
    else:
        look(c, q, one, two, table)


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book what the device gave: the effort that acted times the way it went."""
    s.end.given += port * displacement


def think(s: AxisState, p: AxisParams, coast: float) -> float:
    """Return the resisting effort: spring and damper to the far side, and a damper to ground."""
    e = s.end
    k = p.end
    stretch = s.position - e.far_position
    if stretch > k.reach or stretch < -k.reach:
        s.alarm = STRETCHED
    effort: float = k.stiffness * stretch + k.damping * (s.velocity - e.far_velocity)
    return effort + k.injection * s.velocity


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> Sequence[str]:
    """Return the name of the only element."""
    return ("coupler",)


def fill_elements(
    out: Row,
    at: int,
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> int:
    """Write energy absorbed, stored and dissipated, in master units [J]."""
    absorbed = one.end.given + q.weight * two.end.given
    stored = c.link.stored - c.link.stored_at_start
    out[at] = absorbed
    out[at + 1] = stored
    out[at + 2] = absorbed - stored
    return at + 3


law = Law(
    name="pd_injection",
    steps=Steps(
        start=start,
        engage=engage,
        close=close,
        exchange=exchange,
        think=think,
        fill_elements=fill_elements,
    ),
    end=PdEnd,
    link=PdLink,
    elements=element_names,
    guards={STRETCHED: Guard("spring_stretched", "is further from the other side than its reach")},
)


def elements(rig: Rig, name: str, delays: Mapping[str, Any]) -> Iterator[Any]:
    """Yield what is known of one pair's passivity; what it needs is imported only now."""
    from tautwave.certificate.data import Element, Verdict

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
