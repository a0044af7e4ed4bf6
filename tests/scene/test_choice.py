"""What `scheme: auto` takes of a scene, against what the schemes then do."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.session.plan import rig_plan
from tautwave_scenes.bench.precision import Stage
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.schemes.choice import _fastest, choose_scene_scheme, scheme_error
from tautwave_scenes.rig.network import scene_of, scheme_choice
from tests.lab.workprecision.scenes import DRUM
from tests.scene.networks import everything

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize(
    ("name", "scheme"),
    [
        ("resonator", "exact"),
        ("granular", "rk4"),
        ("string", "discrete_gradient"),
        ("drum", "rk4"),
    ],
)
def test_what_auto_takes_of_the_shipped_scenes(name: str, scheme: str) -> None:
    rig = load_rig(CONFIGS / f"scene-{name}.yaml", ["scene.scheme=auto"])
    assert scene_of(rig).scheme == scheme
    assert scheme_choice(rig).why.startswith(f"{scheme}: ")


@pytest.mark.slow
def test_what_auto_takes_has_the_least_error_at_the_rigs_rate() -> None:
    stage = Stage(DRUM._replace(begin_s=0.1295, span_s=0.004), engine="python")
    oracle = stage.run("discrete_gradient", Fraction(8))
    assert oracle is not None
    errors = {}
    for scheme in ("discrete_gradient", "rk4", "symplectic"):
        played = stage.run(scheme, Fraction(1))
        assert played is not None
        errors[scheme] = stage.error(played.places, oracle)
    assert np.abs(oracle.efforts).max() > 0.1  # the stick was on it
    assert min(errors, key=lambda name: errors[name]) == scheme_choice(stage.rig).scheme
    assert errors["rk4"] < 0.1 * errors["discrete_gradient"]


def contact(stiffness: float) -> Network:
    return Network(
        (Mass("m", 0.1),),
        (Link("w", "contact", "m", "ground", stiffness=stiffness, exponent=1.5),),
    )


def test_what_no_explicit_scheme_holds_is_left_to_discrete_gradients() -> None:
    for stiffness, scheme in ((1e3, "rk4"), (1e12, "discrete_gradient")):
        found = choose_scene_scheme(contact(stiffness), 1e-3, 1.0)
        assert found.scheme == scheme
    assert "rk4 fails" in found.why
    links = (Link("s", "spring", "a", "b", stiffness=2.0), contact(1.0).links[0]._replace(a="a"))
    pair = Network((Mass("a", 1.0), Mass("b", 1.0)), links)
    # Two masses on a spring swing at sqrt(2 k / m) = 2: rk4 holds them up to 2.83 / 2 s.
    assert math.isfinite(scheme_error(pair, "rk4", 1.2, 1e-6))
    assert math.isinf(scheme_error(pair, "rk4", 1.6, 1e-6))


def test_other_links_are_left_to_discrete_gradients() -> None:
    found = choose_scene_scheme(everything(), 1e-4, 1.0)
    assert found.scheme == "discrete_gradient"
    assert "link, and it keeps energy" in found.why


def test_check_says_what_auto_takes_and_why() -> None:
    rig = load_rig(CONFIGS / "scene-drum.yaml", ["scene.scheme=auto"])
    (said,) = [item for item in rig_plan(rig) if item.element == "scheme rk4"]
    assert "auto: rk4: least error of a bounce at 8 m/s" in said.reason


def test_the_bound_of_the_fastest_mode_is_the_mode_where_there_is_one() -> None:
    """Gershgorin: exact for a mass on the ground, twice over for a pair that swings."""
    masses = {"a": 0.5, "b": 0.5}
    both = tuple(Mass(name, mass, damping=0.1) for name, mass in masses.items())
    grounded = Link("k", "spring", "a", "ground", 300.0, damping=0.2)
    coupled = grounded._replace(b="b")
    assert _fastest(Network(both, (grounded,)), masses, {}) == (600.0, pytest.approx(0.6))
    assert _fastest(Network(both, (coupled,)), masses, {}) == (1200.0, pytest.approx(1.0))
    contact = Link("c", "contact", "a", "ground", 7.0, damping=0.2)
    assert _fastest(Network(both, (contact,)), masses, {})[0] == 0.0
    assert _fastest(Network(both, (contact,)), masses, {"c": 50.0})[0] == 100.0
