"""Compiled steps in the live loop: the same bits as plain Python, and who takes them when."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.rig.network import pruned_network
from tests.scene.networks import everything

CONFIGS = Path(__file__).parents[2] / "configs"


def bits(values) -> bytes:
    return struct.pack(f"{len(values)}d", *values)


@pytest.mark.slow
@pytest.mark.timeout(900)  # numba compiles for half a minute, and shares the processor
@pytest.mark.parametrize(
    ("name", "scheme"),
    [
        ("granular", "discrete_gradient"),
        ("granular", "symplectic"),
        ("drum", "discrete_gradient"),
        ("drum", "rk4"),
        ("resonator", "exact"),
        ("string", "discrete_gradient"),
        ("everything", "symplectic"),
        ("everything", "discrete_gradient"),
    ],
)
def test_compiled_ticks_are_the_live_steps_to_the_bit(name, scheme):
    pytest.importorskip("numba")
    from tautwave_scenes.simulation.ticking import CompiledScene

    network, period = everything(), 1e-4
    if name != "everything":
        rig = load_rig(CONFIGS / f"scene-{name}.yaml")
        network, period = pruned_network(rig).network, rig.period_s
    fast = CompiledScene(network, scheme, period)
    slow = SceneModel(network, scheme, period, keep_books=True)
    for again in range(2):  # a reset forgets everything
        for model in (fast, slow):
            model.reset([0.01 * again])
        assert fast.start == slow.start
        for k in range(600):
            place = [0.01 - 0.03 * math.sin(0.01 * k)]
            push = [math.sin(0.02 * k + m) for m in range(len(network.forced))]
            assert bits(fast.advance(place, push)) == bits(slow.advance(place, push))
            assert bits(fast.booked) == bits(slow.booked)
    for one, two in zip(fast.arrays, slow.arrays, strict=True):
        assert bits(one) == bits(two)
    assert fast.elements() == slow.elements()
    assert fast.resting_efforts() == slow.resting_efforts()


def test_a_port_at_rest_feels_every_link_by_its_stretch():
    """Springs from and to the port, one with a length of its own, one already set: k (x - rest)."""
    links = (
        Link("from", "spring", "p", "m", stiffness=100.0, rest=0.004),
        Link("to", "spring", "wall", "p", stiffness=300.0),
        Link("away", "contact", "p", "wall", stiffness=1e4, exponent=1.5),
        Link("dry", "friction", "p", "m", limit=0.5),
    )
    grounds = (("ground", 0.0), ("wall", 0.05))
    network = Network((Mass("m", 1.0, 0.012),), links, ("p",), grounds)
    model = SceneModel(network, "discrete_gradient", 1e-3)
    model.reset([0.02])
    felt = 100.0 * (0.02 - 0.012 - 0.004) - 300.0 * 0.03 - 1e4 * 0.03**1.5
    assert model.resting_efforts() == pytest.approx([felt])
