"""Compiled steps of points in space: the same bits as plain Python, and who takes them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.simulation.run import simulate
from tautwave_scenes.networks3d.live import SPACE_SCHEMES, Model3d
from tautwave_scenes.rig.network3d import pruned_network3d
from tautwave_scenes.session.pace import scene_pace
from tautwave_scenes.simulation import tick3d
from tautwave_scenes.simulation.playing import play
from tests.scene.test_ticking import bits
from tests.scene3d.networks import everything, flat

CONFIGS = Path(__file__).parents[2] / "configs"
# Numba compiles for half a minute of a processor, and others want it too.
SLOW = pytest.mark.slow
pytestmark = pytest.mark.timeout(900)


@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
def test_the_source_that_is_compiled_steps_to_the_bit(scheme, monkeypatch):
    """Its memory is laid out in blocks, and what lies there is taken for what it is."""
    pytest.importorskip("numba")
    from tautwave_scenes.simulation import ticking3d

    monkeypatch.setattr(ticking3d, "compiled_tick3d", lambda: tick3d.tick_network3d)
    network = everything()
    fast = ticking3d.CompiledModel3d(network, scheme, 1e-4)
    slow = Model3d(network, scheme, 1e-4, keep_books=True)
    for model in (fast, slow):
        model.reset([0.01, 0.0, 0.0])
    for k in range(4):
        places, push = [0.01 - 1e-3 * k, 1e-3 * k, 0.0], [0.5] * len(network.forced)
        assert bits(fast.advance(places, push)) == bits(slow.advance(places, push))
        assert bits(fast.booked) == bits(slow.booked)
    assert bits(flat(fast.arrays)) == bits(flat(slow.arrays))


@SLOW
@pytest.mark.nightly
@pytest.mark.parametrize("name", ["net", "everything"])
@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
@pytest.mark.usefixtures("compiled3d")
def test_compiled_ticks_are_the_live_steps_to_the_bit(name, scheme):
    from tautwave_scenes.simulation.ticking3d import CompiledModel3d

    network, period = everything(), 1e-4
    if name == "net":
        rig = load_rig(CONFIGS / "scene-net.yaml")
        network, period = pruned_network3d(rig).network, rig.period_s
    fast = CompiledModel3d(network, scheme, period)
    slow = Model3d(network, scheme, period, keep_books=True)
    for again in range(2):  # a reset forgets everything
        for model in (fast, slow):
            model.reset([0.01 * again, 0.0, 0.0])
        assert fast.start == slow.start
        for k in range(150):
            places = [0.01 * math.sin(0.05 * k), 0.01 * math.cos(0.1 * k) - 0.01, -2e-4 * k]
            push = [math.sin(0.2 * k)] * len(network.forced)
            assert bits(fast.advance(places, push)) == bits(slow.advance(places, push))
            assert bits(fast.booked) == bits(slow.booked)
    assert bits(flat(fast.arrays)) == bits(flat(slow.arrays))
    assert fast.elements() == slow.elements()
    assert fast.resting_efforts() == slow.resting_efforts()


@SLOW
@pytest.mark.usefixtures("compiled3d")
def test_a_network_is_played_on_by_either_engine():
    ports = 0.01 * np.sin(np.linspace(0.0, 3.0, 300))[:, None] * np.ones((1, 3))
    models = [Model3d(everything(), "symplectic", 1e-4) for _ in range(2)]
    for model in models:
        for _ in range(50):
            model.advance([0.0, 0.0, 0.0], [0.1])
    before = [list(values) for values in models[0].arrays]
    fast = play(models[0], ports, engine="compiled", stride=2)
    assert [list(values) for values in models[0].arrays] == before  # it is left alone
    slow = play(models[1], ports, engine="python", stride=2)
    assert np.array_equal(fast.efforts, slow.efforts)
    assert np.array_equal(fast.places, slow.places)
    assert fast.ledger == slow.ledger


@SLOW
@pytest.mark.usefixtures("compiled3d")
def test_simulate_takes_them_and_gives_the_same_rows():
    rig = load_rig(CONFIGS / "scene-net.yaml")
    one = simulate(rig, duration_s=0.2, engine="compiled")
    two = simulate(rig, duration_s=0.2, engine="python")
    assert np.array_equal(one.data, two.data, equal_nan=True)


@SLOW
@pytest.mark.nightly
@pytest.mark.usefixtures("compiled3d")
def test_what_a_cycle_costs_is_measured_by_either_engine():
    rig = load_rig(CONFIGS / "scene-net.yaml")
    for engine in ("python", "compiled"):  # which is quicker is `bench`'s business
        assert 0.0 < scene_pace(rig, engine).cycle_s < math.inf
