"""The wave port that tautwave had before: a tracked velocity, an account without a reserve.

A yardstick. Two impedance ports face to face, no line, no slow bus, no series damper, one sample
in each period. Velocity is tracked against a prediction with `velocity_filter_s`, a wave is sent
only if the account can pay, and passes the wave filter after it was paid for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from tautwave.columns import Column
from tautwave.config import Coupling, Pair
from tautwave.contracts import CoupledAxis, CouplingPlugin, Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import Law, Steps, fill_each
from tautwave.laws.limit import clamp
from tautwave.laws.wave_filter import filter_step

DRIFT_S = 0.05
"""Time constant in which unsent wave integral was repaid [s]."""


class AccountPair(Pair):
    """Keys of one pair."""

    wave_impedance: float = Field(gt=0, description="[N m s/rad | N s/m] Of the line.")
    wave_filter_hz: float = Field(gt=0, description="[Hz] Corner of the low-pass on the waves.")
    velocity_filter_s: float = Field(gt=0, description="[s] Memory of the velocity tracker.")


class AccountCoupling(Coupling):
    """Keys of `coupling`."""

    pairs: Mapping[str, AccountPair] = Field(description="The pairs by name.")


class AccountParams(NamedTuple):
    """Constants of one end; `allowance` [J per period] is granted to an account in debt."""

    period: float
    impedance: float
    root: float
    half_mobility: float
    divisor: float
    repay: float
    allowance: float
    gain: float
    filter_gain: float


@dataclass(slots=True)
class AccountEnd:
    """State of one end: account, books [J], gap [W**0.5 s], waves [W**0.5], tracked velocity."""

    account: float = 0.0
    gap: float = 0.0
    velocity: float = 0.0
    impulse: float = 0.0
    leaving: float = 0.0
    filtered: float = 0.0
    wave_in: float = 0.0
    wave_sum: float = 0.0
    wave_energy: float = 0.0
    fastest: float = 0.0
    cut: float = 0.0
    absorbed: float = 0.0
    stored: float = 0.0
    lost: float = 0.0


def end_constants(pair: AccountPair, side: str, axis: CoupledAxis) -> AccountParams:
    """Return the constants of one end."""
    assert axis.inertia is not None
    period, b = axis.period, pair.in_device_units(side, pair.wave_impedance)
    gain = period / (period + pair.velocity_filter_s)
    noise = axis.position_noise**2 + 0.25 * axis.encoder_quantum**2
    mobility = period / (2.0 * axis.inertia)
    return AccountParams(
        period,
        b,
        math.sqrt(2.0 * b),
        mobility,
        1.0 + b * mobility,
        period / (period + DRIFT_S),
        2.0 * b * gain * noise / period,
        gain,
        -math.expm1(-2.0 * math.pi * pair.wave_filter_hz * period),
    )


def start(pair: PairView, gap: float) -> None:
    """Begin at rest, with nothing in the accounts; the slave mends the `gap`."""
    one, two, p2 = pair.one, pair.two, pair.p2
    forget(one, 0.0)
    forget(two, gap * p2.end.root)


def forget(s: AxisState, gap: float) -> None:
    """Begin at rest, with nothing in the account."""
    e = s.end
    e.account = 0.0
    e.gap = gap
    e.velocity = 0.0
    e.impulse = 0.0
    e.leaving = 0.0
    e.filtered = 0.0
    e.wave_in = 0.0
    e.wave_sum = 0.0
    e.wave_energy = 0.0
    e.fastest = 0.0
    e.cut = 0.0
    e.absorbed = 0.0
    e.stored = 0.0
    e.lost = 0.0


def on_acted(s: AxisState, p: AxisParams, tag: float) -> None:
    """Book the wave whose command acted in a slot."""
    s.end.wave_sum += tag
    s.end.wave_energy += p.half_period * tag * tag


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Close the account first, then form the leaving wave, as far as it can be paid."""
    e = s.end
    k = p.end
    mean = displacement / span
    expected = e.velocity - k.half_mobility * (e.impulse + s.effort_sum)
    e.velocity = expected + k.gain * (mean - expected)
    e.impulse = s.effort_sum
    if math.fabs(mean) > e.fastest:
        e.fastest = math.fabs(mean)
    income = port * displacement + e.wave_energy
    e.account += income
    arriving = e.wave_sum / count
    plain = k.root * e.velocity - arriving
    e.gap += k.root * displacement - k.period * e.wave_sum
    leaving = plain + k.repay * (e.gap / k.period - plain)
    payable = 0.0
    if e.account > 0.0:
        payable = math.sqrt(2.0 * e.account / k.period)
    if math.fabs(leaving) > payable:
        e.cut += 1.0
    leaving = clamp(leaving, payable)
    e.account -= 0.5 * k.period * leaving * leaving
    e.gap -= k.period * leaving
    if e.account < 0.0:
        granted = min(count * k.allowance, -e.account)
        e.account += granted
        e.lost -= granted
    e.filtered, stored, lost = filter_step(k.filter_gain, k.period, e.filtered, leaving)
    e.leaving = e.filtered
    e.absorbed += income - 0.5 * k.period * e.leaving * e.leaving
    e.stored = e.account + stored
    e.lost += lost
    e.wave_sum = 0.0
    e.wave_energy = 0.0


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Hand each side's wave to the other."""
    one, two = pair.one, pair.two
    one.end.wave_in = two.end.leaving
    two.end.wave_in = one.end.leaving
    one.tag = one.end.wave_in
    two.tag = two.end.wave_in


def compute_effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort of the port; none of one that owes too much."""
    e = s.end
    k = p.end
    under_way = s.velocity - p.site.half_mobility * s.impulse - free_velocity
    free_velocity = e.velocity - k.half_mobility * e.impulse - under_way
    debt = (k.impedance / k.gain) * (
        k.period * e.fastest * e.fastest + 2.0 * k.half_mobility * s.gross_flow
    )
    if e.account < -debt - 1e-9 * p.half_period * e.wave_in * e.wave_in:
        return 0.0
    effort: float = (k.impedance * free_velocity - k.root * e.wave_in) / k.divisor
    given = -effort * (free_velocity - k.half_mobility * effort) * k.period
    funds = e.account + p.half_period * e.wave_in * e.wave_in
    if given > 0.0 and given > funds:
        effort = effort * max(funds, 0.0) / given
    return effort


SIGNALS = (
    Column("wave_in", "W^½", "the wave that arrived", lambda s, p: s.end.wave_in),
    Column("wave_out", "W^½", "the wave that left", lambda s, p: s.end.leaving),
    Column("cut_waves", "", "waves the account did not pay for so far", lambda s, p: s.end.cut),
)


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names of a pair's elements in the order of their columns."""
    return ["port_master", "port_slave"]


def fill_elements(out: Row, at: int, pair: PairView) -> int:
    """Write the accounts of both ports; a wave that arrived waits for its command to act."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    for s, p in ((one, p1), (two, p2)):
        e = s.end
        waiting = e.wave_energy + p.half_period * s.tag * s.tag
        at = fill_element(out, at, e.absorbed + waiting, e.stored + waiting, e.lost)
    return at


law = Law(
    name="account_port",
    steps=Steps(
        start=start,
        on_acted=on_acted,
        close=close,
        exchange=exchange,
        compute_effort=compute_effort,
        fill_signals=fill_each(SIGNALS),
        fill_elements=fill_elements,
    ),
    end=AccountEnd,
    signals=SIGNALS,
    elements=element_names,
)
plugin = CouplingPlugin("wave ports with accounts", AccountCoupling, law, end_constants)
