"""The in-memory line, against closed forms of a lossless line (theory 3.2; checks D11, D12)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.port import port_close, port_effort, port_params
from tautwave_scenes.networks.strings import DelayLine
from tests.laws.loops import RICH, Device, matrix_of
from tests.laws.waves import decode_effort, decode_velocity, encode_wave

T = 1e-3
waves = st.lists(st.tuples(st.floats(-10, 10), st.floats(-10, 10)), min_size=1, max_size=80)


@given(st.integers(1, 20), waves)
def test_what_goes_in_comes_out_after_the_delay(
    samples: int, sent: list[tuple[float, float]]
) -> None:
    line = DelayLine(samples, T)
    got = [line.exchange(*pair) for pair in sent]
    expected = [(0.0, 0.0)] * samples + [(two, one) for one, two in sent]
    assert got == expected[: len(sent)]


@given(st.integers(1, 20), waves)
def test_it_is_lossless_and_never_gives_what_it_has_not(
    samples: int, sent: list[tuple[float, float]]
) -> None:
    line, flow = DelayLine(samples, T), 1e-30
    for one, two in sent:
        at_master, at_slave = line.exchange(one, two)
        flow += 0.5 * T * (one**2 + two**2 + at_master**2 + at_slave**2)
        assert line.absorbed == line.stored
        assert line.absorbed >= -1e-12 * flow
        on_it = 0.5 * T * sum(wave * wave for wave in (*line._to_slave, *line._to_master))
        assert abs(on_it - line.stored) <= 1e-12 * flow


def test_a_skipped_slot_is_a_null_wave() -> None:
    line = DelayLine(2, T)
    line.exchange(1.0, 2.0)
    assert line.exchange(0.0, 0.0) == (0.0, 0.0)
    assert line.exchange(0.0, 0.0) == (2.0, 1.0)
    assert line.exchange(3.0, 3.0) == (0.0, 0.0)
    assert line.stored == pytest.approx(T * 9.0)


def test_filling_puts_no_energy_on_it() -> None:
    line = DelayLine(3, T)
    line.fill(5.0, 7.0)
    assert line.stored == 0.0
    assert line.exchange(0.0, 0.0) == (7.0, 5.0)


def test_no_delay_is_no_line() -> None:
    with pytest.raises(ValueError, match="leave it out"):
        DelayLine(0, T)


# -- D11: an ideal velocity source v0 at one end -----------------------------------------------

V0, B, TAU = 0.1, 10.0, 0.05


def drive(period: float, end, steps: int) -> tuple[list[float], list[float]]:
    """Return the efforts at the source and the velocities at the far end."""
    line = DelayLine(round(TAU / period), period)
    efforts, speeds = [], []
    back = 0.0
    here = 0.0  # wave arriving at the source
    for _ in range(steps):
        effort = decode_effort(here, V0, B)
        here, there = line.exchange(encode_wave(effort, V0, B), back)
        back, speed = end(there)
        efforts.append(effort)
        speeds.append(speed)
    return efforts, speeds


def free(arriving: float) -> tuple[float, float]:
    speed = decode_velocity(arriving, 0.0, B)
    return encode_wave(0.0, speed, B), speed


def clamped(arriving: float) -> tuple[float, float]:
    return encode_wave(decode_effort(arriving, 0.0, B), 0.0, B), 0.0


def matched(arriving: float) -> tuple[float, float]:
    """A damper b: R = -b v, and R = b v - sqrt(2 b) arriving."""
    speed = math.sqrt(2.0 * B) * arriving / (2.0 * B)
    return encode_wave(-B * speed, speed, B), speed


def flights(samples: list[float], period: float) -> list[float]:
    """Return the value in the middle of each double flight time of the line."""
    trip = 2 * round(TAU / period)
    return [samples[k] for k in range(trip // 2, len(samples), trip)]


def test_D11_free_end() -> None:
    efforts, speeds = drive(T, free, 600)
    assert flights(efforts[1:], T) == pytest.approx([1.0, -1.0] * 3, abs=1e-9)
    assert flights(speeds[50:], T) == pytest.approx([0.2, 0.0, 0.2, 0.0, 0.2], abs=1e-9)


def test_D11_clamped_end() -> None:
    efforts, _ = drive(T, clamped, 400)
    assert flights(efforts, T) == pytest.approx([1.0, 3.0, 5.0, 7.0], rel=1e-9)
    assert len(set(np.round(efforts, 9))) == 4  # a clean staircase


def test_D11_matched_end_returns_nothing() -> None:
    line = DelayLine(50, T)
    back = 0.0
    for k in range(400):
        sent = math.sin(0.1 * k) + 1.5
        home, there = line.exchange(sent, back)
        back, _ = matched(there)
        assert abs(home) <= 1e-12 * 2.5
    efforts, _ = drive(T, matched, 400)
    assert efforts == pytest.approx([1.0] * 400, rel=1e-12)


def test_D11_spring_end() -> None:
    period, K = 1e-4, 200.0
    seen: list[float] = []
    stretch = 0.0

    def spring(arriving: float) -> tuple[float, float]:
        nonlocal stretch
        # Trapezoid: F = K (x + T v / 2), and F = sqrt(2 b) u - b v.
        speed = (math.sqrt(2.0 * B) * arriving - K * stretch) / (B + 0.5 * K * period)
        force = K * (stretch + 0.5 * period * speed)
        stretch += period * speed
        seen.append(force)
        return encode_wave(-force, speed, B), speed

    drive(period, spring, 1100)
    at = round(0.1 / period)
    assert seen[at] == pytest.approx(1.26424, abs=2e-3)
    for t in (0.06, 0.08, 0.1, 0.14):
        exact = 2.0 * B * V0 * (1.0 - math.exp(-K * (t - TAU) / B))
        if t < 0.1101:
            assert seen[round(t / period)] == pytest.approx(exact, abs=2e-3)


# -- D12: the whole rig, with a proportional-derivative slave built from the law functions ------


def rig_admittance(omega: float, damping: float, clamped_slave: bool) -> complex:
    """Return velocity per force at the master of m = .5/.5, b = 10, tau = .05, K = 100, B = 10.

    The master is a wave port on an exactly known mass; T = 0.1 ms. The port sends a period later
    than the ideal one, so its way to the slave is a sample shorter. The predictor is reported the
    hand's force: unknown, it would cost b T / m of the effort (0.2 % here).
    """
    period, K, D, mass = 1e-4, 100.0, 10.0, 0.5
    samples = round(TAU / period)
    p = port_params(period, B, mass, reserve=RICH)
    row_x, row_v = Device(mass, damping).flow(period)
    root = math.sqrt(2.0 * B)

    def cycle(state: list[float]) -> list[float]:
        v, moved, velocity, _, _, acted, wave, xs, vs, xd, before = state[:11]
        ahead, back = state[11 : 10 + samples], state[10 + samples : -1]
        leaving, *_ = port_close(p, RICH, 0.0, 0.0, moved, moved, 1.0, acted, wave, 0.0, False)
        arriving = back[0]
        velocity = moved / period
        held = state[-1]  # force of the hand
        free_velocity = velocity - p.half_mobility * (acted - before - held)
        effort = port_effort(p, RICH, free_velocity, 0.0, 0.0, arriving)
        at_slave = ahead[0]
        # F_s = (K e + B (root u / b - v_s)) / (1 + B / b), in resisting terms R = -F_s.
        force = (K * (xd - xs) + D * (root * at_slave / B - vs)) / (1.0 + D / B)
        wanted = decode_velocity(at_slave, -force, B)
        returned = encode_wave(-force, wanted, B)
        step = row_x[1] * v + row_x[2] * (effort - held)
        after = row_v[1] * v + row_v[2] * (effort - held)
        if clamped_slave:
            xs, vs_after = 0.0, 0.0
        else:
            xs, vs_after = (
                xs + row_x[1] * vs - row_x[2] * force,
                row_v[1] * vs - row_v[2] * force,
            )
        return [
            after, step, velocity, acted, 0.0, effort, arriving, xs, vs_after,
            xd + period * wanted, held, *ahead[1:], leaving, *back[1:], returned, held,
        ]  # fmt: skip

    size = 11 + (samples - 1) + samples + 1
    full = matrix_of(cycle, size)
    a, b = full[:-1, :-1], full[:-1, -1]
    z = np.exp(1j * omega * period)
    state = np.linalg.solve(z * np.eye(size - 1) - a, b)
    # Mean velocity over the period in which the force acted: displacement at its end.
    return complex(z * state[1] / period)


@pytest.mark.parametrize(("damping", "mass"), [(0.0, 1.5), (1.0, 1.485)])
def test_D12_apparent_mass_in_free_motion(damping: float, mass: float) -> None:
    omega = 0.3
    impedance = 1.0 / rig_admittance(omega, damping, clamped_slave=False)
    assert impedance.imag / omega == pytest.approx(mass, rel=1e-3)
    assert impedance.real == pytest.approx(2.0 * damping, abs=5e-3)


def test_D12_stiffness_against_a_clamp() -> None:
    omega = 0.05
    impedance = 1.0 / rig_admittance(omega, 0.0, clamped_slave=True)
    assert (impedance * 1j * omega).real == pytest.approx(66.6667, rel=1e-3)
