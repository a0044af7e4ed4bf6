"""Networks that several tests use."""

from __future__ import annotations

import random

from tautwave_scenes.networks.network import Link, Mass, Network

RESONATOR = Network(
    (Mass("object", 0.004, damping=0.01),),
    (
        Link("spring", "spring", "object", "ground", stiffness=14200.0),
        Link("coupling", "spring", "hand", "object", stiffness=3000.0),
    ),
    ("hand",),
)
"""The second seed's resonator behind its coupling spring."""


def granular(grains: int = 10) -> Network:
    """Grains between linear springs on the floor and squared ones along a bar held by the hand."""
    masses = tuple(Mass(f"grain{i}", 1e-3, -0.02 + 1e-4 * i) for i in range(grains))
    links = [
        Link(f"floor{i}", "contact", f"grain{i}", "floor", stiffness=1e4, loss=0.1)
        for i in range(grains)
    ]
    links += [
        Link(f"bar{i}", "contact", "bar", f"grain{i}", stiffness=1e7, exponent=2.0, loss=0.1)
        for i in range(grains)
    ]
    return Network(
        masses,
        tuple(links),
        ("bar",),
        (("ground", 0.0), ("floor", -0.02)),
        forced=tuple(mass.name for mass in masses),
        gravity=9.81,
    )


def everything(seed: int = 1) -> Network:
    """A small network with a link of every kind, on a port and on masses."""
    rng = random.Random(seed)
    masses = tuple(
        Mass(f"m{i}", 0.01 * (1.0 + rng.random()), 0.01 * i, rng.uniform(-1.0, 1.0), 0.01)
        for i in range(8)
    )
    links = [
        Link(f"chain{i}", "spring", f"m{i + 1}", f"m{i}", stiffness=500.0, damping=0.1, rest=0.01)
        for i in range(7)
    ]
    links += [
        Link("floor", "contact", "m3", "ground", stiffness=1e5, exponent=1.5, loss=0.3),
        Link("hard", "nonlinear", "m2", "m5", stiffness=1e4, exponent=3.0),
        Link("clay", "plastic", "m4", "p", stiffness=300.0, limit=0.5),
        Link("dry", "friction", "m6", "ground", limit=0.1),
        Link("hair", "bow", "p", "m7", limit=0.2, scale=0.1),
        Link("minus", "negative_damper", "m1", "ground", damping=0.05),
        Link("engine", "energy_source", "m0", "ground", limit=0.01, scale=0.1),
        Link("knock", "contact", "p", "m5", stiffness=1e6, exponent=2.0, loss=0.1),
        Link("oil", "damper", "p", "m5", damping=0.3),
        Link("spring", "spring", "p", "m5", stiffness=100.0, damping=0.3),
    ]
    return Network(masses, tuple(links), ("p",), forced=("m2",), gravity=9.81)
