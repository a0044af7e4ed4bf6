"""Verdicts on what stands outside of couplings: drivers with laws of their own, and policies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import Element, Verdict
from tautwave.config import Policy, Rig, bus_spec
from tautwave.registry import load_driver
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay


def bus_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield what the drivers of a rig's buses say of themselves."""
    for name, bus in rig.own_buses.items():
        plugin = load_driver(bus.driver)
        if plugin.elements is None:
            continue
        spec = bus_spec(rig, name)
        delay = delays[spec.axes[0].name]
        late = delay.periods + delay.remainder_s / (rig.period_s * bus.divisor)
        options = plugin.options.model_validate(bus.options)
        for element in plugin.elements(options, spec, rig.axes, late):
            verdict = Verdict(element.passed, element.sentence, element.conditions, element.margin)
            yield Element(
                element.name,
                element.kind,
                element.axis,
                verdict,
                verdict,
                element.numbers,
                (element.sentence,),
            )


def policy_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield what is known of hands that a policy leads."""
    if rig.operate is not None and rig.operate.policy is not None:
        yield from _motor_hands(rig, rig.operate.policy.fps, delays)
    hands = {} if rig.simulation is None else rig.simulation.hand
    for name, hand in hands.items():
        keys = getattr(hand, "reference", None)
        if not isinstance(keys, Policy):
            continue
        effort, place = ("N m", "rad") if rig.master.axes[name].kind == "rotary" else ("N", "m")
        held = stated_hand(rig, name).hand
        power = (keys.effort_limit + held.damping * keys.velocity_limit) * keys.velocity_limit
        sentence = (
            f"policy of {name}: a hand of {held.stiffness:.4g} {effort}/{place} and "
            f"{held.damping:.3g} {effort} s/{place} follows its actions, no faster than "
            f"{keys.velocity_limit:g} {place}/s, its spring with at most {keys.effort_limit:g} "
            f"{effort}: up to {power:.3g} W. The coupling is certified with any such hand; the "
            f"policy's intent is not. Without an action for {3e3 / keys.fps:.3g} ms the rig holds."
        )
        unknown = f"the actions for {name} come from a policy, about which nothing is known"
        verdict = Verdict(True, sentence, (unknown,))
        numbers = {**keys.model_dump(exclude={"type"}), "power_w": power}
        axis = f"master.{name}"
        yield Element(f"policy of {name}", "policy", axis, verdict, verdict, numbers, (sentence,))


def _motor_hands(rig: Rig, fps: float, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield what is known of the hands that masters' own motors play."""
    from tautwave.rig.operated.leading import RESERVES, hand_law  # loads what runs them

    for name in rig.coupling.pairs:
        axis = f"master.{name}"
        effort, place = ("N m", "rad") if rig.axes[axis].kind == "rotary" else ("N", "m")
        law = hand_law(rig, name, delays[axis])
        power, allowance = law.effort * law.speed, RESERVES * law.reserve
        sentence = (
            f"policy of {name}: the master's own motor leads it with {law.stiffness:.4g} "
            f"{effort}/{place} and {law.damping:.3g} {effort} s/{place}, no faster than "
            f"{law.speed:.3g} {place}/s and with at most {law.effort:.3g} {effort}: up to "
            f"{power:.3g} W. Beyond what the policy's actions bring, it gives at most "
            f"{allowance:.3g} J in an engagement, by its own account. The coupling is certified "
            "with any such hand; the policy's intent is not. Without an action for "
            f"{3e3 / fps:.3g} ms the rig holds; with `take_over` a person leads."
        )
        unknown = f"the actions for {name} come from a policy, about which nothing is known"
        verdict = Verdict(True, sentence, (unknown,))
        numbers = {
            "stiffness": law.stiffness,
            "damping": law.damping,
            "effort_limit": law.effort,
            "velocity_limit": law.speed,
            "power_w": power,
            "allowance_j": allowance,
        }
        yield Element(f"policy of {name}", "policy", axis, verdict, verdict, numbers, (sentence,))
