"""One end of a wave pair: the port's state around its laws, and its books."""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.controller.records import PIPE, AxisParams, AxisState
from tautwave.laws.admittance import admittance_velocity
from tautwave.laws.tracked_port import BANKRUPT, ROUNDING, port_close, port_debt, port_effort


def start_end(s: AxisState, gap: float) -> None:
    """Begin with nothing on its way or stored; `gap` [W**0.5 s] is an offset to mend."""
    e = s.end
    e.predicted = 0.0
    e.account = 0.0
    e.fastest = 0.0
    e.gap = gap
    e.leaving = 0.0
    e.wave_in = 0.0
    e.arrived = 0.0
    e.wave_sum = 0.0
    e.wave_energy = 0.0
    e.port_absorbed = 0.0
    e.damper_dissipated = 0.0
    e.forgiven = 0.0
    e.rate_held = 0.0
    e.rate_mean = 0.0
    e.rate_absorbed = 0.0
    e.rate_dissipated = 0.0
    e.rate_left = 0
    e.rate_count = 0


def receive_wave(s: AxisState, p: AxisParams, arriving: float) -> None:
    """Take the wave of this slot; it is booked with the command that it leads to."""
    e = s.end
    wave = p.end.wave * arriving
    e.arrived = arriving
    e.wave_in = wave
    s.tag = wave


def act(s: AxisState, p: AxisParams, tag: float) -> None:
    """Book the wave whose command acted in a slot."""
    e = s.end
    e.wave_sum += tag
    e.wave_energy += p.half_period * tag * tag


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Form the leaving wave from what happened, under the account."""
    e = s.end
    k = p.end
    leaving, account, gap, absorbed, damped, forgiven = port_close(
        k.port,
        e.account,
        e.gap,
        displacement,
        count,
        s.velocity,
        port,
        e.wave_sum,
        e.wave_energy,
    )
    fastest = math.fabs(displacement / span)
    if fastest > e.fastest:
        e.fastest = fastest
    e.account = account
    e.gap = gap
    e.leaving = leaving
    if k.wave != 1.0:
        e.leaving = leaving / k.wave
    e.port_absorbed += absorbed
    e.damper_dissipated += damped
    e.forgiven += forgiven
    e.wave_sum = 0.0
    e.wave_energy = 0.0


def miss(s: AxisState, p: AxisParams) -> None:
    """Let nothing leave."""
    s.end.leaving = 0.0


def port_credit(s: AxisState, p: AxisParams) -> float:
    """Return the account of a port that owes something [J], or that it is bankrupt."""
    e = s.end
    periods = p.delay
    if p.late > 0.0:
        periods = periods + 1
    debt = port_debt(p.end.port, periods, p.site.gain, e.fastest, s.gross_flow)
    # Relative to a wave that just arrived, a rounding error is not a debt.
    debt += ROUNDING * p.half_period * e.wave_in * e.wave_in
    if e.account < -debt:
        return BANKRUPT
    account: float = e.account
    return account


def think(s: AxisState, p: AxisParams, coast: float) -> float:
    """Return the resisting effort of the port [N m or N]."""
    e = s.end
    account = e.account
    if account < 0.0:
        account = port_credit(s, p)
    effort, ahead = port_effort(p.end.port, account, coast, e.wave_in)
    e.predicted = ahead
    return effort


def move(
    s: AxisState,
    p: AxisParams,
    pending: float,
    wall_push: float,
    wall_stiffness: float,
    wall_damping: float,
) -> float:
    """Return the velocity of an admittance port [rad/s or m/s]."""
    return admittance_velocity(
        p.end.admittance,
        s.outside,
        s.end.wave_in,
        pending,
        wall_push,
        wall_stiffness,
        wall_damping,
    )


def waiting_energy(s: AxisState, p: AxisParams, table: MutableSequence[float]) -> float:
    """Return the energy of waves that arrived but are not booked yet [J]."""
    total: float = s.end.wave_energy + p.half_period * s.tag * s.tag
    for i in range(p.delay):
        at = s.head + i
        if at >= p.delay:
            at = at - p.delay
        wave = table[p.pipe + PIPE * at + 3]
        total += p.half_period * wave * wave
    return total
