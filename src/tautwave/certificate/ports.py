"""Ports and couplings: what their proofs guarantee under the rig's beliefs.

The proofs are in the docstrings of `tautwave.laws.tracked_port` and `tautwave.laws.admittance`. In
addition, the norm of the wave that the port returns, computed from the implemented laws on the
believed device: free, and held by the stated hand or environment.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

from tautwave.analysis.ports.sampled_loop import Device, Site, wave_end
from tautwave.analysis.ports.scattering import greatest_gain, port_scattering, spring_damping
from tautwave.certificate.belief import (
    Contact,
    assumed,
    broken_delay,
    broken_inertia,
    drive_lag,
    stated_contact,
)
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.loops import (
    believed_parts,
    scattering_norm,
)
from tautwave.config import Rig
from tautwave.laws.tracked_port import sensor_allowance
from tautwave.rig import debt_rates, velocity_gain, wave_port
from tautwave.types import CommandDelay

UNITY = 1e-6
"""Tolerance of a norm above 1, for rounding and the grid."""

ACCOUNT = "leaving waves are limited by the port's energy account"
STIFFEST_STEPS = 8
STRIDE = 1.6

REACHED = 5.0
"""Time constants after which a drive counts as having reached its velocity."""

Delays = Mapping[str, CommandDelay]


def port_element(rig: Rig, axis_name: str, delays: Delays, wall_needs: float) -> Element:
    """Return the wave port of an axis; `wall_needs` is the damping its wall requires."""
    axis = rig.axes[axis_name]
    if axis.causality == "admittance":
        return _admittance(rig, axis_name, delays)
    left = max(0.0, axis.damping.lower - wall_needs)
    norms = _norms(rig, axis_name, delays, left)
    passive = _passive(rig, axis_name, delays, norms)
    unit, damper = _units(axis.kind)
    sentences = [passive.reason]
    if passive.passed:
        sentences.append(_bears(axis_name, norms["stiffest"], left, wall_needs, unit, damper))
        if norms["damping_held"] is not None and wall_needs > 0.0:
            whole = wall_needs + norms["damping_held"]
            sentences.append(
                f"{axis_name}: of the device's {axis.damping.lower:.4g} {damper} its wall takes "
                f"{wall_needs:.4g} and its port, held by {norms['held_by']}, "
                f"{norms['damping_held']:.3g}: {whole:.4g} in all."
            )
    allowance = _allowance(rig, axis_name)
    numbers: dict[str, Any] = {
        "impedance": _impedance(rig, axis_name),
        "inertia_lower": None if axis.inertia is None else axis.inertia.lower,
        "damping_left": left,
        "damping_of_wall": wall_needs,
        "command_delay_periods": delays[axis_name].periods,
        "command_delay_remainder_s": delays[axis_name].remainder_s,
        "allowance_j_per_period": allowance,
        **debt_rates(rig, axis_name, delays)._asdict(),
        **norms,
    }
    quantised = _quantised(axis_name, passive, allowance)
    if quantised.reason != passive.reason:
        sentences.append(quantised.reason)
    return Element(
        f"{axis_name} port", "port", axis_name, passive, quantised, numbers, tuple(sentences)
    )


def _bears(
    axis_name: str, stiffest: float, left: float, wall_needs: float, unit: str, damper: str
) -> str:
    """Return the stiffest hold of an axis that its port tolerates without its energy account."""
    head = f"{axis_name} port: held, "
    whose = "left over by its wall" if wall_needs > 0.0 else "of the device"
    if stiffest == 0.0:
        return f"{head}it depends on its energy account: {left:.4g} {damper} of damping {whose}."
    return (
        f"{head}it tolerates springs up to {stiffest:.4g} {unit} without its energy account, "
        f"with the {left:.4g} {damper} of damping {whose}."
    )


def _passive(rig: Rig, axis_name: str, delays: Delays, norms: dict[str, Any]) -> Verdict:
    axis, delay = rig.axes[axis_name], delays[axis_name]
    assert axis.inertia is not None
    name = f"{axis_name} port"
    if delay.remainder_s > 0.0:
        share = delay.remainder_s / rig.period_s
        return Verdict(
            False,
            f"{name}: its commands act {delay.periods + share:.3g} periods late, and the proof "
            f"covers whole periods only; let the drive latch its commands, or choose rate_hz so "
            f"that the "
            f"delay of {delay.periods * rig.period_s + delay.remainder_s:.4g} s is a whole number",
        )
    for broken in (broken_inertia(rig, axis_name), broken_delay(rig, axis_name, delay)):
        if broken is not None:
            return Verdict(False, f"{name}: {broken}")
    if norms["free"] > 1.0 + UNITY:
        return Verdict(
            False,
            f"{name}: on a free device it returns up to {norms['free']:.4g} of a wave; remove "
            f"velocity_filter_s, or lower wave_impedance",
        )
    unit = "kg m^2" if axis.kind == "rotary" else "kg"
    reason = (
        f"{name}: passive by the proof in laws.tracked_port on any free device of at least "
        f"{axis.inertia.lower:g} {unit}, command delay {delay.periods} periods; it returns at most "
        f"{min(norms['free'], 1.0):.6f} of a wave"
    )
    margin = 1.0 - min(norms["free"], 1.0)
    conditions = assumed(axis, axis_name, inertia=True)
    if norms["held"] is not None and norms["held"] > 1.0 + UNITY:
        would = (
            f"held by {norms['held_by']} the bare port would return {norms['held']:.4g} of a wave"
        )
        rates = debt_rates(rig, axis_name, delays)
        kinetic = 2.0 * rates.debt_per_flow
        part = f"{100.0 * kinetic:.3g} % of" if kinetic < 1.0 else f"{kinetic:.3g} times"
        owes = (
            f"its energy account may owe {part} the energy with which the device moves at its "
            f"fastest ({rates.debt_per_speed_squared:.3g} v^2 J)"
        )
        if kinetic >= 1.0:
            pair = axis_name.split(".")[1]
            most = 0.99 * _impedance(rig, f"master.{pair}") / kinetic
            return Verdict(
                False,
                f"{name}: {would}, and {owes}; lower wave_impedance to {most:.3g}, "
                "or raise the rate",
                margin=1.0 - kinetic,
            )
        conditions.append(
            f"{ACCOUNT} at {axis_name}: {would}; {owes} and {100.0 * rates.debt_per_flow:.3g} % of "
            "the gross energy flow, then the port lets go"
        )
    return Verdict(True, f"{reason}.", tuple(conditions), margin)


def _norms(rig: Rig, axis_name: str, delays: Delays, left: float) -> dict[str, Any]:
    """Return the greatest returned shares, proved, free and held; and the stiffest spring."""
    contact = stated_contact(rig, axis_name)
    free = max(_proved(rig, axis_name, delays, at, None, 0.0) for at in ("lower", "value"))
    held, needed = None, None
    if contact is not None:
        held = max(_proved(rig, axis_name, delays, at, contact, left) for at in ("lower", "value"))
        _, site = believed_parts(rig, axis_name, delays, "lower")
        if site.gain == 1.0 and site.delay_periods == 0:
            needed = spring_damping(site, contact.stiffness)
    return {
        "free": free,
        "held": held,
        "held_by": "" if contact is None else contact.text,
        "damping_held": needed,
        "stiffest": _stiffest(rig, axis_name, delays, left),
    }


def _proved(
    rig: Rig, axis_name: str, delays: Delays, bound: str, contact: Contact | None, damping: float
) -> float:
    """Return the greatest share of a wave that an end returns, its filter included, proved."""
    device, site = believed_parts(rig, axis_name, delays, bound, contact, damping=damping)
    return _returned(device, site, rig.coupling.filter_step(rig.period_s))


# Both ends of a pair are often equal, and after a run the same values are needed again.
@functools.lru_cache(maxsize=1024)
def _returned(device: Device, site: Site, filtered: float) -> float:
    return greatest_gain(port_scattering(device, site, filter_gain=filtered)).upper


def _stiffest(rig: Rig, axis_name: str, delays: Delays, left: float) -> float:
    """Return the stiffest spring at which the bare port of an axis returns no more than arrives."""
    if left == 0.0:
        return 0.0
    device, site = believed_parts(rig, axis_name, delays, "lower", damping=left)
    filtered = rig.coupling.filter_step(rig.period_s)
    return _stiffest_spring(device, site, _impedance(rig, axis_name), rig.period_s, filtered)


@functools.lru_cache(maxsize=1024)
def _stiffest_spring(
    device: Device, site: Site, impedance: float, period: float, filtered: float
) -> float:
    """Return the stiffest spring at which the bare port returns no more than arrives.

    Without a velocity filter it is near 2 m b_d / (b T^2), m the mass's lower bound, b_d the
    damping and b the impedance: one period of a force that the port cannot predict. Springs on
    which that mass oscillates faster than half the rate are not covered.
    """
    rule = 2.0 * device.mass * device.damping / (impedance * period**2)
    top = device.mass * (math.pi / period) ** 2
    low = min((0.1 if site.gain == 1.0 else 1e-4) * rule, 1e-3 * top)

    def fine(stiffness: float) -> bool:
        held = device._replace(stiffness=stiffness)
        swing = math.sqrt(stiffness / device.mass) * period
        end = wave_end(held, site, filter_gain=filtered)
        return scattering_norm(end, (swing,)) <= 1.0 + UNITY

    # Search upward, not by bisection: a wave filter may mask the failure at stiffer springs.
    if not fine(low):
        return 0.0
    high = low
    while fine(high):
        if high == top:
            break
        low, high = high, min(STRIDE * high, top)
    else:
        for _ in range(STIFFEST_STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fine(middle) else (low, middle)
        high = low
    # The grid only suggests a spring; the one returned is proved.
    for _ in range(STIFFEST_STEPS):
        if _returned(device._replace(stiffness=high), site, filtered) <= 1.0 + UNITY:
            return high
        high *= 0.5
    return 0.0


def _quantised(axis_name: str, passive: Verdict, allowance: float) -> Verdict:
    if not passive.passed or allowance == 0.0:
        return passive
    return Verdict(
        False,
        f"{axis_name} port: encoder step and noise look like losses; its account forgives up to "
        f"{allowance:.3g} J per period, which may be released (booked as generated).",
        margin=-allowance,
    )


def _allowance(rig: Rig, axis_name: str) -> float:
    axis = rig.axes[axis_name]
    return sensor_allowance(
        rig.period_s,
        _impedance(rig, axis_name),
        velocity_gain(rig, axis),
        axis.encoder_quantum,
        axis.position_noise,
    )


def _impedance(rig: Rig, axis_name: str) -> float:
    impedance: float = wave_port(rig, axis_name, CommandDelay(0, 0.0)).impedance
    return impedance


def _admittance(rig: Rig, axis_name: str, delays: Delays) -> Element:
    axis, delay = rig.axes[axis_name], delays[axis_name]
    name = f"{axis_name} port"
    unit, _ = _units(axis.kind)
    upper, lag = axis.environment_stiffness_upper or 0.0, drive_lag(rig, axis_name)
    contact = stated_contact(rig, axis_name)
    allowance = _allowance(rig, axis_name)
    numbers = {
        "impedance": _impedance(rig, axis_name),
        "environment_stiffness_upper": upper,
        "drive_lag_s": lag,
        "command_delay_periods": delay.periods,
        "allowance_j_per_period": allowance,
    }
    reason = (
        f"{name}: passive by the proof in tautwave.laws.admittance for an outside stiffness up to "
        f"{upper:.4g} {unit}"
    )
    conditions = (
        f"the drive of {axis_name} reaches its velocity within one period",
        f"what {axis_name} touches is a spring without a damper",
    )
    passive = Verdict(True, f"{reason}.", conditions)
    if upper == 0.0:
        text = f"{name}: nothing is guaranteed without environment_stiffness_upper; set it"
        passive = Verdict(False, text)
    elif contact is not None and contact.stiffness > upper:
        passive = Verdict(
            False,
            f"{name}: {contact.text} has {contact.stiffness:.4g} {unit}, more than "
            f"environment_stiffness_upper {upper:.4g}; raise that",
        )
    elif contact is not None and contact.damping > 0.0:
        passive = Verdict(
            False,
            f"{name}: the proof assumes a pure spring as environment; {contact.text} has a "
            f"damper. Require "
            "coupled_stable",
        )
    elif delay.remainder_s > 0.0:
        passive = Verdict(
            False,
            f"{name}: its commands act a fraction of a period late, and the proof covers whole "
            f"periods only",
        )
    elif lag is not None and REACHED * lag > rig.period_s:
        passive = Verdict(
            False,
            f"{name}: the proof needs a drive that reaches its velocity within one period of "
            f"{1e3 * rig.period_s:.3g} ms; the simulated one has a time constant of "
            f"{1e3 * lag:.3g} ms. Require coupled_stable, or make the drive faster",
        )
    quantised = _quantised(axis_name, passive, allowance)
    sentences = (passive.reason,)
    return Element(name, "admittance port", axis_name, passive, quantised, numbers, sentences)


def _units(kind: str) -> tuple[str, str]:
    return ("N m/rad", "N m s/rad") if kind == "rotary" else ("N/m", "N s/m")
