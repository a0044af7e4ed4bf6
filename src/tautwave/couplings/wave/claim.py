"""What the port of a wave pair may supply, from the rig's keys: the terms of its `Claim`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import Claim, joules, short, watts
from tautwave.config import Rig, local_wall
from tautwave.couplings.wave.from_keys import (
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
from tautwave.models.noise_colour import greatest_spectrum
from tautwave.rig import axis_allowance, coupled_axis
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def allowance_of(rig: Rig, axis_name: str, delays: Delays) -> AxisAllowance:
    """Return what an axis has, and what of it is its port's."""
    return axis_allowance(rig, axis_name, delays[axis_name])


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the port of an axis may supply, or the keys without which it is unbounded."""
    side = axis_name.split(".")[0]
    axis, pair = rig.axes[axis_name], rig.coupling.pairs[axis_name.split(".")[1]]
    assert isinstance(pair, WavePair)
    needed = ["velocity_limit", *(["effort_rate_limit"] if axis.inertia is not None else [])]
    missing = [key for key in needed if getattr(axis, key) is None]
    if missing:
        return " and ".join(missing)
    known = coupled_axis(rig, axis_name, delays[axis_name])
    blind = (
        known.delay
        + known.late
        + rig.loop.missing_limit
        + math.ceil(rig.overrun_limit / rig.axis_divisor(axis_name))
    )
    wall = 0.0 if local_wall(rig, axis_name) is None else axis.effort_limit
    if axis.inertia is None:
        port = servo_port(pair, side, known)
        return Claim(
            reserve=port.reserve,
            leak=port.leak / port.period,
            feigned=0.0,
            effort=axis.effort_limit,
            rate=math.inf,
            velocity=known.velocity_limit,
            wall=wall,
            period=known.period,
            blind=blind,
            mass=math.inf,
            deviation=known.position_noise,
            peak=greatest_spectrum(axis.position_noise_autocorrelation),
            quantum=known.encoder_quantum,
            nonlinearity=axis.encoder_nonlinearity,
            stop_damping=0.0,
            release=0.0,
            kinetic=0.0,
            spring=axis.outside_stiffness,
        )
    observer = observer_of(pair, side, known.period, axis.inertia.lower)
    noise = declared_noise(pair, side, known)
    late = known.delay + known.late
    return Claim(
        reserve=port_reserve(
            port_impedance(pair, side),
            known.period,
            late,
            observer.velocity * known.period,
            known.velocity_limit,
        ),
        leak=tank_leak(pair, side, known),
        feigned=noise.gained,
        effort=axis.effort_limit,
        rate=known.effort_rate,
        velocity=known.velocity_limit,
        wall=wall,
        period=known.period,
        blind=blind,
        mass=axis.inertia.lower,
        deviation=axis.position_noise,
        peak=greatest_spectrum(axis.position_noise_autocorrelation),
        quantum=axis.encoder_quantum,
        nonlinearity=axis.encoder_nonlinearity,
        stop_damping=axis.damping.lower,
        release=rig.coupling.release_ramp_s,
        kinetic=0.5 * axis.inertia.value * known.velocity_limit**2,
        lag=swing_lag(pair, side, known),
        steps=effort_steps(known),
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
    return (
        f"{axis_name} port: whatever moves it{least}, it supplies at most {seen} in {seconds:g} s "
        f"as seen by its encoder{moving}: twice the reserve of {joules(claim.reserve)}, "
        f"{joules(claim.under_way)} from commands acting between samples, and "
        f"{watts(claim.leak)}. If the noise is as declared, it actually supplies at most {true}."
    )
