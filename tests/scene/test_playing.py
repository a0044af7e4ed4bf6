"""Networks along given motions: the compiled steps are the live ones, to the bit."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network, String
from tautwave_scenes.networks.schemes.stepping import pull_links
from tautwave_scenes.rig.network import pruned_network
from tautwave_scenes.simulation import playing
from tautwave_scenes.simulation import steps as network_steps
from tautwave_scenes.simulation.playing import Played, _with_string, flows_of, lines_of, play

CONFIGS = Path(__file__).parents[2] / "configs"
STEPS = 240

DAMPED = Network(
    (Mass("a", 0.01), Mass("b", 0.02, damping=0.1), Mass("c", 0.01)),
    (
        Link("one", "spring", "hand", "a", stiffness=3e3, damping=0.4),
        Link("two", "spring", "a", "b", stiffness=2e3, damping=0.2),
        Link("three", "damper", "b", "pen", damping=0.5),
        Link("four", "spring", "c", "ground", stiffness=1e3),
        Link("five", "damper", "hand", "c", damping=0.3),
    ),
    ("hand", "pen"),
    gravity=9.81,
)
"""Linear, two islands and two ports, with dampers at both."""


def model_of(name: str, scheme: str) -> SceneModel:
    if name == "damped":
        return SceneModel(DAMPED, scheme, 1e-4)
    rig = load_rig(CONFIGS / f"scene-{name}.yaml")
    return SceneModel(pruned_network(rig).network, scheme, rig.period_s)


def motion(model: SceneModel) -> np.ndarray:
    time = np.arange(STEPS)[:, None]
    ports = len(model.network.ports)
    return 0.012 * np.sin(2e-2 * time * (1.0 + np.arange(ports))) - 0.01


def pushes(model: SceneModel) -> np.ndarray:
    random = np.random.default_rng(3)
    return 0.2 * random.standard_normal((STEPS, len(model.network.forced)))


def in_arrays(model: SceneModel, stride: int) -> tuple[np.ndarray, np.ndarray]:
    """Run the steps that numba compiles as they are."""
    from tautwave_scenes.networks.compiling import as_arrays

    arrays = as_arrays(model.arrays)
    forced = np.array([model.compiled.masses.index(n) for n in model.network.forced], np.int64)
    at = motion(model)
    efforts = np.zeros((STEPS // stride, at.shape[1]))
    places = np.zeros((STEPS // stride, len(model.compiled.masses)))
    network_steps.play_network(
        arrays, lines_of(model.network), flows_of(model), playing.SCHEMES[model.scheme],
        model.period, at, forced, pushes(model), efforts, places, stride,
    )  # fmt: skip
    return efforts, places


CASES = [
    ("damped", "exact"),
    ("damped", "symplectic"),
    ("damped", "discrete_gradient"),
    ("resonator", "exact"),
    ("granular", "symplectic"),
    ("granular", "rk4"),
    ("granular", "discrete_gradient"),
    ("string", "discrete_gradient"),
    ("drum", "rk4"),
    ("drum", "discrete_gradient"),
]


@pytest.mark.parametrize(("name", "scheme"), CASES)
def test_the_steps_that_compile_are_the_live_ones(name: str, scheme: str) -> None:
    model = model_of(name, scheme)
    efforts, places = in_arrays(model, 1)
    reported = play(model, motion(model), pushes(model), engine="python")
    assert np.abs(reported.efforts).max() > 0.0
    assert np.array_equal(efforts, reported.efforts)
    assert np.array_equal(places, reported.places)


def test_rows_of_several_steps_hold_their_mean_effort_and_last_place() -> None:
    model = model_of("drum", "discrete_gradient")
    fine = play(model, motion(model), engine="python")
    model = model_of("drum", "discrete_gradient")
    coarse = play(model, motion(model), engine="python", stride=8)
    assert coarse.efforts == pytest.approx(fine.efforts.reshape(-1, 8, 1).mean(axis=1), rel=1e-12)
    assert np.array_equal(coarse.places, fine.places[7::8])


def test_the_python_engine_stops_when_its_time_is_over() -> None:
    model = model_of("drum", "discrete_gradient")
    assert len(play(model, motion(model), engine="python", seconds=1e-9).efforts) == 1


def test_an_unknown_engine_is_named() -> None:
    model = model_of("drum", "discrete_gradient")
    with pytest.raises(ConfigError, match="engines: compiled, python"):
        play(model, motion(model), engine="fortran")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "scheme"), CASES)
def test_compiled_steps_are_the_live_ones(name: str, scheme: str) -> None:
    pytest.importorskip("numba")
    model = model_of(name, scheme)
    fast = play(model, motion(model), pushes(model))
    slow = play(model, motion(model), pushes(model), engine="python")
    assert np.array_equal(fast.efforts, slow.efforts)
    assert np.array_equal(fast.places, slow.places)
    check_books(fast, slow)


def check_books(fast: Played, slow: Played) -> None:
    gross = sum(abs(value) for value in slow.ledger)
    assert fast.ledger == pytest.approx(slow.ledger, abs=1e-13 * gross)


def test_a_symplectic_model_starts_with_its_links_pulled() -> None:
    model = model_of("granular", "symplectic")
    before = list(model.arrays.tension)
    pull_links(model.arrays)
    assert model.arrays.tension == before


def test_each_string_of_several_has_the_energy_of_its_own_waves():
    """0.5 T (what arrives squared), on either half; the other strings' are no business of it."""
    strings = tuple(String(name, 1.0, near, near + 3) for name, near in (("g", 2), ("d", 4)))
    network = Network((), tuple(Link(s.name, "spring", "p", s.name, 1.0) for s in strings), ("p",))
    lines = lines_of(network._replace(strings=strings))
    lines.arriving[:] = (1.0, 2.0, 3.0, 4.0)
    lines.out[lines.first[3]] = 5.0
    still = SimpleNamespace(dragged=[0.0] * 3, pumped=[0.0] * 3)
    nothing = Ledger(*[0.0] * len(Ledger._fields))
    stored = [_with_string(nothing, still, lines, at, 1e-3).stored for at in range(2)]
    assert stored == pytest.approx([0.5e-3 * (1.0 + 4.0), 0.5e-3 * (9.0 + 16.0 + 25.0)])
