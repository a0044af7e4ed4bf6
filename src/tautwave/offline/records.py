"""What the kernel works on: constants as NamedTuples, state as plain records of numbers.

The same classes serve every engine. Plain Python takes the objects themselves; numba and C take
NumPy records whose layout `record_type` derives from the annotations, so that `p.site.wall` reads
the same in all three and nothing has to be copied at a call.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

import numpy as np

from tautwave.laws.site import SiteParams
from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import PlantCache, PlantParams
from tautwave.models.servo import ServoParams

PLANT = 0
FOAM = 1
SERVO = 2
HELD = 3
"""Physics of a device; HELD moves with its hand's reference, whatever its motor does."""

FINISHED = 0
MISSING = 1
OVERRUN = 2
GUARD = 3
BROKEN = 4
MISMATCH = 5
NOT_ARMED = 6
"""Ways in which a run ends; the last two before it has begun."""


class RunParams(NamedTuple):
    """Length, ramps and limits of a run, in cycles and ns; see `runtime.loop.LoopSettings`.

    `measured`: the pair of which a few columns are kept in place of whole rows, -1 for the rows.
    """

    period_ns: int
    cycles: int
    axes: int
    pairs: int
    engage_cycles: int
    release_cycles: int
    missing_limit: int
    overrun_limit: int
    overrun_slots: int
    overruns: bool
    arm_share: float
    arm_timeout_ns: float
    measured: int


class SideParams(NamedTuple):
    """One axis of the controller; see `runtime.site.SiteAxis`.

    `delay` commands wait in the pipe table from index `pipe` on, four floats each. `weight` turns
    the device's energy into the pair's. `divisor`: cycles from one exchange to the next, and
    `rated`: one of its pair has more than one; `line_half` is half a period of the line.
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


class DeviceParams(NamedTuple):
    """The truth of one axis; see `truth.AxisModel`.

    `reference` and `last` are the first index in the table of references and the number of the
    last one (-1: no hand); `noise` and `missing` are the first indices of the drawn ones.
    """

    plant: PlantParams
    cache: PlantCache
    foam: FoamParams
    servo: ServoParams
    kind: int
    period: float
    late: float
    encoder_quantum: float
    position_noise: float
    effort_quantum: float
    velocity_quantum: float
    effort_limit: float
    delay: int
    pipe: int
    reference: int
    last: int
    noise: int
    missing: int
    loses: bool


class PairParams(NamedTuple):
    """One pair; see `runtime.pair`. `line` is the first index of its four rings in the table.

    `rated`: one side is slow; see `runtime.rates`.
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


class Side:
    """State of one axis of the controller; the names are those of `SiteAxis`.

    From `held` to `block` it is that of its rate converter.
    """

    position: float
    outside: float
    velocity: float
    wall_velocity: float
    predicted: float
    account: float
    fastest: float
    gap: float
    impulse: float
    depth: float
    start_stored: float
    leaving: float
    wave_in: float
    arrived: float
    command: float
    asked: float
    total: float
    port: float
    wall: float
    wave: float
    far: float
    far_rate: float
    acted_total: float
    acted_port: float
    acted_wall: float
    spread: float
    effort_sum: float
    port_sum: float
    wall_sum: float
    wave_sum: float
    wave_energy: float
    port_energy: float
    gross_flow: float
    uncertainty: float
    port_absorbed: float
    burnt: float
    forgiven: float
    wall_absorbed: float
    wall_dissipated: float
    contact_energy: float
    held: float
    block_mean: float
    rate_absorbed: float
    rate_dissipated: float
    left: int
    block: int
    count: int
    head: int
    missing: int
    guard: int
    valid: bool
    stopping: bool


class Body:
    """State of one simulated device, and what it reports in this cycle.

    `reads`: samples so far; `asked`: the exchange that a slow bus has to answer, -1 for none.
    """

    x: float
    v: float
    hand_work: float
    motor_work: float
    grip_loss: float
    viscous_loss: float
    coulomb_loss: float
    environment_loss: float
    command: float
    acting: float
    held: float
    reference: float
    rate: float
    position: float
    effort: float
    mode: int
    head: int
    slot: int
    reads: int
    asked: int
    valid: bool


class Couple:
    """State of one pair: its offset, line, filters, and the spring of a position coupling."""

    offset: float
    line_energy: float
    filter_master: float
    filter_master_absorbed: float
    filter_master_stored: float
    filter_master_dissipated: float
    filter_slave: float
    filter_slave_absorbed: float
    filter_slave_stored: float
    filter_slave_dissipated: float
    absorbed: float
    stored: float
    start_stored: float
    dissipated: float
    error: float
    at: int


class Outcome:
    """How the run ended: which way, when, at which axis or pair, and with which numbers."""

    kind: int
    slot: int
    which: int
    code: int
    end: int
    armed_at: int
    first: float
    second: float


NUMBERS: dict[Any, Any] = {float: np.float64, int: np.int64, bool: np.bool_}


def fields(record: type[Any]) -> dict[str, Any]:
    """Return the fields of a record class and their types, in the order of its memory."""
    return get_type_hints(record)


def record_type(record: type[Any]) -> np.dtype[Any]:
    """Return the NumPy type of a record class; its layout is that of a C struct."""
    known = _types.get(record)
    if known is None:
        members = [
            (name, NUMBERS[kind] if kind in NUMBERS else record_type(kind))
            for name, kind in fields(record).items()
        ]
        known = _types[record] = np.dtype(members, align=True)
    return known


_types: dict[type[Any], np.dtype[Any]] = {}


def empty(record: type[Any]) -> Any:
    """Return an object of a state class with all numbers zero."""
    blank = record()
    for name, kind in fields(record).items():
        setattr(blank, name, kind())
    return blank
