"""The verdict on a wave port in front of a device that takes positions, and what is not in it.

The proof is in the docstring of `tautwave.laws.servo.follower`.
"""

from __future__ import annotations

import math

from tautwave.certificate.data import Verdict
from tautwave.config import Rig, simulation_of
from tautwave.registry import load_simulator
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
        return Verdict(
            False,
            f"{name}: its commands act {delay.remainder_s * 1e3:.3g} ms later than a whole "
            "number of periods, but the proof covers whole periods only; "
            "choose a rate_hz whose period "
            "divides the delay that the driver declares",
        )
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
