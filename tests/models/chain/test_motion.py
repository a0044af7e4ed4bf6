"""The step of a moving chain: energy kept, order two, friction that sticks, closed forms."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import pytest

from tautwave.models.chain.build import Body, Link, build_chain
from tautwave.models.chain.motion import (
    HALVINGS,
    Acting,
    Flows,
    chain_step,
    kinetic_energy,
    place_chain,
)
from tautwave.models.chain.params import ChainParams
from tautwave.models.plant import plant_cache, plant_step
from tautwave.models.plant_params import PlantParams
from tests.models.chain.drawn import draw_chain

ALONE = Acting(0.0, 0.0, 0.0)
BARE = PlantParams(0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
HELD = BARE._replace(viscous=0.05, coulomb=0.3, grip_stiffness=30.0, grip_damping=0.3)
TOUCHING = HELD._replace(wall_stiffness=800.0, wall_damping=0.8, wall_position=0.35)
SPRUNG = BARE._replace(spring_stiffness=12.0, spring_position=-0.1)


def chain_of(seed: int, joints: int) -> ChainParams:
    rng = random.Random(seed)
    return build_chain(draw_chain(rng, joints), (0.0, 1.0, -9.81))


def run(chain: ChainParams, plant: PlantParams, steps: int, h: float, **held: Any) -> Any:
    """Return where a chain gets to, its imbalances: of the arm, and of all joints."""
    count = len(chain.joints)
    plants = (plant,) * count
    x, v = [0.1 * i for i in range(count)], [0.5] * count
    before = list(v)
    reference, rate = held.get("reference", 0.2), held.get("rate", 0.0)
    halvings = held.get("halvings", HALVINGS)
    here = place_chain(chain, plants, x)
    start = kinetic_energy(here.matrix, v) + here.potential
    total = [0.0] * len(Flows._fields)
    stored_at_start = stored(plant, x, reference)
    worst = 0.0
    for _ in range(steps):
        guess = [2.0 * new - old for new, old in zip(v, before, strict=True)]
        before = v
        acting = [Acting(held.get("effort", 0.1), reference, rate)] * count
        x, v, flows, here = chain_step(chain, plants, here, x, v, guess, acting, h, halvings)
        reference += rate * h
        for flow in flows:
            total = [a + b for a, b in zip(total, flow, strict=True)]
        books = Flows(*total)
        gained = kinetic_energy(here.matrix, v) + here.potential - start
        held_now = stored(plant, x, reference) - stored_at_start
        lost = books.grip_loss + books.viscous_loss + books.coulomb_loss + books.environment_loss
        outer = books.hand_work + books.motor_work - lost - held_now - books.given
        worst = max(worst, abs(gained - books.given), abs(outer))
    return x, v, worst


def stored(p: PlantParams, x: list[float], reference: float) -> float:
    total = 0.0
    for at in x:
        depth = max(p.wall_side * (at - p.wall_position), 0.0)
        total += 0.5 * p.grip_stiffness * (reference - at) ** 2
        total += 0.5 * p.wall_stiffness * depth**2
        total += 0.5 * p.spring_stiffness * (at - p.spring_position) ** 2
    return total


@pytest.mark.parametrize(
    "plant", [BARE, HELD, TOUCHING, SPRUNG], ids=["bare", "held", "wall", "sp"]
)
def test_energy_changes_by_the_work_done_and_nothing_else(plant: PlantParams) -> None:
    chain = chain_of(4, 3)
    _, _, worst = run(chain, plant, 200, 2e-3, rate=0.3)
    assert worst < 1e-11


@pytest.mark.parametrize(("stiffness", "damping"), [(2e5, 0.0), (2e5, 60.0), (300.0, 2000.0)])
def test_a_wall_far_stiffer_than_the_step_gives_out_nothing(
    stiffness: float, damping: float
) -> None:
    """A step that comes or goes has one solution, whatever h h k / m and h d / m are."""
    chain = chain_of(4, 3)
    plant = BARE._replace(mass=2e-3, wall_stiffness=stiffness, wall_damping=damping)
    x, _, worst = run(chain, plant._replace(wall_position=0.3), 400, 1e-3, effort=0.5)
    assert worst < 1e-9
    assert max(x) < 0.35


@pytest.mark.parametrize(("seed", "count", "h"), [(4, 4, 2e-3), (6, 4, 2e-3), (1, 7, 1e-3)])
def test_a_step_that_does_not_settle_is_halved(seed: int, count: int, h: float) -> None:
    """Springs that turn light joints by radians in a step: the books close all the same."""
    chain = chain_of(seed, count)
    plant = BARE._replace(mass=1e-3, spring_stiffness=2e5, spring_position=-0.1)
    energy = 0.5 * 2e5 * sum((0.1 * i + 0.1) ** 2 for i in range(count))
    assert run(chain, plant, 50, h)[2] < 1e-9 * energy
    assert run(chain, plant, 50, h, halvings=0)[2] > 1e-2 * energy


def test_each_half_of_a_step_is_led_by_its_own_part_of_the_reference() -> None:
    """Hands that move by 0.01 in a step, as stiff as the springs above: their work is in it."""
    plant = BARE._replace(mass=1e-3, grip_stiffness=2e5, grip_damping=1.0)
    energy = 0.5 * 2e5 * sum((0.1 * i + 0.1) ** 2 for i in range(4))
    assert run(chain_of(4, 4), plant, 50, 2e-3, reference=-0.1, rate=5.0)[2] < 1e-9 * energy


def spun(seed: int, speed: float, h: float, steps: int, **more: int) -> Any:
    """Return the speeds of three light joints that spin freely, the matrix there, and energies."""
    chain, plants, none = chain_of(seed, 3), (BARE._replace(mass=1e-3),) * 3, [ALONE] * 3
    x, v = [0.0, 0.1, 0.2], [speed, -speed, speed]
    here = place_chain(chain, plants, x)
    energies = []
    for _ in range(steps):
        x, v, _, here = chain_step(chain, plants, here, x, v, v, none, h, **more)
        energies.append(kinetic_energy(here.matrix, v) + here.potential)
    return v, here.matrix, energies


@pytest.mark.parametrize("seed", [35, 45])
def test_a_step_whose_books_close_by_a_bent_motion_is_halved(seed: int) -> None:
    fine, matrix, _ = spun(seed, 200.0, 2e-3 / 256, 256)
    errors = [
        kinetic_energy(matrix, [a - b for a, b in zip(found, fine, strict=True)])
        for found in (spun(seed, 200.0, 2e-3, 1)[0], spun(seed, 200.0, 2e-3, 1, halvings=0)[0])
    ]
    assert errors[0] < 0.1 * errors[1]


def test_a_step_that_never_settles_gives_nothing_out() -> None:
    """Joints that turn by radians in a step which may not be halved."""
    for seed in range(8):
        _, _, energies = spun(seed, 600.0, 1e-2, 40, halvings=0)
        first = max(abs(energies[0]), 1.0)
        assert all(b - a < 1e-8 * first for a, b in itertools.pairwise(energies))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_energy_of_longer_chains_over_a_longer_time(seed: int) -> None:
    chain = chain_of(20 + seed, 6)
    for plant in (BARE, TOUCHING):
        assert run(chain, plant, 1500, 1e-3)[2] < 1e-10


def test_the_step_is_of_order_two() -> None:
    chain = chain_of(4, 3)
    fine = run(chain, SPRUNG, 320, 1.25e-4)[0]
    errors = [
        max(
            abs(a - b)
            for a, b in zip(run(chain, SPRUNG, steps, 0.04 / steps)[0], fine, strict=True)
        )
        for steps in (20, 40)
    ]
    assert 3.6 < errors[0] / errors[1] < 4.7


def test_one_weightless_joint_is_the_exact_plant() -> None:
    body = Body(0.2, (0.3, 0.0, 0.0))
    chain = build_chain((Link("a", "turns", axis=(0.0, 0.0, 1.0), body=body),), (0.0, 0.0, -9.81))
    p = HELD._replace(coulomb=0.02)
    whole = p._replace(mass=p.mass + 0.2 * 0.3**2)
    cache = plant_cache(whole, 1e-4)
    x, v, mode = 0.0, 0.0, 0
    at, speed = [0.0], [0.0]
    here = place_chain(chain, (p,), at)
    for k in range(2000):
        x, v, mode, *_ = plant_step(whole, cache, x, v, mode, 0.1, 1e-4 * k * 0.3, 0.3, 1e-4)
        acting = [Acting(0.1, 1e-4 * k * 0.3, 0.3)]
        at, speed, _, here = chain_step(chain, (p,), here, at, speed, speed, acting, 1e-4)
    assert at[0] == pytest.approx(x, abs=1e-7)
    assert speed[0] == pytest.approx(v, abs=1e-5)


def test_friction_holds_what_weighs_less_and_lets_go_what_weighs_more() -> None:
    body = Body(1.0, (0.1, 0.0, 0.0))
    chain = build_chain((Link("a", "turns", axis=(0.0, 1.0, 0.0), body=body),), (0.0, 0.0, -9.81))
    weight = 9.81 * 0.1
    for share, moves in ((1.01, False), (0.99, True)):
        p = BARE._replace(coulomb=share * weight)
        x, v = [0.0], [0.0]
        for _ in range(20):
            here = place_chain(chain, (p,), x)
            x, v, flows, _ = chain_step(chain, (p,), here, x, v, v, [ALONE], 1e-3)
        assert (x[0] != 0.0) == moves
    assert flows[0].coulomb_loss == pytest.approx(p.coulomb * v[0] * 1e-3, rel=0.1)
    assert math.copysign(1.0, x[0]) == 1.0  # about +y what sticks out along x falls to +


def test_it_accelerates_as_pinocchio_says() -> None:
    pin: Any = pytest.importorskip("pinocchio")
    import numpy as np

    from tests.models.chain.drawn import pin_model

    rng = random.Random(8)
    links = draw_chain(rng, 5)
    gravity = (0.0, 1.0, -9.81)
    chain = build_chain(links, gravity)
    model, _ = pin_model(pin, links, gravity)
    model.armature = np.full(5, BARE.mass)
    q, v = [0.3, -0.4, 0.2, 0.5, -0.1], [0.6, -0.2, 0.4, 0.3, -0.5]
    effort = [0.5, -0.3, 0.2, 0.1, 0.4]
    acting = [ALONE._replace(effort=one) for one in effort]
    wanted = pin.aba(model, model.createData(), np.array(q), np.array(v), np.array(effort))
    plants = (BARE,) * 5
    h = 1e-6
    here = place_chain(chain, plants, q)
    _, after, _, _ = chain_step(chain, plants, here, q, v, v, acting, h)
    found = [(a - b) / h for a, b in zip(after, v, strict=True)]
    assert found == pytest.approx(list(wanted), rel=1e-3, abs=1e-3)
