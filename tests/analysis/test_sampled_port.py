"""The sampled two-port against the continuous one at a fast rate, and against a run in time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, position_end
from tautwave.analysis.ports.sampled_port import HIGHEST, Body, sampled_response
from tautwave.analysis.ports.two_port import Hybrid
from tautwave.analysis.wave_port.admittance_loop import Outside, admittance_end
from tautwave.errors import ConfigError
from tautwave.laws.servo.admittance import admittance_params, rigid_port
from tests.analysis.ends import port_end, site_of
from tests.analysis.reference.absolute import absolute_stability
from tests.analysis.reference.hybrids import Rig, position_position, wave_line

INF = math.inf


def near(found: Hybrid, reported: Hybrid, rel: float) -> None:
    for got, wanted in zip(found, reported, strict=True):
        assert np.abs(got / wanted - 1.0).max() <= rel


def position_ends(
    rig: Rig, period: float, delay: float = 0.0
) -> tuple[tuple[LinearEnd, LinearEnd], tuple[Body, Body]]:
    ends, bodies = [], []
    for mass, damping in (
        (rig.master_mass, rig.master_damping),
        (rig.slave_mass, rig.slave_damping),
    ):
        k = rig.stiffness, rig.damping
        end = position_end(
            Device(mass, damping, 0.0, delay),
            site_of(period, mass, math.floor(delay), delay % 1.0),
            stiffness=k[0],
            damping=k[1],
            sent_stiffness=k[0],
            sent_damping=k[1],
        )
        ends.append(end)
        bodies.append(Body(mass, damping, 0.0, delay))
    return (ends[0], ends[1]), (bodies[0], bodies[1])


def test_a_fast_position_pair_is_the_continuous_one() -> None:
    period, samples = 2e-6, 5000
    rig = Rig(0.4, 1.0, 0.6, 2.0, 300.0, 7.0, samples * period, samples * period)
    s = 1j * np.geomspace(0.5, 100.0, 40)
    found = sampled_response(*position_ends(rig, period), samples, period)(s)
    near(found, position_position(rig, s), 2e-3)


def test_a_fast_wave_line_is_the_continuous_one() -> None:
    period, samples = 2e-6, 5000
    rig = Rig(0.4, 1.0, 0.6, 2.0, INF, 0.0, samples * period, samples * period, 10.0)
    s = 1j * np.geomspace(0.5, 100.0, 40)
    ends, bodies = [], []
    for mass, damping in ((0.4, 1.0), (0.6, 2.0)):
        ends.append(port_end(Device(mass, damping), site_of(period, mass), 10.0))
        bodies.append(Body(mass, damping))
    found = sampled_response((ends[0], ends[1]), (bodies[0], bodies[1]), samples, period)(s)
    near(found, wave_line(rig, s), 4e-3)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 1.0, 1.4])
@pytest.mark.parametrize("turn", [0.05, 0.6])
def test_what_a_hand_feels_of_a_slow_pair_is_what_a_run_in_time_shows(
    delay: float, turn: float
) -> None:
    # A sine of force at the master, the slave free; the laws written out once more.
    period, samples, fine = 1e-3, 3, 40
    rig = Rig(0.2, 6.0, 0.3, 5.0, 900.0, 2.0)
    cycle = round(2.0 * math.pi / turn)
    w = 2.0 * math.pi / (cycle * period)
    assert w * period / (2.0 * math.pi) <= HIGHEST
    x, v = [0.0, 0.0], [0.0, 0.0]
    mass, damping = (rig.master_mass, rig.slave_mass), (rig.master_damping, rig.slave_damping)
    before = [0.0, 0.0]
    sent = [[0.0] * (samples + 1), [0.0] * (samples + 1)]
    given = [[0.0] * 4, [0.0] * 4]
    whole, late = math.floor(delay), delay % 1.0
    span = period / fine
    decay = [math.exp(-b * span / m) for m, b in zip(mass, damping, strict=True)]
    steps = 6 * cycle * max(1, round(600 / cycle))
    last = steps - 2 * cycle
    force_part = speed_part = 0j
    for k in range(steps):
        law = [900.0 * x[at] + 2.0 * (x[at] - before[at]) / period for at in (0, 1)]
        before = list(x)
        for at in (0, 1):
            sent[at] = [law[at], *sent[at][:-1]]
        for at in (0, 1):
            given[at] = [law[at] - sent[1 - at][samples], *given[at][:-1]]
        for part in range(fine):
            t = k * period + (part + 0.5) * span
            held = whole + ((part + 0.5) / fine < late)
            force = math.sin(w * t)
            for at in (0, 1):
                net = (force if at == 0 else 0.0) - given[at][held]
                final = net / damping[at]
                moved = final * span + (v[at] - final) * (1.0 - decay[at]) * mass[at] / damping[at]
                after = final + (v[at] - final) * decay[at]
                x[at] += moved
                v[at] = after
                if at == 0 and k >= last:
                    force_part += force * complex(math.cos(w * t), -math.sin(w * t))
                    speed = moved / span
                    speed_part += speed * complex(math.cos(w * t), -math.sin(w * t))
    h = sampled_response(*position_ends(rig, period, delay), samples, period)(np.array([1j * w]))
    assert h.h11[0] == pytest.approx(force_part / speed_part, rel=2e-3)


def test_a_drive_that_takes_velocity_shows_its_law() -> None:
    # A massless master on the line's end, but for half a period here and there.
    period, b, samples = 1e-5, 20.0, 500
    port = rigid_port(period, b, filter_gain=1.0, reserve=1.0, leak=0.0)
    law = admittance_params(period, b, 0.0, 0)
    drive = admittance_end(Outside(lag=0.0), port, law)
    far = port_end(Device(0.3, 1.0), site_of(period, 0.3), b)
    s = 1j * np.geomspace(1.0, 200.0, 40)
    found = sampled_response((drive, far), (Body(), Body(0.3, 1.0)), samples, period)(s)
    reported = wave_line(
        Rig(0.0, 0.0, 0.3, 1.0, INF, 0.0, samples * period, samples * period, b), s
    )
    near(found, reported, 0.02)


def test_the_hold_of_a_stiff_pair_fails_llewellyn_where_the_continuous_one_passes() -> None:
    # b < K T / 2: Colgate and Schenkel's leak, which no continuous model has.
    rig = Rig(0.1, 0.05, 0.1, 0.05, 2000.0)
    w = 2.0 * math.pi * HIGHEST / 1e-3
    assert absolute_stability(lambda s: position_position(rig, s), 1.0, w).stable
    sampled = sampled_response(*position_ends(rig, 1e-3), 0, 1e-3)
    assert not absolute_stability(sampled, 1.0, w).stable


def test_an_end_without_push_is_refused() -> None:
    ends, bodies = position_ends(Rig(0.4, 1.0, 0.6, 2.0, 300.0, 7.0), 1e-3)
    with pytest.raises(ConfigError, match="external force"):
        sampled_response((ends[0]._replace(push=None), ends[1]), bodies, 0, 1e-3)
