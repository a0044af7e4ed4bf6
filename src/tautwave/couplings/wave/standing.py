"""What a wave pair does while both devices are held still; SI, master units of the pair."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config import Rig
from tautwave.couplings.wave.keys import WavePair
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

    The observer is not biased by a held effort, so the devices get all of the line's effort.
    """
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    time = line_time(rig, name, pair, tau)
    cost = _cost(rig, name, pair, tau, time)
    return Standing(time / pair.impedance, 1.0, "a port gives all of the line's effort", cost)


def _cost(rig: Rig, name: str, pair: WavePair, tau: float, time: float) -> str:
    rotary = rig.master.axes[name].kind == "rotary"
    unit, mass = ("rad per N m", "kg m^2") if rotary else ("m per N", "kg")
    b, line = pair.impedance, rig.delay_samples * rig.period_s
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
