"""A certified port beside a certified wall on one motor, on devices heavier than is sure.

The device's damping is shared by both. What the wall does is no push from outside that the port
may mistake; a spring as stiff as the wall counts among the contacts. All are linear in the wall, so
a line behind which all of a wave returns sees the greatest gain of the exact loop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall, wall_transfer
from tautwave.analysis.wave_port.device_class import (
    DeviceClass,
    contracting,
    stiffest_spring,
    wall_spring,
)
from tautwave.analysis.wave_port.port_loop import wave_end
from tautwave.certificate import certify
from tautwave.config import local_wall
from tautwave.laws.observer import observer_params, plain_observer
from tautwave.laws.port import port_params
from tautwave.simulation import simulate
from tests.analysis.ends import spectral_radius
from tests.certificate.rigs import PAIR, element, rig
from tests.rigs.running import rig_of, tree

PLACES = np.geomspace(1e-3, math.pi, 160)
ROUNDING = 1e-9
LEVER = 1.42e-3, 0.1183
"""Least inertia [kg m**2] and damping [N m s/rad]."""


def walled_ports(rng: np.random.Generator, rigs: int, users: int) -> Iterator[LinearEnd]:
    """Yield ends of certified rigs, wall pressed, with true devices of their class."""
    for _ in range(rigs):
        period, mass = 10 ** rng.uniform(-3.5, -2.7), 10 ** rng.uniform(-3.3, -2.0)
        impedance = mass / period * 10 ** rng.uniform(-2.3, -0.3)
        damping = impedance * 10 ** rng.uniform(-2.0, 0.5)
        delay, pole = int(rng.integers(3)), float(rng.choice([0.5, 0.3, 0.1, 0.0, -1.0]))
        share, lag = rng.uniform(0.1, 0.98), period * float(rng.choice([0.0, 0.0, 0.5, 3.0]))
        damper = period * float(rng.choice([0.0, rng.uniform(0.0, 3.0)]))
        leak = wall_leak(SampledWall(1.0, damper, period, float(delay), lag)).damping
        wall = share * damping / leak
        gain = float(rng.choice([1.0, 0.6, 0.45, 0.3]))
        port = port_params(
            period, impedance, mass, delay=float(delay), filter_gain=gain, reserve=1.0
        )
        seen = plain_observer(period, mass)
        least = DeviceClass(mass, damping * (1.0 - share), 0.0)
        held = 0.0  # of the contact that is certified, what the wall takes
        if pole >= 0.0:
            seen = observer_params(period, mass, pole)
            held = wall_spring(wall, damper * wall, period)
        if not contracting(port, seen, delay, least._replace(stiffness=held)):
            continue
        contact = 0.0
        if rng.random() < 0.5:
            contact = max(stiffest_spring(port, seen, delay, least) - held, 0.0)
        site = Site(period, 0.5 * period / mass, period / (period + lag), delay, 0.0, wall)
        site = site._replace(wall_damping=damper * wall)
        for _ in range(users):
            heavier = mass * float(rng.choice([1.0, 10 ** rng.uniform(0.0, 1.5)]))
            spring = contact * float(rng.choice([0.0, 0.3, 1.0]))
            device = Device(heavier, damping, spring, float(delay))
            yield wave_end(device, site, port, seen)


def returned(end: LinearEnd) -> float:
    """Return the greatest share of a wave that an end returns; infinite if it is unstable."""
    if spectral_radius(end.a) > 1.0 + 1e-7:
        return math.inf
    swings = np.abs(np.angle(np.linalg.eigvals(end.a)))
    places = np.concatenate([PLACES, *(swings * share for share in (0.99, 0.999, 1.0, 1.001))])
    places = places[(places >= PLACES[0]) & (places <= math.pi)]
    ahead = np.exp(1j * places)[:, None, None] * np.eye(len(end.b))
    state = np.linalg.solve(ahead - end.a, np.tile(end.b[:, None], (len(places), 1, 1)))
    return float(np.abs(state[:, :, 0] @ end.c).max())


def hold(seed: int, rigs: int) -> int:
    """Check rigs of a seed; return how many ends were met."""
    met = 0
    for end in walled_ports(np.random.default_rng(seed), rigs, 4):
        met += 1
        assert returned(end) <= 1.0 + ROUNDING
    return met


@pytest.mark.slow
def test_a_pressed_wall_beside_a_certified_port_feeds_no_wave() -> None:
    assert hold(3, 12) > 10


@pytest.mark.slow
def test_hundreds_of_walls_beside_certified_ports() -> None:
    assert hold(100, 50) > 100


@pytest.mark.slow
def test_a_heavy_device_at_rest_on_its_wall_stays_at_rest() -> None:
    """It swung ever wider, by 0.3 % a period, when its observer was given the wall's effort."""
    axis = {
        "id": 1,
        "kind": "rotary",
        "effort_limit": 20.0,
        "effort_rate_limit": 1e6,
        "velocity_limit": 200.0,
    }
    ends = {}
    for side, bus, mass, friction in (("master", "hand", 0.05, 0.05), ("slave", "arm", *LEVER)):
        inertia = {"value": mass, "lower": mass, "source": "test"}
        damping = {"value": friction, "lower": friction, "source": "test"}
        ends[f"{side}.axes.a"] = {**axis, "bus": bus, "inertia": inertia, "damping": damping}
    spring = {"type": "spring", "stiffness": 1.5, "position": 0.5}
    made = rig_of(
        tree(
            {
                **ends,
                "rate_hz": 685.0,
                "duration_s": 4.0,
                "coupling.delay_s": 2.0 / 685.0,
                "coupling.pairs.a": {
                    "wave_impedance": 0.3522,
                    "pole_master": 0.3,
                    "pole_slave": 0.3,
                    "wave_filter_hz": 38.9,
                    "wall_slave": {"position": 0.0, "stiffness": 94.3, "side": "above"},
                },
                "simulation": {
                    "environment": {"a": spring},
                    "axes": {
                        "master.a": {"inertia": 0.05, "damping": 0.05},
                        "slave.a": {"inertia": 9.74e-3, "damping": 0.1183},
                    },
                },
            }
        )
    )
    assert certify(made).verdicts["passive"].passed
    run = simulate(made, engine="python")
    swing = [float(np.ptp(part)) for part in np.array_split(run["slave.a.position"], 8)]
    assert swing[-1] < 0.05 * swing[0]


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("lag", [0.0, 2e-3])
def test_no_wall_is_springier_than_the_spring_that_counts_for_it(late: int, lag: float) -> None:
    period, stiffness = 1e-3, 300.0
    x = np.linspace(1e-3, math.pi, 2000)
    for damping in (0.0, 0.3, 2.0, -0.2):
        law = wall_transfer(SampledWall(stiffness, damping, period, late, lag))
        ahead = np.exp(1j * x)
        effort = np.polyval([float(c) for c in law.numerator], ahead) / np.polyval(
            [float(c) for c in law.denominator], ahead
        )
        springy = -(effort * ahead**-late * period / (ahead - 1.0)).imag
        spring = wall_spring(stiffness, damping, period) * period * x / (2 * np.sin(x / 2)) ** 2
        assert np.all(springy <= spring * (1.0 + 1e-12))


@pytest.mark.slow
def test_a_wall_counts_among_the_contacts_of_its_port() -> None:
    held = {}
    for pole in (0.5, "plain"):
        found = certify(rig(f"{PAIR}.pole_slave={pole}", f"{PAIR}.wave_impedance=0.005"))
        numbers = element(found, "slave.lever port").numbers
        held[pole] = numbers["stiffness"]
    wall = local_wall(rig(), "slave.lever")
    assert held["plain"] == pytest.approx(5.0)
    assert held[0.5] == pytest.approx(
        5.0 + wall_spring(wall.stiffness, wall.damping, rig().period_s)
    )
