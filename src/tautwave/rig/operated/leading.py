"""From a rig's `operate.policy` to the hands that its masters' own motors play; SI units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from tautwave.config import Rig
from tautwave.laws.lead import HandParams, LeadParams
from tautwave.laws.rest.alignment import AlignParams, align_law
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.controller import velocity_gain
from tautwave.runtime.operate.led import LedAxis, LedDriver, LedMasters
from tautwave.runtime.sensing import LoopBus
from tautwave.types import CommandDelay

RELEASE_S = 0.2
"""[s] In which a hand lets go: a person who holds the device feels no step."""

RESERVES = 4.0
"""What a hand may give beyond its reference's work, in units of what one command may give unseen.

At half of it the hand only brakes any more (`laws.rest.alignment.is_spent`).
"""


def led_masters(rig: Rig, delays: Mapping[str, CommandDelay], order: Sequence[str]) -> LedMasters:
    """Return the masters that a policy leads; `order` are the full names of all axes.

    Raises
    ------
    ValueError
        The rig has no `operate.policy`.
    """
    if rig.operate is None or rig.operate.policy is None:
        raise ValueError("the rig has no operate.policy")
    axes = [
        _led(rig, name, order.index(f"master.{name}"), delays[f"master.{name}"])
        for name in rig.coupling.pairs
    ]
    return LedMasters(axes, rig.operate.policy.leader)


def with_hands(buses: Sequence[LoopBus], led: LedMasters) -> Iterator[LoopBus]:
    """Yield the buses, those of led masters with drivers that add their hands."""
    hands = {f"master.{hand.axis.pair}": hand for hand in led.hands}
    for bus in buses:
        own = [hands.get(name) for name in bus.axes]
        driver = LedDriver(bus.driver, own) if any(own) else bus.driver
        yield bus._replace(driver=driver)


def hand_law(rig: Rig, pair: str, delay: CommandDelay) -> AlignParams:
    """Return spring, damper and limits of the hand that leads a master by its own motor."""
    assert rig.operate is not None
    assert rig.operate.policy is not None
    keys, name = rig.operate.policy, f"master.{pair}"
    axis = rig.axes[name]
    has = axis_allowance(rig, name, delay)
    period = rig.period_s
    late = delay.periods * period + delay.remainder_s
    return align_law(
        has.inertia,
        has.rest_coulomb,
        keys.effort_share * has.shared_effort,
        keys.velocity_share * has.velocity,
        math.inf,  # the actions make the path; `laws.lead` limits its speed
        period,
        late,
        period / velocity_gain(rig, axis) + late,
        rate=has.effort_rate,
        fastest=has.velocity,
        stalled=rig.overrun_limit * period,
    )


def _led(rig: Rig, pair: str, which: int, delay: CommandDelay) -> LedAxis:
    assert rig.operate is not None
    assert rig.operate.policy is not None
    keys, axis = rig.operate.policy, rig.master.axes[pair]
    law, period = hand_law(rig, pair, delay), rig.period_s
    low, high = axis.position_range or (-math.inf, math.inf)
    lead = LeadParams(1.0 / keys.fps, law.speed, law.effort / law.stiffness, low, high)
    has, allowance = axis_allowance(rig, f"master.{pair}", delay), RESERVES * law.reserve
    hand = HandParams(law, has.effort_step, has.quantum, period / RELEASE_S, allowance)
    late, gently = delay.remainder_s / period, rig.operate.align_acceleration
    return LedAxis(pair, which, lead, hand, gently, delay.periods, late, period, has.velocity)
