"""A simulated axis of the loop and the device of compiled runs are the same device, to the bit.

Both call the same models; what each has of its own is around them: the command on its way, the
hand's plan, the sensor's delay, the books. Whatever is drawn of the device, both do the same.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.controller.records import Sample
from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import PlantParams
from tautwave.models.sensors.effort import SensorParams
from tautwave.models.servo import ServoParams
from tautwave.simulation.kernel.pack import Pieces, pack_device
from tautwave.simulation.kernel.records import DeviceState
from tautwave.simulation.live.steps import Devices, step_devices
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tests.examples import tried

SLOTS = 40
Moves = Sequence[tuple[float | None, int]]


def size(low: float, high: float, *, zero: bool = True) -> st.SearchStrategy[float]:
    """A magnitude between two, evenly over its decades; nothing at all in a case of three."""
    some = st.floats(math.log(low), math.log(high)).map(math.exp)
    return st.one_of(st.just(0.0), some, some) if zero else some


@st.composite
def devices(draw: st.DrawFn) -> AxisModel:
    """Return the truth of an axis: every physics that both have, delays, steps, noise, faults."""
    period = draw(st.sampled_from([5e-4, 1e-3, 2.5e-3]))
    side, place = draw(st.sampled_from([-1.0, 1.0])), draw(st.floats(-0.05, 0.05))
    grip = draw(size(1e-2, 1e3)), draw(size(1e-4, 10.0))
    spring = draw(size(1e-2, 1e3)), draw(st.floats(-0.05, 0.05))
    wall = draw(size(1.0, 1e5)), draw(size(1e-3, 1e2)), place, side
    inertia, friction = draw(size(1e-4, 1.0, zero=False)), draw(size(1e-4, 1.0))
    kind = draw(st.sampled_from(["plant", "foam", "servo", "imposed"]))
    foam = servo = sensor = None
    if kind == "foam":
        exponent, loss = draw(st.floats(1.0, 3.0)), draw(size(1e-3, 1.0))
        foam = FoamParams(draw(size(1.0, 1e5, zero=False)), exponent, loss, place, side, 4)
    if kind == "servo":
        servo = ServoParams(draw(size(1e-4, 0.05)), draw(size(1e-3, 1.0)), *grip, *spring, *wall)
    elif kind != "imposed" and draw(st.booleans()):
        sensor = SensorParams(
            draw(size(1e-4, 0.1)), draw(st.floats(0.0, 0.95)), draw(st.integers(0, 3)),
            1.02, draw(st.floats(-0.1, 0.1)), draw(size(1e-4, 0.1)), draw(size(1e-4, 0.1)),
        )  # fmt: skip
    plan = st.lists(st.floats(-0.1, 0.1), min_size=1, max_size=SLOTS)
    led = kind == "imposed" or draw(st.booleans())
    return AxisModel(
        period=period,
        plant=PlantParams(inertia, friction, draw(size(1e-4, 0.5)), *grip, *spring, *wall),
        foam=foam,
        servo=servo,
        reference=tuple(draw(plan)) if led else (),
        start_position=draw(st.floats(-0.05, 0.05)),
        encoder_quantum=draw(size(1e-6, 1e-2)),
        position_noise=draw(size(1e-6, 1e-3)),
        effort_quantum=draw(size(1e-4, 0.1)),
        velocity_quantum=draw(size(1e-4, 0.1)),
        effort_limit=draw(st.sampled_from([0.5, 10.0, math.inf])),
        command_delay=draw(st.sampled_from([0.0, 0.3, 1.0, 1.7, 2.0, 3.9])),
        missing_probability=draw(st.sampled_from([0.0, 0.0, 0.3])),
        seed=(draw(st.integers(0, 99)), 1),
        imposed=kind == "imposed",
        push=tuple(draw(plan)) if kind != "imposed" and draw(st.booleans()) else (),
        sensor=sensor,
    )


MOVES = st.lists(
    st.tuples(st.none() | st.floats(-20.0, 20.0), st.integers(1, 3)),
    min_size=1,
    max_size=SLOTS // 3,
)
"""What is commanded, if anything, and the slots until the next sample."""


def simulated(model: AxisModel, moves: Moves) -> list[float]:
    """Return samples and truth by the axis that the loop has."""
    axis = SimulatedAxis("slave.a", model)
    row = [0.0] * len(axis.columns)
    seen: list[float] = []
    for command, slots in [(None, 0), *moves]:
        if command is not None:
            axis.command(command)
        for _ in range(slots):
            axis.pass_slot()
        sample = axis.measure()
        axis.fill(row, 0)
        seen += [sample.position, sample.effort, float(sample.valid), *row]
    return seen


def packed(model: AxisModel, moves: Moves) -> list[float]:
    """Return the same by the device of compiled runs, in plain Python."""
    floats, flags = Pieces(float), Pieces(bool)
    device = pack_device(model, floats, flags, len(moves) + 1)
    body = DeviceState(x=model.start_position)
    table, lost = floats.join().tolist(), flags.join().tolist()
    w = Devices([device], [body], [Sample()], table, lost)
    row = [0.0] * (12 + 2 * (len(model.reference) > 0))
    values = [0.0] * 3
    seen: list[float] = []
    slot = 0
    for command, slots in [(None, 0), *moves]:
        slot += slots
        values[0] = 0.0 if command is None else command
        step_devices(w, values, row, 1, slot, command is not None)
        seen += [*values, *row]
    return seen


def bits(values: Sequence[float]) -> list[bytes]:
    """Return numbers by their bits; every NaN is the same one."""
    return [struct.pack("d", math.nan if value != value else value) for value in values]


@given(model=devices(), moves=MOVES)
@settings(max_examples=tried(24))
def test_a_device_is_the_same_in_the_loop_and_compiled(model: AxisModel, moves: Moves) -> None:
    assert bits(simulated(model, moves)) == bits(packed(model, moves))
