"""What is true of a simulated axis, as data: handed to a simulator when a rig is built."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams


class AxisModel(NamedTuple):
    """The true device, hand and environment of one axis; SI, rotary N m and rad for N and m.

    Exactly one physics applies: `servo` for an admittance axis, `foam` (with `plant`) for a
    power-law contact, else `plant`. `reference` is the hand's position at every loop slot, empty
    without a hand. `command_delay` is in periods, with a fraction. `seed` starts the axis' own
    random streams: noise and missing samples.
    """

    period: float
    plant: PlantParams
    foam: FoamParams | None
    servo: ServoParams | None
    reference: Sequence[float]
    start_position: float
    encoder_quantum: float
    position_noise: float
    effort_quantum: float
    velocity_quantum: float
    effort_limit: float
    command_delay: float
    missing_probability: float
    seed: tuple[int, ...]
