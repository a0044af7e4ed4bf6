"""What the port of a wave pair may supply, from the rig's keys: the terms of its `Claim`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import Claim, joules, short, stall_words, watts
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
from tautwave.laws.ramp import ramp_bound, ramp_params
from tautwave.rig import axis_allowance, axis_claim, coupled_axis, wall_params
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
    own = axis_claim(rig, axis_name, delays[axis_name])
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
    debt = wall_params(rig, axis_name, delays[axis_name]).reserve if walled else 0.0
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
