"""A wall's damper on a device's own velocity, beside one on differences of its positions.

The joint of a DM-J4310 as in `motor_walls`: 0.0018 kg m^2, 0.02 N m s/rad, positions in steps of
0.38 mrad, velocities in steps of 14.7 mrad/s behind a filter, commands a period late. Three
questions: how much the damper's effort jitters per B while the joint is moved slowly, which B is
passive with any hand, and up to which B the joint is stable by itself.
"""

from __future__ import annotations

import json
import math

import click
import numpy as np

from tautwave.analysis.walls.limits import greatest_damping as of_differences
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.models.encoder import quantise
from tests.analysis.reference.measured_velocity import Velocimeter, greatest_damping, radius
from tests.lab.motor_walls import DAMPING, INERTIA, LOOP_S, STEP

VELOCITY_STEP = 60.0 / 4095
FILTERS_HZ = (30.0, 100.0, 500.0)
RATES = (400.0, 1000.0)
SWAY, SWAY_HZ, SWAY_S = 0.05, 1.0, 20.0
"""The slow motion: amplitude [rad], frequency [Hz], and how long [s]."""
SOFT = 1.0
"""Spring of the wall whose damper is turned up until the joint is unstable [N m/rad]."""


def jitter(rate_hz: float, filter_hz: float, measured: bool) -> float:
    """Return the rms error of a velocity in slow motion, lag apart [rad/s]."""
    per = round(1.0 / (rate_hz * LOOP_S))
    turn = math.tau * SWAY_HZ
    t = LOOP_S * np.arange(round(SWAY_S / LOOP_S))
    x = SWAY * np.sin(turn * t)
    if measured:
        gain = LOOP_S / (LOOP_S + 1.0 / (math.tau * filter_hz))
        raw = np.diff(x, prepend=x[0]) / LOOP_S
    else:
        places = np.array([quantise(one, STEP) for one in x[::per].tolist()])
        gain = 1.0 / (1.0 + rate_hz / (math.tau * filter_hz))
        raw = np.diff(places, prepend=places[0]) * rate_hz
    smooth = np.empty_like(raw)
    state = 0.0
    for at, one in enumerate(raw.tolist()):
        state += gain * (one - state)
        smooth[at] = state
    if measured:
        smooth = np.array([quantise(one, VELOCITY_STEP) for one in smooth[::per].tolist()])
    # What of it is not the motion itself, whatever its lag and gain are.
    when = turn * rate_hz**-1 * np.arange(len(smooth))
    base = np.stack([np.sin(when), np.cos(when)], axis=1)
    after = slice(round(rate_hz), None)
    fit, *_ = np.linalg.lstsq(base[after], smooth[after], rcond=None)
    return float(np.std(smooth[after] - base[after] @ fit))


def greatest_stable(rate_hz: float, filter_hz: float, measured: bool) -> float:
    """Return the greatest B of a soft wall with which the joint alone is stable [N m s/rad]."""
    meter = Velocimeter(1.0 / (math.tau * filter_hz)) if measured else None
    behind = 0.0 if measured else 1.0 / (math.tau * filter_hz)
    low, high = 0.0, 20.0
    user = (INERTIA, DAMPING, 0.0)
    for _ in range(30):
        middle = 0.5 * (low + high)
        if radius(meter, (SOFT, middle), 1.0 / rate_hz, 1, user, behind) <= 1.0:
            low = middle
        else:
            high = middle
    return low


def compared(rate_hz: float, filter_hz: float) -> dict[str, float]:
    """Return what both velocities make of a damper, each behind the same filter."""
    period, behind = 1.0 / rate_hz, 1.0 / (math.tau * filter_hz)
    return {
        "rate_hz": rate_hz,
        "filter_hz": filter_hz,
        "jitter of differences": jitter(rate_hz, filter_hz, measured=False),
        "jitter measured": jitter(rate_hz, filter_hz, measured=True),
        "certified of differences": of_differences(
            SampledWall(0.0, 0.0, period, 1, behind), DAMPING
        ),
        "certified measured": greatest_damping(Velocimeter(behind), DAMPING, period, 1),
        "stable of differences": greatest_stable(rate_hz, filter_hz, measured=False),
        "stable measured": greatest_stable(rate_hz, filter_hz, measured=True),
    }


@click.command("measured-velocity")
@click.option("--json", "as_json", is_flag=True, help="Numbers instead of a table.")
def measured_velocity(as_json: bool) -> None:
    """Measure a wall's damper on a device's own velocity beside one on differences."""
    rows = [compared(rate, filter_hz) for rate in RATES for filter_hz in FILTERS_HZ]
    if as_json:
        click.echo(json.dumps(rows))
        return
    click.echo("jitter [rad/s rms], greatest B certified for any hand and stable alone [N m s/rad]")
    for row in rows:
        click.echo("  ".join(f"{key} {value:.3g}" for key, value in row.items()))
