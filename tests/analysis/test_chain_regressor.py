"""Efforts as a linear function of a chain's parameters, and what no motion tells apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from tautwave.analysis.identification.chain_regressor import (
    PARAMETERS,
    base_of,
    efforts_by_body,
    parameters_of,
)
from tautwave.models.chain.build import Body, Link, build_chain, roll_pitch_yaw
from tautwave.models.chain.params import ChainParams
from tautwave.session.identification.weighing import needed

DOWN = (0.0, 0.0, -9.81)


def random_chain(seed: int, kinds: Sequence[str]) -> ChainParams:
    """Return a chain of bodies that exist, with axes and places at random."""
    rng = np.random.default_rng(seed)
    links = []
    for number, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        points = rng.normal(scale=0.1, size=(6, 3))
        mass = float(rng.uniform(0.2, 2.0))
        around = points - points.mean(axis=0)
        second = mass * around.T @ around / 6.0
        inertia = np.trace(second) * np.eye(3) - second
        body = Body(mass, tuple(points.mean(axis=0).tolist()), tuple(map(tuple, inertia.tolist())))  # type: ignore[arg-type]
        turn = roll_pitch_yaw(*rng.uniform(-2, 2, 3).tolist())
        place = tuple(rng.uniform(-0.3, 0.3, 3).tolist())
        unit = tuple((axis / np.linalg.norm(axis)).tolist())
        links.append(Link(f"j{number}", kind, place, turn, unit, body))  # type: ignore[arg-type]
    return build_chain(tuple(links), (1.0, -2.0, -9.0))


@pytest.mark.parametrize(
    "kinds", [("turns",) * 3, ("turns", "slides", "turns"), ("slides", "turns")]
)
def test_it_is_the_inverse_dynamics_of_the_laws(kinds: Sequence[str]) -> None:
    """Another way to the same numbers: mass matrix, Coriolis efforts and weight."""
    chain = random_chain(4, kinds)
    q, v, a = np.random.default_rng(5).normal(size=(3, 8, len(kinds)))
    blocks = efforts_by_body(chain, q, v, a)
    found = np.concatenate(blocks, axis=2) @ parameters_of(chain)
    wanted = np.array([needed(chain, *row) for row in zip(q, v, a, strict=True)])
    assert found == pytest.approx(wanted, abs=1e-11)


def planar(l1: float = 0.4) -> ChainParams:
    """Return two parallel joints that swing in a vertical plane, about y."""
    links = (
        Link("a", "turns", axis=(0.0, 1.0, 0.0), body=Body(1.0, (0.2, 0.0, 0.0))),
        Link("b", "turns", (l1, 0.0, 0.0), axis=(0.0, 1.0, 0.0), body=Body(0.5, (0.1, 0.0, 0.0))),
    )
    return build_chain(links, DOWN)


def test_a_planar_arm_of_two_joints_has_six_base_parameters() -> None:
    """The two first moments in the plane and the inertia of each body, regrouped."""
    base = base_of(planar())
    kept = [PARAMETERS[at % 10] for at in base.kept]
    assert sorted(kept) == ["izz", "izz", "mx", "mx", "my", "my"]
    names = [base.name(at, ("a", "b")) for at in range(6)]
    assert any(one.endswith("0.4 m(b)") and one[0] == "m" for one in names)  # m2 l1
    assert any(one.endswith("0.16 m(b)") and one.startswith("izz(a)") for one in names)  # m2 l1^2


@pytest.mark.parametrize(("count", "number"), [(1, 3), (2, None), (6, None)])
def test_base_parameters_say_all_that_efforts_say(count: int, number: int | None) -> None:
    """Efforts are those of the base parameters, and no column of them is a sum of others."""
    chain = random_chain(count, ("turns",) * count)
    base = base_of(chain)
    q, v, a = np.random.default_rng(9).normal(size=(3, 40, count))
    columns = np.concatenate(efforts_by_body(chain, q, v, a), axis=2).reshape(40 * count, -1)
    phi = parameters_of(chain)
    kept = columns[:, base.kept]
    assert kept @ base.of(phi) == pytest.approx(columns @ phi, abs=1e-9)
    singular = np.linalg.svd(kept / np.linalg.norm(kept, axis=0), compute_uv=False)
    assert singular[-1] > 1e-3
    if number is not None:
        assert len(base.kept) == number


def test_a_general_arm_of_six_joints_has_as_many_as_the_literature_says() -> None:
    """10 n - 3 n_0 - 4 n_r + ... of Mayeda et al.: 7 a joint behind a first one along gravity."""
    rng = np.random.default_rng(2)
    links = [Link("j0", "turns", axis=(0.0, 0.0, 1.0), body=Body(1.0, (0.1, 0.1, 0.1)))]
    for number in range(1, 6):
        turn = roll_pitch_yaw(*rng.uniform(-1, 1, 3).tolist())
        place = tuple(rng.uniform(0.1, 0.3, 3).tolist())
        links.append(Link(f"j{number}", "turns", place, turn, (0.0, 1.0, 0.0), Body(1.0)))  # type: ignore[arg-type]
    chain = build_chain(tuple(links), DOWN)
    assert len(base_of(chain).kept) == 7 * 5 + 1
