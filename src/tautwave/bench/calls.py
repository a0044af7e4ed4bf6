"""One typical call of every law and model: a lever that moves at 0.4 rad/s, 1 kHz, SI units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from tautwave.laws.coupler import coupler_effort
from tautwave.laws.limit import LimitParams, guard_axis, limit_effort, share_effort
from tautwave.laws.observer import observe, observer_params
from tautwave.laws.port import port_close, port_effort, port_params
from tautwave.laws.servo.admittance import admittance_params, admittance_velocity
from tautwave.laws.site import SiteParams, limit_velocity, render_wall
from tautwave.laws.velocity import track_velocity
from tautwave.laws.wall import WallParams, control_wall, wall_depth, wall_effort, wall_loss
from tautwave.laws.wave_filter import filter_step
from tautwave.models.encoder import quantise
from tautwave.models.foam import FoamParams, foam_step
from tautwave.models.plant import plant_forces, plant_step, plant_stored
from tautwave.models.plant_params import PlantParams, plant_cache
from tautwave.models.servo import ServoParams, servo_step

T = 1e-3
B = 0.02


class Call(NamedTuple):
    """A function, its arguments, and which float among them carries the compiled loop's chain."""

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    chain: int


WALL = WallParams(0.1, 1.0, 3.0, 4e-4, controlled=False)
CONTROLLED = WALL._replace(controlled=True)
LIMIT = LimitParams(1.1, 0.5, 0.0, 15.0, -0.5, 0.5, 2e-3)
PORT = port_params(T, B, 1e-3, filter_gain=0.4, reserve=0.01, leak=1e-9)
OBSERVER = observer_params(T, 1e-3, 0.5)
ADMITTANCE = admittance_params(T, B, 2.0, 0)
SITE = SiteParams(T, PORT.half_mobility, WALL, LIMIT, 1.0, 0.0, has_wall=False)
WALLED = SITE._replace(has_wall=True)
GUARDED = WALLED._replace(wall=CONTROLLED)
SERVO_SITE = WALLED._replace(half_mobility=0.0)

REST = (0.0, 0.0, 0.0, 0.0)

LAWS = (
    Call("track_velocity", track_velocity, (0.5, 0.4, 4e-4, T), 1),
    Call("observe", observe, (OBSERVER, 0.1, 0.4, 1.0, 0.1004, 0.01, 1.0), 2),
    Call("port_effort", port_effort, (PORT, 1e-4, 0.4, 1.0, 0.0, 0.05), 2),
    Call(
        "port_close",
        port_close,
        (PORT, 1e-4, 1e-6, 0.05, 4e-4, 4e-4, 1.0, 0.01, 0.05, 1e-6, False),
        4,
    ),
    Call("wall_depth", wall_depth, (WALL, 0.11), 1),
    Call("wall_effort", wall_effort, (WALL, 0.01, 0.4), 1),
    Call("wall_loss", wall_loss, (WALL, 0.03, 4e-4, 0.0096, 0.01), 1),
    Call("control_wall, active", control_wall, (CONTROLLED, 0.03, 1e-6, -0.2, 0.5, T), 3),
    Call("limit_effort", limit_effort, (LIMIT, 0.2, 0.19, 1.1), 1),
    Call("share_effort", share_effort, (0.03, 0.1, 0.12), 1),
    Call("guard_axis", guard_axis, (LIMIT, 0.1, 0.4), 1),
    Call("filter_step", filter_step, (0.5, T, 0.05, 0.06), 2),
    Call("coupler_effort", coupler_effort, (1.0, 5e-3, 0.11, 0.4, 0.1, 0.3), 2),
    Call("admittance_velocity", admittance_velocity, (ADMITTANCE, 0.1, 0.05, *REST), 1),
    Call("render_wall, touched", render_wall, (WALLED, 1e-6, False, 0.01, 0.4, 0.4, 1.1), 3),
    Call("render_wall, controlled", render_wall, (GUARDED, 1e-6, False, 0.01, 0.4, 0.4, 1.1), 3),
    Call("limit_velocity", limit_velocity, (SERVO_SITE, 0.4, 15.0), 1),
)

# The slave of the shipped bench: lever with friction, a wall at 0.15 rad; a hand holds it.
PLANT = PlantParams(2.4e-3, 4e-3, 2e-3, 3.03, 0.028, 0.0, 0.0, 5.0, 2e-3, 0.15, 1.0)
CACHE = plant_cache(PLANT, T)
FOAM = FoamParams(8.0, 1.5, 0.5, 0.05, 1.0, 1)
SERVO = ServoParams(2e-3, 8e-4, 3.03, 0.028, 1.0, 0.0, 5.0, 2e-3, 0.15, 1.0)

MODELS = (
    Call(
        "plant_step, nothing happens",
        plant_step,
        (PLANT, CACHE, 0.05, 0.4, 0, 0.01, 0.055, 0.4, T),
        2,
    ),
    Call(
        "plant_step, friction stops it",
        plant_step,
        (PLANT, CACHE, 0.05, 4e-4, 0, -1.5e-3, 0.05, 0.0, T),
        2,
    ),
    Call(
        "plant_step, stops and turns back",
        plant_step,
        (PLANT, CACHE, 0.05, 4e-4, 0, -8e-3, 0.05, 0.0, T),
        2,
    ),
    Call(
        "plant_step, meets the wall",
        plant_step,
        (PLANT, CACHE, 0.1498, 0.4, 0, 0.01, 0.155, 0.4, T),
        2,
    ),
    Call("plant_stored", plant_stored, (PLANT, 0.16, 0.4, 0.16), 2),
    Call("plant_forces", plant_forces, (PLANT, 0.16, 0.4, 0.16, 0.4), 1),
    Call("foam_step, in contact", foam_step, (PLANT, FOAM, 0.08, 0.4, 0.01, 0.085, 0.4, T), 2),
    Call("servo_step, no event", servo_step, (SERVO, 0.05, 0.4, 0.41, 0.055, 0.4, T), 1),
    Call("quantise", quantise, (0.11, 2.094e-5), 0),
)
