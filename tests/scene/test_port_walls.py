"""Links from a port straight to the ground or to another port: felt by every scheme, and booked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave_scenes.models.interaction import elastic_tension
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import WAYS, Mass3d, Network3d, Port3d

PERIOD = 1e-3
LINKS = {
    "contact": Link("w", "contact", "hand", "ground", stiffness=2e3, exponent=1.5),
    "spring": Link("w", "spring", "hand", "ground", stiffness=500.0),
    "nonlinear": Link("w", "nonlinear", "hand", "ground", stiffness=4e4, exponent=2.0),
    "between": Link("w", "spring", "hand", "pen", stiffness=500.0),
    "damper": Link("w", "damper", "hand", "ground", damping=0.5),
    "friction": Link("w", "friction", "hand", "ground", limit=2.0, scale=1e-3),
}


def run(link: Link, scheme: str) -> tuple[np.ndarray, np.ndarray, SceneModel]:
    """Move the hand in a sine beside a resonator that it does not touch."""
    network = Network(
        (Mass("m", 0.1, 1e-3),),
        (link, Link("s", "spring", "m", "ground", stiffness=100.0)),
        ("hand", "pen"),
    )
    model = SceneModel(network, scheme, PERIOD)
    at = 0.01 * np.sin(0.05 * np.arange(400))
    efforts = np.array([model.advance([x, 0.0])[0] for x in at.tolist()])
    return at, efforts, model


WALLS = ("contact", "spring", "nonlinear", "between")
CASES = [(name, scheme) for name in WALLS for scheme in ("discrete_gradient", "symplectic")]


@pytest.mark.parametrize(("name", "scheme"), [*CASES, ("spring", "exact"), ("between", "exact")])
def test_a_wall_at_a_port_is_felt(name: str, scheme: str) -> None:
    link = LINKS[name]
    at, efforts, model = run(link, scheme)
    law = LINK_KINDS[link.kind].number
    want = [elastic_tension(law, link.stiffness, link.exponent, x) for x in at.tolist()]
    assert np.abs(efforts).max() > 1.0
    assert efforts == pytest.approx(np.array(want), abs=1e-12)
    assert abs(model.residual()) < 1e-14


@pytest.mark.parametrize("scheme", ["discrete_gradient", "symplectic"])
@pytest.mark.parametrize("name", ["damper", "friction"])
def test_what_drags_at_a_port_is_felt_and_loses(name: str, scheme: str) -> None:
    at, efforts, model = run(LINKS[name], scheme)
    speed = np.diff(at, prepend=0.0) / PERIOD
    want = 0.5 * speed if name == "damper" else 2.0 * speed / np.hypot(speed, 1e-3)
    assert efforts == pytest.approx(want, abs=1e-12)
    reported = model.ledger()
    assert reported.lost > 0.0
    assert math.isclose(reported.port_work, reported.lost, rel_tol=0.05)
    assert abs(model.residual()) < 1e-14


@pytest.mark.parametrize("scheme", ["discrete_gradient", "symplectic"])
def test_a_wall_at_a_port_in_space_is_felt_along_the_way_to_it(scheme: str) -> None:
    network = Network3d(
        masses=(Mass3d("m", 0.1, (1.0, 0.0, 0.0)),),
        links=(
            Link("w", "spring", "pen", "ground", stiffness=500.0, rest=0.05),
            Link("s", "spring", "m", "ground", stiffness=100.0, rest=1.0),
        ),
        ports=(Port3d("pen", ("x", "y"), WAYS[:2], (0.03, 0.04, 0.0)),),
    )
    model = Model3d(network, scheme, PERIOD)
    for x in (1e-3, -2e-3):
        x_effort, y_effort = model.advance([x, 0.0])
        far = math.hypot(0.03 + x, 0.04)
        pull = 500.0 * (far - 0.05)
        assert x_effort == pytest.approx(pull * (0.03 + x) / far, rel=1e-12)
        assert y_effort == pytest.approx(pull * 0.04 / far, rel=1e-12)
    assert abs(model.residual()) < 1e-15
