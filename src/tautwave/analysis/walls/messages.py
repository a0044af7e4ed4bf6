"""Verdicts on walls in plain English; every number is the verdict's own."""

from __future__ import annotations

import math

from tautwave.analysis.walls.verdict import WallVerdict


def passivity_sentence(verdict: WallVerdict, name: str = "wall", *, rotary: bool = False) -> str:
    """Return whether the wall is passive, what spoils it and what to change.

    Parameters
    ----------
    verdict : WallVerdict
        From `assess_wall`.
    name : str
        How the sentence begins, such as "slave wall".
    rotary : bool
        Units of an axis that turns.
    """
    spring, damper = _units(rotary)
    wall, limit = verdict.wall, verdict.passive_stiffness
    head = f"{name}: K = {_number(wall.stiffness)} {spring}"
    if verdict.passive:
        return (
            f"{head} is passive: it needs {_number(verdict.leak.damping)} {damper} of the device's "
            f"{_number(verdict.device.damping)}; the limit is K = {_number(limit)}."
        )
    if math.isinf(verdict.leak.damping):
        return f"{head} is not passive on any device: the controller itself is unstable."
    if limit > 0.0:
        head += f" is {_ratio(wall.stiffness, limit)} the passive limit {_number(limit)}"
    else:
        head += (
            " is not passive, and neither is any other K: it needs "
            f"{_number(verdict.leak.damping)} "
            f"{damper}, the device has {_number(verdict.device.damping)}"
        )
    reasons = _reasons(verdict, damper)
    if reasons:
        head += f"; {reasons}"
    return f"{head}. {_advice(verdict, damper)}."


def stability_sentence(verdict: WallVerdict, name: str = "wall", *, rotary: bool = False) -> str:
    """Return whether the device is stable at the wall with the stated hand, or without one."""
    spring, _ = _units(rotary)
    who = "without a hand" if verdict.hand is None else "with the stated hand"
    stiffness, limit = verdict.wall.stiffness, verdict.stable.limit
    words = "stable" if verdict.coupled_stable else "unstable"
    head = f"{name}: K = {_number(stiffness)} {spring} is {words} {who}"
    if math.isinf(limit):
        return f"{head}, as is any K."
    if limit == 0.0:
        tail = "even a vanishing K is unstable"
    else:
        tail = f"it is {_ratio(stiffness, limit)} the limit {_number(limit)}"
    return f"{head}; {tail} (oscillation at {_number(verdict.stable.frequency)} Hz)."


def quantum_sentence(verdict: WallVerdict, name: str = "wall", *, rotary: bool = False) -> str:
    """Return what the encoder's step does to the verdict."""
    spring, _ = _units(rotary)
    device = verdict.device
    if device.quantum == 0.0:
        return f"{name}: no encoder step is given, so the quantised verdict equals the passive one."
    if verdict.passive_quantised:
        return f"{name}: also passive with the encoder's step; friction covers it."
    if device.coulomb == 0.0:
        why = "an encoder step and no Coulomb friction: no wall passes the quantised condition"
    else:
        why = (
            "not passive with the encoder's step; an undelayed spring passes up to "
            f"{_number(verdict.quantised_stiffness)} {spring}"
        )
    if math.isinf(verdict.activity):
        return (
            f"{name}: {why}, and with too little damping the energy that "
            "it can generate is unbounded."
        )
    return (
        f"{name}: {why}; at most {_number(verdict.activity, up=True)} J "
        "are generated per two samples."
    )


def _reasons(verdict: WallVerdict, damper: str) -> str:
    wall, blame = verdict.wall, verdict.blame
    parts = []
    if wall.delay > 0.0 and verdict.passive_stiffness > 0.0:
        ratio = verdict.prompt_stiffness / verdict.passive_stiffness
        if ratio > 1.0:
            periods = "one period" if wall.delay == 1.0 else f"{_number(wall.delay)} periods"
            verb = "costs" if wall.delay <= 1.0 else "cost"
            parts.append(f"{periods} of delay {verb} {_number(ratio)} x of it")
    if blame.damping > 0.0:
        parts.append(f"B takes {_number(blame.damping)} {damper}")
    if blame.filter > 0.0:
        parts.append(f"its filter {_number(blame.filter)}")
    return ", ".join(parts)


def _advice(verdict: WallVerdict, damper: str) -> str:
    remedies, wall = verdict.remedies, verdict.wall
    options = []
    if remedies.stiffness > 0.0:
        options.append(f"lower K to {_number(remedies.stiffness, down=True)}")
    if 0.0 <= remedies.damping < wall.damping:
        options.append(f"lower B to {_number(remedies.damping, down=True)}")
    if math.isfinite(remedies.rate):
        options.append(f"raise the rate to {_frequency(remedies.rate)}")
    options.append(f"add {_number(remedies.added, up=True)} {damper} of damping")
    text = ", or ".join(options)
    return text[0].upper() + text[1:]


def _units(rotary: bool) -> tuple[str, str]:
    return ("N m/rad", "N m s/rad") if rotary else ("N/m", "N s/m")


def _number(value: float, *, up: bool = False, down: bool = False) -> str:
    """Return a value with three digits, four before the point kept; advice never rounds badly."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(3, min(4, math.floor(math.log10(abs(value))) + 1))
    unit = 10.0 ** (math.floor(math.log10(abs(value))) + 1 - digits)
    count = value / unit
    whole = round(count)
    if up and whole < count - 1e-9:
        whole += 1
    if down and whole > count + 1e-9:
        whole -= 1
    rounded = whole * unit
    return (
        f"{rounded:.{digits}g}" if abs(rounded) < 1e4 or abs(rounded) >= 1e7 else f"{rounded:.0f}"
    )


def _ratio(value: float, limit: float) -> str:
    """Return how many times the limit a value is; never "1 x" for one that is not equal."""
    ratio = value / limit
    if 0.995 < ratio < 1.005 and ratio != 1.0:
        return "just above" if ratio > 1.0 else "just below"
    return f"{_number(ratio)} x"


def _frequency(value: float) -> str:
    if value >= 1e3:
        return f"{_number(value / 1e3, up=True)} kHz"
    return f"{_number(value, up=True)} Hz"
