"""What is left out changes no bit; what is wrong is said with its name."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.pruning import prune
from tautwave_scenes.networks.schemes.stepping import pull_links
from tests.scene.networks import RESONATOR, everything, granular


def with_rest(network: Network) -> Network:
    """Put parts that nobody can feel before, between and after those of a network."""
    spare = tuple(Mass(f"spare{i}", 0.02, 0.1 * i, 0.3) for i in range(4))
    links = (
        Link("spare1", "spring", "spare0", "spare1", stiffness=200.0),
        Link("spare2", "spring", "spare1", "ground", stiffness=100.0, damping=0.1),
        Link("spare3", "damper", "spare2", "ground", damping=0.2),
        Link("spare4", "spring", "spare3", "ground", stiffness=10.0),
    )
    return network._replace(
        masses=(spare[0], spare[1], *network.masses, spare[2], spare[3]),
        links=(*links[:2], *network.links, *links[2:]),
    )


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("network", "scheme"),
    [
        (everything(), "symplectic"),
        (everything(), "discrete_gradient"),
        (granular(), "discrete_gradient"),
        (granular(), "symplectic"),
        (RESONATOR, "exact"),
        (RESONATOR, "discrete_gradient"),
    ],
)
def test_pruned_equals_unpruned_to_the_bit(network, scheme):
    network = network._replace(grounds=(*network.grounds, ("unused", 0.1)))
    pruned = prune(with_rest(network), merge=False)
    assert len(pruned.network.masses) == len(network.masses)
    assert any("spare0" in sentence for sentence in pruned.left_out)
    assert any("spare4" in sentence for sentence in pruned.left_out)
    assert "ground unused: nothing is linked to it" in pruned.left_out
    whole = SceneModel(with_rest(network), scheme, 1e-4)
    small = SceneModel(pruned.network, scheme, 1e-4)
    for k in range(1500):
        place, push = [-0.01 + 0.01 * math.sin(0.003 * k)], [math.sin(0.02 * k)]
        assert whole.advance(place, push) == small.advance(place, push)
    names = whole.compiled.masses
    for at, name in enumerate(small.compiled.masses):
        assert small.arrays.x[at] == whole.arrays.x[names.index(name)]


def test_recorded_parts_stay():
    network = with_rest(RESONATOR)._replace(recorded=("spare1",))
    kept = [mass.name for mass in prune(network).network.masses]
    assert kept == ["spare0", "spare1", "object"]


@pytest.mark.slow  # numba compiles for ten seconds
@pytest.mark.parametrize("scheme", ["symplectic", "discrete_gradient"])
@pytest.mark.parametrize("make", [everything, granular])
def test_compiled_equals_live_to_the_bit(make, scheme):
    pytest.importorskip("numba")
    from tautwave_scenes.networks.compiling import as_arrays
    from tautwave_scenes.simulation import playing

    steps = np.arange(2000)
    ports = (-0.012 + 0.01 * np.sin(0.01 * steps))[:, None]
    live, model = (SceneModel(make(), scheme, 1e-4) for _ in range(2))
    for one in (live, model):
        one.reset([float(ports[0, 0])])
    masses, forced = model.compiled.masses, model.network.forced
    pushes = np.random.default_rng(5).normal(size=(2000, len(forced)))
    efforts, places = np.zeros_like(ports), np.zeros((2000, len(masses)))
    arrays = as_arrays(model.arrays)
    playing.compiled_play()(
        arrays, playing.lines_of(model.network), playing.flows_of(model), playing.SCHEMES[scheme],
        model.period, ports, np.array([masses.index(name) for name in forced], np.int64), pushes,
        efforts, places, 1,
    )  # fmt: skip
    if scheme == "symplectic":
        pull_links(arrays)  # its account is a step behind
    played = playing.play(live, ports, pushes, engine="python")
    assert np.array_equal(efforts, played.efforts)
    assert np.array_equal(places, played.places)
    for name in ("x", "v", "stored", "lost", "made", "numeric", "port_work", "pumped"):
        assert np.array_equal(getattr(arrays, name), getattr(live.arrays, name)), name
