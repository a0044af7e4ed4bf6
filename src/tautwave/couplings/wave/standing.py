"""What a wave pair does while both devices are held still; SI, master units of the pair."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.wave.keys import WavePair
from tautwave.rig import line_delay
from tautwave.types import CommandDelay
from tautwave.wording import Standing


def line_time(rig: Rig, name: str, pair: WavePair, tau: float) -> float:
    """Return the delay tau [s] of a line with the lag of both ports' filters."""
    for side in ("master", "slave"):
        period = rig.axis_period_s(f"{side}.{name}")
        gain = pair.filter_step(period)
        tau += 0.5 * period * (1.0 - gain) / gain
    return tau


def standing(rig: Rig, name: str, delays: Mapping[str, CommandDelay], tau: float) -> Standing:
    """Return the standing offset: tau / b of the line, with the lag of both ports' filters.

    It is per effort on the master. An observer is not biased by a held effort, so its device gets
    all of the line's; a plain port gives less, see `held_share`.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    time = line_time(rig, name, pair, tau)
    cost = _cost(rig, name, pair, tau, time)
    shares = [held_share(rig, name, side, delays) for side in ("master", "slave")]
    least = min(shares)
    given = "all" if least == 1.0 else f"{least:.1%}"
    text = f"a port gives {given} of the line's effort"
    return Standing(time / pair.impedance / shares[0], least, text, cost)


def held_share(rig: Rig, name: str, side: str, delays: Mapping[str, CommandDelay]) -> float:
    """Return effort given per effort of the line while the device is held still [1].

    A plain port takes the effort that it gives, and that is under way, for a motion to come:
    1 / (1 + b T (1 + n) / m), n the command delay in periods T, m the inertia's lower bound.
    """
    pair, axis_name = rig.coupling.pairs[name], f"{side}.{name}"
    assert isinstance(pair, WavePair)
    inertia = rig.axes[axis_name].inertia
    if inertia is None or pair.pole(side) is not None:
        return 1.0
    period = rig.axis_period_s(axis_name)
    ahead = period + delays[axis_name].periods * period + delays[axis_name].remainder_s
    return 1.0 / (1.0 + pair.in_device_units(side, pair.impedance) * ahead / inertia.lower)


def _cost(rig: Rig, name: str, pair: WavePair, tau: float, time: float) -> str:
    rotary = rig.master.axes[name].kind == "rotary"
    unit, mass = ("rad per N m", "kg m^2") if rotary else ("m per N", "kg")
    b, line = pair.impedance, line_delay(rig).samples * rig.period_s
    inertia = moved_inertia(rig, name, pair)
    return (
        f"F tau / b: {line / b:.3g} {unit} of the line's delay, {(tau - line) / b:.3g} of sampling "
        f"and commands, {(time - tau) / b:.3g} of the wave filters. Twice wave_impedance halves "
        f"it, and doubles chatter, reserve and leak, and the weight of the line in free motion, "
        f"b tau = {b * time:.2g} {mass} beside the devices' {inertia:.2g}"
    )


def moved_inertia(rig: Rig, name: str, pair: WavePair) -> float:
    """Return the inertia of both devices [kg m**2 or kg, master]; of one that takes velocity 0."""
    axes = [(side, rig.axes[f"{side}.{name}"].inertia) for side in ("master", "slave")]
    return sum(
        inertia.value / pair.in_device_units(side, 1.0)
        for side, inertia in axes
        if inertia is not None
    )
