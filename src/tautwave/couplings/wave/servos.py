"""Verdicts on ports of devices that take velocities or positions."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.analysis.claim import Claim
from tautwave.certificate.belief import drive_lag, stated_contact
from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig, simulation_of
from tautwave.couplings.wave.claim import claim_of, claimed_sentence
from tautwave.couplings.wave.from_keys import port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.registry import load_simulator
from tautwave.rig import at_axis_rate
from tautwave.types import CommandDelay


def follower_verdict(
    rig: Rig, axis_name: str, delay: CommandDelay, upper: float, broken: str | None
) -> Verdict:
    """Return whether a follower's port is passive; `broken`: why it cannot pass, if known."""
    follower = rig.axes[axis_name].follower
    assert follower is not None
    name = f"{axis_name} port"
    fault = broken or _contradicted(rig, axis_name)
    if fault is not None:
        return Verdict(False, fault)
    if delay.remainder_s > 0.0:
        return Verdict(False, f"{name}: {whole_periods(delay)}")
    return Verdict(
        True,
        f"{name}: at the goal of a follower, passive by the proof in tautwave.laws.servo.follower "
        f"for a device that lags by up to {1e3 * follower.lag_s:.3g} ms and does not overshoot. "
        f"What {axis_name} does to what it touches is not certified, because "
        "its own drive determines that.",
        (
            f"{axis_name} follows its goal without overshoot, {1e3 * follower.lag_s:.3g} ms late "
            "at most, whatever it touches",
            f"the energy that the device of {axis_name} exchanges with what it touches is not "
            "measured and not part of any claim",
        ),
    )


def whole_periods(delay: CommandDelay) -> str:
    """Say why a command delay of no whole number of periods is refused."""
    return (
        f"its commands act {delay.remainder_s * 1e3:.3g} ms later than a whole number of periods, "
        "but the proof covers whole periods only; choose a rate_hz whose period divides the delay "
        "that the driver declares"
    )


def _contradicted(rig: Rig, axis_name: str) -> str | None:
    """Return a sentence if a simulated position loop is not as the rig believes."""
    axis = rig.axes[axis_name]
    if rig.simulation is None or axis.follower is None:
        return None
    if not load_simulator(rig.buses[axis.bus].driver).loops:
        return None
    truth = simulation_of(rig, axis_name)
    damping = truth.damping + truth.servo_damping
    lag, least = (
        damping / truth.servo_stiffness,
        2.0 * math.sqrt(truth.servo_stiffness * truth.inertia),
    )
    if lag > axis.follower.lag_s * (1.0 + 1e-9):
        return (
            f"{axis_name} port: the simulated device lags by {1e3 * lag:.3g} ms, more than "
            f"follower.lag_s {axis.follower.lag_s:.4g}; raise that to {lag:.3g}"
        )
    if damping < least * (1.0 - 1e-9):
        return (
            f"{axis_name} port: the simulated device overshoots its goal, because its damping "
            f"{damping:.3g} is below {least:.3g}; raise follower.lag_s to "
            f"{least / truth.servo_stiffness:.3g}, or lower its inertia"
        )
    return None


REACHED = 5.0
"""Time constants after which a drive counts as having reached its velocity."""

Delays = Mapping[str, CommandDelay]


def admittance_element(rig: Rig, axis_name: str, delays: Delays, broken: str | None) -> Element:
    """Return the port of an axis that takes velocity; `broken`: why it cannot pass, if known."""
    axis = rig.axes[axis_name]
    side, pair = axis_name.split(".")
    keys = rig.coupling.pairs[pair]
    assert isinstance(keys, WavePair)
    name = f"{axis_name} port"
    upper = axis.outside_stiffness
    claim = claim_of(rig, axis_name, delays)
    assert isinstance(claim, Claim)
    numbers = {
        "impedance": port_impedance(keys, side),
        "environment_stiffness_upper": upper,
        "drive_lag_s": drive_lag(rig, axis_name),
        "command_delay_periods": delays[axis_name].periods,
        **claim._asdict(),
        "seen_j": claim.seen(rig.claimed_s),
    }
    kind, judge = "admittance port", _passive
    if axis.follower is not None:
        kind, judge = "follower", follower_verdict
        numbers["follower_lag_s"] = axis.follower.lag_s
    passive = judge(at_axis_rate(rig, axis_name), axis_name, delays[axis_name], upper, broken)
    quantised = passive
    if passive.passed and claim.leak > 0.0:
        quantised = Verdict(
            False,
            f"{name}: encoder step and noise look like losses; its tank receives "
            f"{1e3 * claim.leak:.3g} mW for them, which may be released.",
            margin=-claim.leak,
        )
    sentences = (passive.reason, claimed_sentence(axis_name, claim, rig.claimed_s))
    return Element(name, kind, axis_name, passive, quantised, numbers, sentences)


def _passive(
    rig: Rig, axis_name: str, delay: CommandDelay, upper: float, broken: str | None
) -> Verdict:
    name = f"{axis_name} port"
    unit = "N m/rad" if rig.axes[axis_name].kind == "rotary" else "N/m"
    lag, contact = drive_lag(rig, axis_name), stated_contact(rig, axis_name)
    if broken is not None:
        return Verdict(False, broken)
    if upper == 0.0:
        return Verdict(False, f"{name}: no guarantee without environment_stiffness_upper; set it")
    if contact is not None and contact.stiffness > upper:
        return Verdict(
            False,
            f"{name}: {contact.text} has {contact.stiffness:.4g} {unit}, more than "
            f"environment_stiffness_upper {upper:.4g}; raise that",
        )
    if contact is not None and contact.damping > 0.0:
        return Verdict(
            False,
            f"{name}: the proof assumes a pure spring as environment; {contact.text} has a "
            "damper. Require coupled_stable",
        )
    if delay.remainder_s > 0.0:
        return Verdict(False, f"{name}: {whole_periods(delay)}")
    if lag is not None and REACHED * lag > rig.period_s:
        return Verdict(
            False,
            f"{name}: the proof needs a drive that reaches its velocity within one period of "
            f"{1e3 * rig.period_s:.3g} ms; the simulated one has a time constant of "
            f"{1e3 * lag:.3g} ms. Require coupled_stable, or make the drive faster",
        )
    return Verdict(
        True,
        f"{name}: passive by the proof in tautwave.laws.servo.admittance for an external "
        f"stiffness up to {upper:.4g} {unit}.",
        (
            f"the drive of {axis_name} reaches its velocity within one period",
            f"what {axis_name} touches is a spring without a damper",
            f"the effort at {axis_name} is known from its samples only, and so is the energy "
            "that it claims",
        ),
    )
