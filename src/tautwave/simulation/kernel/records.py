"""What the kernel works on: constants as NamedTuples, state as plain records of numbers.

The same classes serve every engine. Plain Python takes the objects themselves; numba takes NumPy
records whose layout `record_type` derives from the annotations, so that `p.site.wall` reads
the same in all three and nothing has to be copied at a call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import PlantCache, PlantParams
from tautwave.models.sensors.effort import SensorParams
from tautwave.models.servo import ServoParams

PLANT = 0
FOAM = 1
SERVO = 2
HELD = 3
"""Physics of a device; HELD moves with its hand's reference, whatever its motor does."""


class FakeParams(NamedTuple):
    """What is simulated of the host, and what is kept.

    After a cycle with a flag the loop oversleeps by `overrun_slots`, if `overruns`. `measured` is
    the pair of which a few columns are kept in place of whole rows, -1 for the rows.
    """

    overrun_slots: int
    overruns: bool
    measured: int


class DeviceParams(NamedTuple):
    """The truth of one axis; see `truth.AxisModel`.

    `reference` and `last` are the first index in the table of references and the number of the
    last one (-1: no hand); `push` and `pushes` the first index of recorded efforts and how many;
    `sensed` the first index of what the effort sensor will show, `sensor_noise` of its noise;
    `noise` and `missing` are the first indices of the drawn ones.
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
    push: int
    pushes: int
    senses: bool
    sensor: SensorParams
    sensed: int
    sensor_noise: int


@dataclass(slots=True)
class DeviceState:
    """State of one simulated device.

    `push` is the recorded effort on it at this slot, `pushed` the work it did. The effort sensor
    has filtered `felt` and shows `shown`; `speed` is that of the slot before. `reads`: samples so
    far; `asked`: the pending exchange of a slow bus, -1 for none.
    """

    x: float = 0.0
    v: float = 0.0
    hand_work: float = 0.0
    motor_work: float = 0.0
    grip_loss: float = 0.0
    viscous_loss: float = 0.0
    coulomb_loss: float = 0.0
    environment_loss: float = 0.0
    pushed: float = 0.0
    push: float = 0.0
    felt: float = 0.0
    shown: float = 0.0
    speed: float = 0.0
    shown_at: int = 0
    command: float = 0.0
    acting: float = 0.0
    held: float = 0.0
    reference: float = 0.0
    rate: float = 0.0
    mode: int = 0
    head: int = 0
    slot: int = 0
    reads: int = 0
    asked: int = -1


class Tables(NamedTuple):
    """What `kernel.run_rig` works on: NumPy arrays of records, or lists of objects.

    `out` holds rows one after the other; `views` are those of the pairs, of objects alone.
    """

    runs: Any
    fakes: Any
    outcomes: Any
    params: Any
    axes: Any
    samples: Any
    devices: Any
    bodies: Any
    pairs: Any
    states: Any
    table: Any
    flags: Any
    out: Any
    views: Any = ()


NUMBERS: dict[Any, Any] = {float: np.float64, int: np.int64, bool: np.bool_}


def fields(record: type[Any]) -> dict[str, Any]:
    """Return the fields of a record class and their types, in the order of its memory."""
    return get_type_hints(record)


def record_type(record: type[Any], **parts: type[Any]) -> np.dtype[Any]:
    """Return the NumPy type of a record class, laid out as C does.

    `parts` are the classes of those fields that are a coupling's, and `Any` to the controller.
    """
    key = record, tuple(parts.items())
    known = _types.get(key)
    if known is None:
        members = [
            (name, NUMBERS[kind] if kind in NUMBERS else record_type(parts.get(name, kind)))
            for name, kind in fields(record).items()
        ]
        known = _types[key] = np.dtype(members, align=True)
    return known


def parts_of(values: Sequence[Any]) -> dict[str, type[Any]]:
    """Return the classes of those fields that are a coupling's, as the first value has them."""
    if not values:
        return {}
    kinds = fields(type(values[0]))
    return {name: type(getattr(values[0], name)) for name, kind in kinds.items() if kind is Any}


_types: dict[Any, np.dtype[Any]] = {}


def empty(record: type[Any]) -> Any:
    """Return an object of a state class with all numbers zero."""
    blank = record()
    for name, kind in fields(record).items():
        setattr(blank, name, kind())
    return blank
