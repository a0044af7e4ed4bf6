"""Spring and damper of a motor between two commands: exact, and all their work is the motor's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.models.load import LoadParams
from tautwave.models.plant_params import PlantParams
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.physics import NO_LAW, MotorLaw
from tests.sim.truths import PERIOD, truth

LAWS = st.builds(MotorLaw, st.floats(0.0, 400.0), st.floats(-0.2, 0.2), st.floats(0.0, 5.0))
STICKY = PlantParams(0.02, 0.1, 0.05, 30.0, 0.2, 5.0, 0.1, 200.0, 0.1, 0.05, 1.0)
"""With friction, a hand's grip, a spring, and a wall that is met on the way."""


def stepped(plant: PlantParams, law: MotorLaw, effort: float, v: float, parts: int) -> list[float]:
    """Return position and velocity after a period, by small steps of a bare mass and its law."""
    x, h = 0.0, PERIOD / parts
    for _ in range(parts):
        for share in (0.5, 0.5):  # kick, drift, kick
            force = effort + law.stiffness * (law.anchor - x) - (law.damping + plant.viscous) * v
            v += share * h * force / plant.mass
            if share == 0.5:
                x += share * h * v
    return [x, v]


@given(LAWS, st.floats(-5.0, 5.0), st.floats(-2.0, 2.0))
def test_a_period_is_what_small_steps_come_to(law: MotorLaw, effort: float, v: float) -> None:
    model = truth(mass=0.02, viscous=0.1)
    axis = SimulatedAxis("master.a", model)
    axis.physics.v = v
    axis.command(effort, law)
    axis.pass_slot()
    found = np.array([axis.physics.x, axis.physics.v])
    coarse, fine = (np.array(stepped(model.plant, law, effort, v, n)) for n in (100, 200))
    error = np.abs(fine - coarse)
    assert (np.abs(found - fine) <= 2.5 * error + 1e-12).all()


def energy(axis: SimulatedAxis, reference: float) -> float:
    return sum(axis.physics.stored(reference))


@pytest.mark.parametrize(
    "model",
    [
        truth(mass=0.02),
        truth()._replace(plant=STICKY, reference=tuple(0.3 * np.sin(np.arange(60) / 8.0))),
        truth(mass=0.02)._replace(load=LoadParams(0.0, 0.3, 0.2)),
        truth(mass=0.02)._replace(push=(0.4,)),
        truth(mass=0.02)._replace(imposed=True, reference=tuple(np.arange(60) * 1e-3)),
    ],
    ids=["bare", "at a wall", "loaded", "pushed", "imposed"],
)
@pytest.mark.parametrize("delay", [0.0, 1.0, 0.4])
def test_all_of_its_work_is_the_motors(model: AxisModel, delay: float) -> None:
    axis = SimulatedAxis("master.a", model._replace(command_delay=delay))
    laws = [NO_LAW, MotorLaw(80.0, 0.02, 0.3), MotorLaw(0.0, 0.0, 2.0), MotorLaw(200.0, -0.01, 0.0)]
    start = energy(axis, axis.hand()[0])
    for slot in range(50):
        axis.command(0.3, laws[slot // 7 % 4])
        axis.pass_slot()
    p = axis.physics
    gained = energy(axis, axis.hand()[0]) - start
    lost = p.grip_loss + p.viscous_loss + p.coulomb_loss + p.environment_loss
    work = p.hand_work + p.motor_work
    assert abs(p.x) > 5e-4
    assert gained + lost == pytest.approx(work, abs=1e-12 + 1e-9 * abs(work))


def test_it_is_as_late_as_the_effort_beside_it() -> None:
    axis = SimulatedAxis("master.a", truth(mass=0.02, delay=2.0))
    axis.physics.v = 1.0
    speeds = []
    for _ in range(4):
        axis.command(0.0, MotorLaw(0.0, 0.0, 5.0))
        axis.pass_slot()
        speeds.append(axis.physics.v)
    assert speeds[:2] == [1.0, 1.0]
    assert speeds[2] == pytest.approx(np.exp(-5.0 * PERIOD / 0.02))


def test_without_a_law_nothing_is_different() -> None:
    one, other = (SimulatedAxis("master.a", truth()._replace(plant=STICKY)) for _ in range(2))
    other.command(0.0, MotorLaw(10.0, 0.0, 1.0))
    other.command(0.0, NO_LAW)
    for slot in range(40):
        for axis in (one, other):
            axis.command(2.0 - 0.1 * slot)
            axis.pass_slot()
    assert (one.physics.x, one.physics.v) == (other.physics.x, other.physics.v)
    assert one.physics.motor_work == other.physics.motor_work
