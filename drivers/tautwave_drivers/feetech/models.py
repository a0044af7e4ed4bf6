"""What is known of Feetech's models: their motors, seen at the horn.

Sources: STS3215, 7.4 V, 1:345: parameters of Rhoban/bam, identified at the horn; its gears of 1:147
and 1:191 by the ratio. HLS3625: torque constant as LeRobot's users measured it. Of the others only
the number is known: their torque constant has to be stated.
"""

from __future__ import annotations

from typing import NamedTuple


class Model(NamedTuple):
    """A model: its number, gear, and at the horn with that gear torque constant [N m/A].

    `resistance` [ohm] of the winding, `voltage` [V] it is made for, `inertia` [kg m^2] of rotor and
    gears, `friction` [N m s/rad] without the back-EMF; 0: not known. `damping` of the whole at the
    horn while its motor is driven by a voltage is `friction` and torque constant squared over
    resistance.
    """

    name: str
    number: int
    gear: float = 0.0
    torque_constant: float = 0.0
    resistance: float = 0.0
    voltage: float = 0.0
    inertia: float = 0.0
    friction: float = 0.0


MODELS = {
    model.name: model
    for model in (
        Model("STS3215", 777, 345.0, 1.21, 2.68, 7.4, 0.0284, 0.059),
        Model("STS3250", 2825),
        Model("SM8512BL", 11272),
        Model("HLS3625", 3338, 0.0, 0.814),
    )
}
NAMES = {model.number: model.name for model in MODELS.values()} | {1284: "SCS0009"}


def model_name(number: int) -> str:
    """Return the name of a model number, or that it is not known."""
    return NAMES.get(number, f"unknown model {number & 0xFF}.{number >> 8}")
