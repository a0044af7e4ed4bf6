"""What the controller works on: constants as NamedTuples, state as plain records of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tautwave.laws.site import SiteParams

FINISHED = 0
MISSING = 1
OVERRUN = 2
GUARD = 3
BROKEN = 4
MISMATCH = 5
NOT_ARMED = 6
FAULT = 7
"""Ways in which a run ends: `RunState.kind`."""


PIPE = 4
"""Numbers of a command on its way: total, port, wall, wave."""

RINGS = 4
"""Rings of a line in the table, a place each for every slot of delay."""


class RunParams(NamedTuple):
    """Length, ramps and limits of a run, in cycles and ns; how many axes and pairs there are."""

    period_ns: int
    cycles: int
    axes: int
    pairs: int
    engage_cycles: int
    release_cycles: int
    missing_limit: int
    overrun_limit: int
    arm_share: float
    arm_timeout_ns: float


@dataclass(slots=True)
class RunState:
    """Where a run stands, and how it ended: which way, when, at which axis or pair, and numbers.

    `end` is the slot after the last one, `armed_at` the slot in which the pairs engaged, -1 before.
    """

    kind: int = FINISHED
    slot: int = 0
    which: int = 0
    code: int = 0
    end: int = 0
    armed_at: int = -1
    first: float = 0.0
    second: float = 0.0


@dataclass(slots=True)
class Sample:
    """What was measured of an axis in this cycle [rad or m, N m or N]."""

    position: float = 0.0
    effort: float = 0.0
    valid: bool = False


class AxisParams(NamedTuple):
    """Constants of one axis.

    `wave` is device wave per line wave: sign * sqrt(power ratio); `half_period` half the axis' own
    period [s]; `late` the remainder of the command delay as a share of it: for that long the
    command before still acts, and the books hold an interval. `ceiling` is the effort or velocity
    limit, `weight` the pair's energy per energy of the device. `delay` commands wait in the table
    from `pipe` on, `PIPE` floats each. `divisor`: slots from one exchange to the next; `rated`:
    that of this axis or of the other one of its pair is more than 1; `line_half` is half a slot.
    """

    site: SiteParams
    wave: float
    half_period: float
    late: float
    ceiling: float
    weight: float
    delay: int
    pipe: int
    by_wave: bool
    impedance: bool
    divisor: int
    rated: bool
    line_half: float


@dataclass(slots=True)
class AxisState:
    """State of one axis: motion, port, wall, what is on its way, and its books [J].

    `total`, `port_effort`, `wall_effort` are the resisting efforts of the present command [N m or
    N] (`total` of an admittance axis: its velocity), `command_wave` the wave that led to it. What
    acted since the last sample is summed up: `count` slots, efforts, waves and their energy. The
    `rate_` fields are the rate converter of a slow axis.
    """

    position: float = 0.0
    outside: float = 0.0
    velocity: float = 0.0
    wall_velocity: float = 0.0
    predicted: float = 0.0
    account: float = 0.0
    fastest: float = 0.0
    gap: float = 0.0
    impulse: float = 0.0
    depth: float = 0.0
    wall_stored_at_start: float = 0.0
    leaving: float = 0.0
    wave_in: float = 0.0
    arrived: float = 0.0
    command: float = 0.0
    asked: float = 0.0
    total: float = 0.0
    port_effort: float = 0.0
    wall_effort: float = 0.0
    command_wave: float = 0.0
    far_position: float = 0.0
    far_velocity: float = 0.0
    acted_total: float = 0.0
    acted_port: float = 0.0
    acted_wall: float = 0.0
    spread: float = 0.0
    effort_sum: float = 0.0
    port_sum: float = 0.0
    wall_sum: float = 0.0
    wave_sum: float = 0.0
    wave_energy: float = 0.0
    port_energy: float = 0.0
    gross_flow: float = 0.0
    uncertainty: float = 0.0
    port_absorbed: float = 0.0
    damper_dissipated: float = 0.0
    forgiven: float = 0.0
    wall_absorbed: float = 0.0
    wall_dissipated: float = 0.0
    wall_contact_energy: float = 0.0
    rate_held: float = 0.0
    rate_mean: float = 0.0
    rate_absorbed: float = 0.0
    rate_dissipated: float = 0.0
    rate_left: int = 0
    rate_count: int = 0
    count: int = 0
    head: int = 0
    missing: int = 0
    guard: int = 0
    valid: bool = False
    stopping: bool = False


class PairParams(NamedTuple):
    """Constants of one pair: x_slave = ratio * x_master + offset, ratio = sign * scale.

    `master` and `slave` are places in the list of axes. `power` is the energy of the slave device
    per energy of the pair (force_scale * scale), `to_master` the inverse of `ratio`, `weight` that
    of `power`. The line has `samples` places, its rings begin at `line` in the table: from master,
    from slave, and with the position law the velocities of both. `rated`: one side is slow.
    """

    master: int
    slave: int
    by_wave: bool
    filtered: bool
    rated: bool
    at_engage: bool
    ratio: float
    sign: float
    force_scale: float
    to_master: float
    weight: float
    period: float
    half_period: float
    filter_gain: float
    offset: float
    tolerance: float
    samples: int
    line: int


@dataclass(slots=True)
class PairState:
    """State of one pair: its offset, line, filters, and the spring of a position coupling."""

    offset: float = 0.0
    line_energy: float = 0.0
    filter_master: float = 0.0
    filter_master_absorbed: float = 0.0
    filter_master_stored: float = 0.0
    filter_master_dissipated: float = 0.0
    filter_slave: float = 0.0
    filter_slave_absorbed: float = 0.0
    filter_slave_stored: float = 0.0
    filter_slave_dissipated: float = 0.0
    absorbed: float = 0.0
    stored: float = 0.0
    start_stored: float = 0.0
    dissipated: float = 0.0
    error: float = 0.0
    at: int = 0
