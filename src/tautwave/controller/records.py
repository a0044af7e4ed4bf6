"""What the controller works on: constants as NamedTuples, state as plain records of numbers."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tautwave.laws.site import SiteParams

FINISHED = 0
MISSING = 1
OVERRUN = 2
GUARD = 3
BROKEN = 4
MISMATCH = 5
NOT_ARMED = 6
FAULT = 7
LINK = 8
"""Ways in which a run ends: `RunState.kind`."""

UNBALANCED = 1
"""`RunState.code` of `NOT_ARMED`: an effort sensor shows more than friction balances."""


PIPE = 5
"""Numbers of a command on its way: total, port, wall, the coupling's tag, inertia's."""

TAG = 3
"""Place of the tag among them."""


NEVER = 1 << 40


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
    `done`, `next_slot` and `skipped`: of a simulation that comes in pieces, its cycles so far, the
    slot of the next one and the slots skipped before it; 0 before it and after its end.
    """

    kind: int = FINISHED
    slot: int = 0
    which: int = 0
    code: int = 0
    end: int = 0
    armed_at: int = -1
    first: float = 0.0
    second: float = 0.0
    found: float = 0.0
    allowed: float = 0.0
    done: int = 0
    next_slot: int = 0
    skipped: int = 0


@dataclass(slots=True)
class Sample:
    """What was measured of an axis in this cycle [rad or m, N m or N]."""

    position: float = 0.0
    effort: float = 0.0
    valid: bool = False


class AxisParams(NamedTuple):
    """Constants of one axis.

    `half_period` is half the axis' own period [s]; `late` the remainder of the command delay as a
    share of it: for that long the command before still acts, and the books hold an interval.
    `ceiling` is the effort or velocity limit, `weight` the pair's energy per energy of the device.
    `delay` commands wait in the table from `pipe` on, `PIPE` floats each. `divisor`: slots from one
    exchange to the next; `half_slot` is half a slot [s]. `end` are the constants of the coupling's
    end here. `blind`: periods without a sample, skipped slots included, after which it stops.
    `senses`: an impedance axis whose outside effort is measured: what is shown less `sensor_zero`,
    times `sensor_gain`. `rest_effort`: the most that a device at rest can balance by its friction,
    where what is measured drives the coupling [N m or N]. `fed`: the coupling takes the measured
    effort for true, so that a sample without it is none.
    """

    site: SiteParams
    half_period: float
    late: float
    ceiling: float
    weight: float
    delay: int
    pipe: int
    impedance: bool
    divisor: int
    half_slot: float
    end: Any
    blind: int = NEVER
    senses: bool = False
    sensor_zero: float = 0.0
    sensor_gain: float = 1.0
    rest_effort: float = math.inf
    fed: bool = False


@dataclass(slots=True)
class InertiaState:
    """State of the inertia compensation of an axis.

    Observed position, velocity and acceleration `push` [rad, rad/s, rad/s**2 or m, ...], and the
    `play` operator's answer to the samples; `effort` of the present command, `acted` last, `sum`
    of what acted since the last sample [N m or N]. Books [J]: `funds` in the account, `work` taken
    from the device, `paid` by its friction, `charged` for noise, `spilled` from a full account.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    play: float = 0.0
    effort: float = 0.0
    acted: float = 0.0
    sum: float = 0.0
    funds: float = 0.0
    work: float = 0.0
    paid: float = 0.0
    charged: float = 0.0
    spilled: float = 0.0


@dataclass(slots=True)
class AxisState:
    """State of one axis: motion, wall, what is on its way, and its books [J].

    `total`, `port_effort`, `wall_effort` are the resisting efforts of the present command [N m or
    N] (`total` of an admittance axis: its velocity), `tag` a number that the coupling put beside
    it. What acted since the last sample is summed up: `count` slots and efforts. `waited` are the
    slots of the interval before, `ramped` those of this one over which a stop's ramp has gone
    already. The pair engaged at the position `begun`; the engage ramp's ceiling was `risen`. `end`
    is the coupling's own state here, and its steps leave the code of a reason to stop in `alarm`,
    with two numbers for its sentence in `found` and `allowed`. `limited` says by bits of
    `laws.limit` why less than what coupling and wall ask for is sent. `dead`: its device
    is in fault.
    """

    position: float = 0.0
    begun: float = 0.0
    risen: float = 0.0
    outside: float = 0.0
    velocity: float = 0.0
    wall_velocity: float = 0.0
    impulse: float = 0.0
    depth: float = 0.0
    wall_stored_at_start: float = 0.0
    command: float = 0.0
    asked: float = 0.0
    total: float = 0.0
    port_effort: float = 0.0
    wall_effort: float = 0.0
    tag: float = 0.0
    acted_total: float = 0.0
    acted_port: float = 0.0
    acted_wall: float = 0.0
    spread: float = 0.0
    effort_sum: float = 0.0
    port_sum: float = 0.0
    wall_sum: float = 0.0
    port_energy: float = 0.0
    gross_flow: float = 0.0
    uncertainty: float = 0.0
    wall_absorbed: float = 0.0
    wall_dissipated: float = 0.0
    wall_contact_energy: float = 0.0
    help_absorbed: float = 0.0
    count: int = 0
    waited: int = 0
    ramped: int = 0
    head: int = 0
    missing: int = 0
    guard: int = 0
    alarm: int = 0
    limited: int = 0
    found: float = 0.0
    allowed: float = 0.0
    valid: bool = False
    stopping: bool = False
    wall_owes: bool = False
    dead: bool = False
    inertia: InertiaState = field(default_factory=InertiaState)
    end: Any = None


class PairParams(NamedTuple):
    """Constants of one pair: x_slave = ratio * x_master + offset, ratio = sign * scale.

    `master` and `slave` are places in the list of axes. `power` is the energy of the slave device
    per energy of the pair (force_scale * scale), `to_master` the inverse of `ratio`, `weight` that
    of `power`. The line has `samples` places, its rings begin at `line` in the table. `rated`: one
    side is slow. `link` are the constants of the coupling between the ends.
    """

    master: int
    slave: int
    rated: bool
    at_engage: bool
    ratio: float
    sign: float
    force_scale: float
    to_master: float
    weight: float
    period: float
    half_period: float
    offset: float
    tolerance: float
    samples: int
    line: int
    link: Any


@dataclass(slots=True)
class PairState:
    """State of one pair: its offset, and in `link` what the coupling keeps between the ends."""

    offset: float = 0.0
    link: Any = None


class PairView(NamedTuple):
    """A pair as its steps see it: states and constants of all that belongs to it.

    `c` and `q` are state and constants of the pair, `one` and `p1` of the master's axis, `two` and
    `p2` of the slave's; `table` holds the commands on their way and the delay line.
    """

    c: PairState
    q: PairParams
    one: AxisState
    two: AxisState
    p1: AxisParams
    p2: AxisParams
    table: MutableSequence[float]


class RunView(NamedTuple):
    """All axes and pairs of a run, in the order of the buses and of the rig file.

    `views` are those of the pairs, made once; compiled code makes them where it uses them
    (`controller.pair.pair_at`), and has none here.
    """

    params: Sequence[AxisParams]
    axes: Sequence[AxisState]
    samples: Sequence[Sample]
    pairs: Sequence[PairParams]
    states: Sequence[PairState]
    table: MutableSequence[float]
    views: Sequence[PairView] = ()
