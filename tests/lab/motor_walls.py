"""Walls of a back-drivable joint: by the host, beside a damper in the motor, in the motor.

The joint of a DM-J4310: 0.0018 kg m^2, 0.02 N m s/rad, positions in steps of 0.38 mrad, commands
that act a period after their sample; a hand presses it with 0.5 N m, 50 mrad before the wall at
first. A wall holds that goes to and fro by no more than 10 mrad in the last second. What is
certified is for any hand, with the damper behind a filter of 500 Hz in a loop of 50 us.

Beside them, both arms' springs in their motors, to where the other arm was (position-position, as
bilateral OpenArms run): its verdict is that of the exact loop of both motors.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import NamedTuple

import click
import numpy as np

from tautwave.analysis.walls.in_motor import damper_needs, damping_for
from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.models.linear import flow_rows
from tautwave.models.plant_params import PlantParams
from tautwave.truth import AxisModel
from tautwave.types import Damper
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.physics import MotorLaw

INERTIA, DAMPING = 0.0018, 0.02
STEP = 25.0 / 65535
PRESS, START, SWING = 0.5, -0.05, 0.01
SECONDS, LAST_S = 6.0, 1.0
MOST, TOP_KP = 4000.0, 500.0
RATES = (400.0, 1000.0)
DAMPERS = (0.0, 0.1, 0.2, 1.0)
FILTER_HZ, LOOP_S = 500.0, 50e-6
LARGE = 10_000.0

Law = Callable[[float, float], tuple[float, MotorLaw]]
"""From the measured depth and the wall's stiffness to an effort and what the motor does itself."""


