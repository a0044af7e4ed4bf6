"""What a wave pair may supply, and how its ends are while devices are held; from the rig's keys.

The terms of its `Claim`; the standing offset, in master units; one end as a linear system, SI of
its device.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import Claim, joules, short, stall_words, watts
from tautwave.config import Rig, local_wall
from tautwave.couplings.wave.from_keys import (
    bare_port,
    declared_noise,
    effort_steps,
    observer_of,
    port_impedance,
    servo_port,
    swing_lag,
    tank_leak,
)
from tautwave.couplings.wave.keys import WavePair
from tautwave.laws.port import port_reserve
from tautwave.laws.ramp import ramp_bound, ramp_params
from tautwave.rig import (
    axis_allowance,
    axis_claim,
    coupled_axis,
    line_delay,
    once_per_rig,
    wall_params,
)
from tautwave.types import CommandDelay
from tautwave.wording import Standing

if TYPE_CHECKING:  # the process that moves motors asks for a claim, and for no linear end
    from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site


def linear_end(pair: WavePair, side: str, device: Device, site: Site) -> LinearEnd:
    """Return the end at one side; its waves are those of the line."""
    from tautwave.analysis.wave_port.port_loop import wave_end

    period = site.period
    mass = period / (2.0 * site.half_mobility)
    delay = site.delay_periods + site.late_share
    return wave_end(
        device,
        site,
        bare_port(pair, side, period, mass, delay),
        observer_of(pair, side, period, mass),
        wave_gain=pair.wave_gain(side),
    )


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
        f"F tau / b: {line / b:.3g} {unit} from the line's delay, {(tau - line) / b:.3g} from "
        f"sampling and commands, {(time - tau) / b:.3g} from the wave filters. Doubling "
        "wave_impedance halves the offset. It doubles chatter, reserve, leak, and what the line "
        f"weighs in free motion: b tau = {b * time:.2g} {mass}, beside {inertia:.2g} of the devices"
    )


def moved_inertia(rig: Rig, name: str, pair: WavePair) -> float:
    """Return the inertia of both devices [kg m**2 or kg, master]; of one that takes velocity 0."""
    axes = [(side, rig.axes[f"{side}.{name}"].inertia) for side in ("master", "slave")]
    return sum(
        inertia.value / pair.in_device_units(side, 1.0)
        for side, inertia in axes
        if inertia is not None
    )


Delays = Mapping[str, CommandDelay]


def allowance_of(rig: Rig, axis_name: str, delays: Delays) -> AxisAllowance:
    """Return what an axis has, and what of it is its port's."""
    return axis_allowance(rig, axis_name, delays[axis_name])


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the port of an axis may supply, or the keys without which it is unbounded."""
    return _claim_of(rig, axis_name, delays[axis_name])


@once_per_rig
def _claim_of(rig: Rig, axis_name: str, delay: CommandDelay) -> Claim | str:
    side = axis_name.split(".")[0]
    axis, pair = rig.axes[axis_name], rig.coupling.pairs[axis_name.split(".")[1]]
    assert isinstance(pair, WavePair)
    needed = ["velocity_limit", *(["effort_rate_limit"] if axis.inertia is not None else [])]
    missing = [key for key in needed if getattr(axis, key) is None]
    if missing:
        return " and ".join(missing)
    known = coupled_axis(rig, axis_name, delay)
    own = axis_claim(rig, axis_name, delay)
    if axis.inertia is None:
        port = servo_port(pair, side, known)
        return own._replace(
            reserve=port.reserve,
            leak=port.leak / port.period,
            deviation=known.position_noise,
            quantum=known.encoder_quantum,
            spring=axis.outside_stiffness,
        )
    observer = observer_of(pair, side, known.period, axis.inertia.lower)
    reserve = port_reserve(
        port_impedance(pair, side),
        known.period,
        known.delay + known.late,
        observer.velocity * known.period,
        known.velocity_limit,
    )
    walled = local_wall(rig, axis_name) is not None
    debt = wall_params(rig, axis_name, delay).reserve if walled else 0.0
    ramp = ramp_params(known.period, axis.inertia.lower, known.effort_rate)
    return own._replace(
        reserve=reserve,
        leak=tank_leak(pair, side, known),
        feigned=declared_noise(pair, side, known).gained,
        lag=swing_lag(pair, side, known),
        steps=effort_steps(known),
        owed=min(debt, own.effort * own.travel),  # a held effort's work ends at the end stops
        ramped=math.inf if walled else ramp_bound(ramp, reserve, known.velocity_limit),
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may supply in a run, as seen by its encoder [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.claimed_s) if isinstance(claim, Claim) else math.inf


def claimed_sentence(axis_name: str, claim: Claim, seconds: float) -> str:
    """Return what an end may supply in a run, as a sentence."""
    seen, true = joules(claim.seen(seconds)), joules(claim.true(seconds))
    moving = ""
    if claim.kinetic > 0.0:
        times = short(claim.seen(seconds) / claim.kinetic)
        moving = f", {times} times the {joules(claim.kinetic)} that it has at its velocity limit"
    least = "" if math.isinf(claim.mass) else ", if its inertia is at least inertia.lower"
    owed = ""
    if claim.owed > 0.0:
        owed = f", {joules(claim.owed)} that its wall may owe after earlier ones"
    return (
        f"{axis_name}: whatever moves it{least}, it supplies at most {seen} in {seconds:g} s "
        f"as seen by its encoder{moving}: twice the reserve of {joules(claim.reserve)}, "
        f"{stall_words(claim)}{owed}, and {watts(claim.leak)}. While the host is prompt that is "
        f"{joules(claim.prompt(seconds))}. If the noise is as declared, it actually supplies at "
        f"most {true}."
    )
