"""What `port_close` leaves out because it cannot matter: the bits of the form written in full."""

from __future__ import annotations

import math
import struct

from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.tracked_port import PortParams, port_close

PERIOD = 1e-3


def in_full(
    p: PortParams,
    account: float,
    gap: float,
    displacement: float,
    periods: float,
    velocity: float,
    effort: float,
    wave_sum: float,
    wave_energy: float,
) -> tuple[float, float, float, float, float, float]:
    """Every root and every division, whether it is needed or not."""
    span = periods * p.period
    slipped = p.slip * effort
    advance = displacement - span * slipped
    income = effort * advance + wave_energy
    account = account + income
    plain = p.root * (velocity - slipped) - wave_sum / periods
    gap = gap + p.root * advance - p.period * wave_sum
    leaving = plain + p.repay * (gap / p.period - plain)
    if account <= 0.0:
        leaving = 0.0
    else:
        ceiling = math.sqrt(2.0 * account / p.period)
        if leaving > ceiling:
            leaving = ceiling
        elif leaving < -ceiling:
            leaving = -ceiling
    sent = 0.5 * p.period * leaving * leaving
    account = account - sent
    gap = gap - p.period * leaving
    forgiven = 0.0
    if account < 0.0 and p.allowance > 0.0:
        forgiven = min(periods * p.allowance, -account)
        account = account + forgiven
    return leaving, account, gap, income - sent, effort * slipped * span, forgiven


def bits(values: tuple[float, ...]) -> bytes:
    return struct.pack(f"{len(values)}d", *values)


def same(account: float, wave: float, gap: float, periods: int) -> None:
    p = PortParams(PERIOD, 0.02, 0.2, 0.25, 1.005, 0.0, 0.02, 1e-9)
    given_ = (p, account, gap, 0.0, float(periods), wave / p.root, 0.0, 0.0, 0.0)
    assert bits(port_close(*given_)) == bits(in_full(*given_))


numbers = st.floats(-1e3, 1e3) | st.floats(allow_nan=False, allow_infinity=False)


@given(numbers, numbers, st.floats(-1e-3, 1e-3), st.integers(1, 5))
@example(0.0, -0.0, 0.0, 1)
@example(5e-324, 1e-160, 0.0, 1)
@example(1e308, -1e160, 0.0, 1)
def test_any_account(account: float, wave: float, gap: float, periods: int) -> None:
    same(account, wave, gap, periods)


@given(st.floats(1e-320, 1e300), st.floats(0.99, 1.01), st.booleans())
def test_an_account_that_just_pays_for_the_wave(account: float, share: float, up: bool) -> None:
    wave = share * math.sqrt(2.0 * account / PERIOD)
    same(account, wave if up else -wave, 0.0, 1)


@given(st.lists(st.floats(-10.0, 10.0), min_size=6, max_size=6), st.integers(1, 5))
def test_any_motion(parts: list[float], periods: int) -> None:
    account, gap, moved, velocity, effort, wave = parts
    p = PortParams(PERIOD, 2.0, 2.0, 0.25, 1.5, 0.5, 0.02, 1e-9)
    given_ = (p, account, gap, moved, float(periods), velocity, effort, wave, wave * wave)
    assert bits(port_close(*given_)) == bits(in_full(*given_))