def joint(rate_hz: float, damping: float = DAMPING) -> SimulatedAxis:
    """Return a joint before a wall at 0, pressed by a hand."""
    plant = PlantParams(INERTIA, damping, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return SimulatedAxis(
        "master.joint",
        AxisModel(
            period=1.0 / rate_hz, plant=plant, foam=None, servo=None, reference=(),
            start_position=START, encoder_quantum=STEP, position_noise=0.0, effort_quantum=0.0,
            velocity_quantum=0.0, effort_limit=10.0, command_delay=1.0, missing_probability=0.0,
            seed=(1,), push=(PRESS,),
        ),
    )  # fmt: skip


def by_host(damping: float, near: float = -math.inf) -> Law:
    """Return a wall of the host; the motor damps, if need be only from a depth on."""

    def law(depth: float, stiffness: float) -> tuple[float, MotorLaw]:
        return -stiffness * max(depth, 0.0), MotorLaw(0.0, 0.0, damping if depth > near else 0.0)

    return law


def in_motor(damping: float) -> Law:
    """Return a spring in the motor that the host switches on and off."""

    def law(depth: float, stiffness: float) -> tuple[float, MotorLaw]:
        return 0.0, MotorLaw(stiffness if depth > 0.0 else 0.0, 0.0, damping)

    return law


def swing(law: Law, stiffness: float, rate_hz: float) -> float:
    """Return by how much the pressed joint still goes to and fro [rad]; inf: it flew off."""
    axis = joint(rate_hz)
    places = []
    for _ in range(round(SECONDS * rate_hz)):
        axis.command(*law(axis.measure().position, stiffness))
        axis.pass_slot()
        places.append(axis.physics.x)
        if not abs(axis.physics.x) < LARGE:
            return math.inf
    last = places[-round(LAST_S * rate_hz) :]
    return float(np.ptp(last)) - abs(last[-1] - last[0])  # not what it still creeps


def greatest_held(law: Law, rate_hz: float, most: float = MOST) -> float:
    """Return the greatest stiffness below which every one of a fine row holds [N m/rad]."""
    held = 0.0
    for stiffness in np.geomspace(1.0, most, 90).tolist():
        if swing(law, stiffness, rate_hz) > SWING:
            return held
        held = stiffness
    return most


def certified(damping: float, rate_hz: float, device: float = DAMPING) -> float:
    """Return the greatest stiffness that is passive with any hand; 0: the damper itself is not."""
    wall = SampledWall(1.0, 0.0, 1.0 / rate_hz, 1, 0.0)
    one = Damper(damping, 1.0 / (math.tau * FILTER_HZ), LOOP_S, 1.0, 0.0)
    if damper_needs(one) >= device and damping > 0.0:
        return 0.0
    found = damping_for(one, device, wall) if damping > 0.0 else device
    return greatest_stiffness(wall, found)


class Both(NamedTuple):
    """Two joints whose motors pull each to where the other was, one period late."""

    stiffness: float
    damping: float
    radius: float
    worst_radius: float
    worst_hand: float

    @property
    def verdict(self) -> str:
        """What becomes of it with hands that hold one arm."""
        if self.radius > 1.0:
            return "unstable free"
        if self.worst_radius > 1.0:
            return f"unstable with a hand of {self.worst_hand:.3g} N m/rad on both"
        return "stable with each of the hands tried; not passive: nothing pays for its delay"


def coupled_radius(
    stiffness: float, damping: float, rate_hz: float, hand: float, device: float = DAMPING
) -> float:
    """Return the spectral radius of both arms in opposite motion, each held by a spring `hand`.

    Each motor's law is a spring to the other's last sample, which is a period old, and a damper to
    the other's velocity then: kp (p - x) + kd (v - x'), p and v held for a period. In opposite
    motion the other is the mirror image: one arm and minus its own past.
    """
    period = 1.0 / rate_hz
    xv, xn, _, vv, vn, _, _, _, _ = flow_rows(stiffness + hand, damping + device, INERTIA, period)
    # States: x, v, and those of the sample before, of which the other arm's motor now knows.
    net = np.array([-(stiffness + hand), -(damping + device), -stiffness, -damping])
    step = np.zeros((4, 4))
    step[0] = xn * net + np.array([1.0, xv, 0.0, 0.0])
    step[1] = vn * net + np.array([0.0, 1.0 + vv, 0.0, 0.0])
    step[2, 0] = step[3, 1] = 1.0
    return float(np.abs(np.linalg.eigvals(step)).max())


def both(stiffness: float, damping: float, rate_hz: float) -> Both:
    """Return the verdict on springs in both motors to each other's places."""
    free = coupled_radius(stiffness, damping, rate_hz, 0.0)
    hands = np.geomspace(0.1, 3e4, 400).tolist()
    worst, hand = max((coupled_radius(stiffness, damping, rate_hz, k), k) for k in hands)
    return Both(stiffness, damping, free, worst, hand)


@click.command("motor-walls")
@click.option("--json", "as_json", is_flag=True, help="Numbers instead of tables.")
def motor_walls(as_json: bool) -> None:
    """Measure walls in the motor beside walls by the host, and springs in both motors."""
    rows = []
    for rate in RATES:
        for damping in DAMPERS:
            near = greatest_held(by_host(damping, -0.1), rate) if damping else math.nan
            rows.append(
                {
                    "rate_hz": rate,
                    "kd": damping,
                    "certified": certified(damping, rate),
                    "certified_0.05": certified(damping, rate, 0.05),
                    "host": greatest_held(by_host(damping), rate),
                    "host, kd from 100 mrad before": near,
                    "spring in the motor": greatest_held(in_motor(damping), rate, TOP_KP),
                }
            )
    pairs = [both(k, b, rate)._asdict() | {"rate_hz": rate, "verdict": both(k, b, rate).verdict}
             for rate in RATES for k, b in ((240.0, 3.0), (16.0, 0.2), (240.0, 0.2))]  # fmt: skip
    if as_json:
        click.echo(json.dumps({"walls": rows, "both": pairs}))
        return
    click.echo("greatest stiffness [N m/rad]")
    for row in rows:
        click.echo("  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    click.echo("springs in both motors, to where the other was")
    for pair in pairs:
        click.echo(f"{pair['rate_hz']:g} Hz kp {pair['stiffness']:g} kd {pair['damping']:g}: "
                   f"{pair['verdict']} (radius {pair['radius']:.4f} free, "
                   f"{pair['worst_radius']:.4f} at worst)")  # fmt: skip
