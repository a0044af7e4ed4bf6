"""Coupled stability of a pair: the exact sampled loop with the stated hand, free and in contact.

The device has the rig's beliefs: the lower bound of damping, and both the lower bound and the best
value of the mass. Local walls and the slave's environment are in permanent contact (bilateral).
Linear regime: see `tautwave.analysis.ports.sampled_loop`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tautwave import registry
from tautwave.analysis.grids import merged
from tautwave.analysis.ports.loop_modes import least_damped, transfer
from tautwave.analysis.ports.multirate import RatedEnd, least_damped_rated
from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site
from tautwave.certificate.belief import (
    SIDES,
    Contact,
    assumed,
    delay_in_periods,
    drive_lag,
    stated_environment,
)
from tautwave.certificate.couplings import coupling_verdict, is_silent, silence
from tautwave.certificate.data import LoopCase, PairLoop, Verdict
from tautwave.config import EnvironmentPart, Rig, Wall, local_wall
from tautwave.rig import (
    at_axis_rate,
    axis_allowance,
    coupling_part,
    end_constants,
    velocity_gain,
)
from tautwave.rig.hands import StatedHand, stated_hand
from tautwave.types import CommandDelay

STABLE = 1e-9
"""Rounding tolerance of |z| above 1."""

DRIFT = 1e-9
"""Share of a leaving wave below which a mode is not in it."""

LONG = 60
"""Delay in samples above which only the small gain of both ends is tested."""

LONGEST = 2000
"""Delay in samples above which nothing else is: the modes of a line are twice as many."""

Delays = Mapping[str, CommandDelay]


def pair_loop(rig: Rig, name: str, delays: Delays) -> PairLoop:
    """Return the coupled stability of one pair."""
    hand = stated_hand(rig, name)
    if is_silent(rig) or not coupling_part(rig).linear:
        reason = silence(rig, name)
        if not is_silent(rig):
            reason = (
                f"pair {name}: law {rig.coupling.law} has no linear model (its part provides "
                f"none), so its stability is unknown"
            )
        return PairLoop(name, Verdict(False, reason), hand.text, ())
    cases = tuple(_cases(rig, name, delays, hand))
    conditions: list[str] = []
    for side in SIDES:
        axis_name = f"{side}.{name}"
        conditions += assumed(rig.axes[axis_name], axis_name, inertia=True, damping=True)
    met = None if rig.simulation is None else rig.simulation.environment.get(name)
    if isinstance(met, EnvironmentPart):
        conditions.append(f"part {met.part}, which slave.{name} touches, also keeps it stable")
    unstable = [case for case in cases if not case.stable]
    if unstable and rig.link is not None:
        reason = (
            f"pair {name}: no claim, {unstable[0].contact}, with {hand.text}: over a network the "
            "delay is unknown, and not both ends reflect less than they receive. "
            f"{coupling_verdict(rig).remedy(rig, name)}"
        )
        return PairLoop(name, Verdict(False, reason), hand.text, cases)
    if unstable and rig.delay_samples > LONGEST:
        reason = (
            f"pair {name}: no claim, {unstable[0].contact}, with {hand.text}: the line has "
            f"{rig.delay_samples} samples each way, but modes are computed only up to {LONGEST}, "
            "and not both ends reflect less than they receive. Lower coupling.delay_s, or rate_hz"
        )
        return PairLoop(name, Verdict(False, reason), hand.text, cases)
    if unstable:
        worst = max(unstable, key=lambda case: case.radius)
        reason = (
            f"pair {name}: unstable, {worst.contact}, with {hand.text}: its oscillation at "
            f"{worst.frequency:.3g} Hz grows by {worst.growth:.3g} per second "
            f"(|z| = {worst.radius:.6f}). {_remedy(rig, name, worst)}"
        )
        return PairLoop(name, Verdict(False, reason, margin=1.0 - worst.radius), hand.text, cases)
    known = [case for case in cases if not math.isnan(case.radius)]
    tail, margin = "both ends reflect less than they receive at every frequency", None
    if rig.link is not None:
        tail += ", so for any delay"
    if known:
        worst = max(known, key=lambda case: case.radius)
        margin = 1.0 - worst.radius
        tail = (
            f"its least damped mode, {worst.contact}, is at {worst.frequency:.3g} Hz and "
            f"decays at {-worst.growth:.3g} per second"
        )
    reason = f"pair {name}: stable with {hand.text}; {tail}."
    return PairLoop(name, Verdict(True, reason, tuple(conditions), margin), hand.text, cases)


def _remedy(rig: Rig, name: str, worst: LoopCase) -> str:
    if any(f"the {side}'s wall" in worst.contact for side in SIDES):
        return "Lower the wall's stiffness, or raise the rate."
    return coupling_verdict(rig).remedy(rig, name)


def _cases(rig: Rig, name: str, delays: Delays, hand: StatedHand) -> Iterator[LoopCase]:
    environment = stated_environment(rig, name)
    walls = {side: local_wall(rig, f"{side}.{name}") for side in SIDES}
    # A wall with passivity control gives less than its spring: the linear model does not apply.
    walls = {s: None if w is None or w.passivity_control else w for s, w in walls.items()}
    masters: list[tuple[Wall | None, str]] = [(None, "")]
    masters += [(walls["master"], "the master's wall")] if walls["master"] else []
    slaves: list[tuple[Wall | None, Contact | None, str]] = [(None, None, "")]
    slaves += [(None, environment, environment.text)] if environment else []
    slaves += [(walls["slave"], None, "the slave's wall")] if walls["slave"] else []
    if environment and walls["slave"]:
        slaves.append((walls["slave"], environment, f"the slave's wall, {environment.text}"))
    long = rig.link is not None or rig.delay_samples > LONG
    bounds = ["lower"] if long else ["lower", "value"]
    for master_wall, one in masters:
        for slave_wall, contact, two in slaves:
            touching = " and ".join(text for text in (one, two) if text)
            where = f"in contact with {touching}" if touching else "in free motion"
            for bound in bounds:
                ends = tuple(
                    believed_end(at_axis_rate(rig, axis), axis, delays, bound, held, wall)
                    for axis, held, wall in (
                        (f"master.{name}", _hold(hand), master_wall),
                        (f"slave.{name}", contact, slave_wall),
                    )
                )
                yield _mode(rig, name, (ends[0], ends[1]), where, bound)


def _hold(hand: StatedHand) -> Contact:
    return Contact(hand.hand.stiffness, hand.hand.damping, hand.text)


def _mode(
    rig: Rig, name: str, ends: tuple[LinearEnd, LinearEnd], where: str, bound: str
) -> LoopCase:
    if rig.link is not None:
        return LoopCase(where, bound, _small_gain(ends, drift=True), math.nan, math.nan, math.nan)
    samples = rig.delay_samples
    divisors = [rig.axis_divisor(f"{side}.{name}") for side in SIDES]
    if samples > LONG and coupling_verdict(rig).contracting and _small_gain(ends):
        return LoopCase(where, bound, True, math.nan, math.nan, math.nan)
    if samples > LONGEST:
        return LoopCase(where, bound, False, math.nan, math.nan, math.nan)
    if max(divisors) > 1:
        one, two = (RatedEnd(end, n) for end, n in zip(ends, divisors, strict=True))
        mode = least_damped_rated(one, two, samples, rig.period_s)
    else:
        mode = least_damped(*ends, samples, rig.period_s)
    return LoopCase(
        where, bound, mode.radius <= 1.0 + STABLE, mode.radius, mode.growth, mode.frequency
    )


def _small_gain(ends: tuple[LinearEnd, LinearEnd], *, drift: bool = False) -> bool:
    """Return whether both ends are stable and reflect less than they receive, at any delay.

    `drift`: a mode at z = 1 that no leaving wave shows is none, as the position of a free device.
    """
    product = 1.0
    for end in ends:
        values, vectors = np.linalg.eig(end.a)
        seen = np.abs(end.c @ vectors) > DRIFT * np.linalg.norm(end.c)
        counted = seen | (np.abs(values - 1.0) > STABLE) if drift else np.full(len(seen), True)
        if np.abs(values[counted]).max(initial=0.0) >= 1.0:
            return False
        product *= scattering_norm(end)
    return product < 1.0


def scattering_norm(end: LinearEnd, extra: tuple[float, ...] = ()) -> float:
    """Return the greatest |leaving wave / arriving wave| on a grid [1]; `extra`: angles w T too."""
    grid = [np.geomspace(1e-5, 0.1, 80), np.linspace(0.1, math.pi, 160)]
    grid += [at * np.geomspace(0.7, 1.4, 60) for at in extra]
    theta = merged(grid, 1e-6, math.pi)
    return float(np.abs(transfer(end, np.exp(1j * theta))[0]).max())


def believed_end(
    rig: Rig,
    axis_name: str,
    delays: Delays,
    bound: str,
    contact: Contact | None = None,
    wall: Wall | None = None,
    *,
    damping: float | None = None,
) -> LinearEnd:
    """Return one end of a pair as the rig believes it.

    Parameters
    ----------
    rig : Rig
        Any rig, simulated or not.
    axis_name : str
        Full name; a master that is held also gets the hand's mass.
    delays : mapping
        Declared command delay of each axis.
    bound : str
        `lower` or `value`: which mass is taken.
    contact : Contact, optional
        What is attached to the axis; none: free.
    wall : Wall, optional
        A pressed local wall.
    damping : float, optional
        Device damping [N m s/rad or N s/m]; its lower bound if not given.
    """
    side, name = axis_name.split(".")
    axis, delay = rig.axes[axis_name], delays[axis_name]
    keys = rig.coupling.pairs[name]
    if axis.inertia is None:
        from tautwave.analysis.wave_port.admittance_loop import Outside, admittance_end

        held = Contact(0.0, 0.0, "") if contact is None else contact
        ends = end_constants(rig, axis_name, delay)
        mass = _hand_mass(rig, axis_name, contact)
        outside = Outside(held.stiffness, held.damping, mass, drive_lag(rig, axis_name) or 0.0)
        if axis.follower is not None:
            outside = Outside(
                held.stiffness, spring=axis.follower.stiffness, behind=axis.follower.lag_s
            )
        return admittance_end(
            outside,
            ends.port,
            ends.admittance,
            delay_periods=delay.periods,
            wave_gain=ends.wave,
        )
    device, site = believed_parts(rig, axis_name, delays, bound, contact, wall, damping=damping)
    linear = registry.load_named(coupling_part(rig).linear)
    end: LinearEnd = linear(keys, side, device, site)
    return end


def believed_parts(
    rig: Rig,
    axis_name: str,
    delays: Delays,
    bound: str,
    contact: Contact | None = None,
    wall: Wall | None = None,
    *,
    damping: float | None = None,
) -> tuple[Device, Site]:
    """Return device and site of an impedance axis as the rig believes them; see `believed_end`."""
    axis, delay = rig.axes[axis_name], delays[axis_name]
    assert axis.inertia is not None
    has = axis_allowance(rig, axis_name, delay)
    own = has.inertia if bound == "lower" else axis.inertia.value
    held = Contact(0.0, 0.0, "") if contact is None else contact
    device = Device(
        mass=own + _hand_mass(rig, axis_name, contact),
        damping=(has.sampled_damping if damping is None else damping) + held.damping,
        stiffness=held.stiffness,
        command_delay=delay_in_periods(rig, delay),
    )
    site = Site(
        rig.period_s,
        rig.period_s / (2.0 * has.inertia),
        velocity_gain(rig, axis),
        delay.periods,
        delay.remainder_s / rig.period_s,
        0.0 if wall is None else wall.stiffness,
        0.0 if wall is None else wall.damping,
    )
    return device, site


def _hand_mass(rig: Rig, axis_name: str, contact: Contact | None) -> float:
    """Return the mass of the hand on a master that is held."""
    side, name = axis_name.split(".")
    return stated_hand(rig, name).hand.mass if side == "master" and contact else 0.0
