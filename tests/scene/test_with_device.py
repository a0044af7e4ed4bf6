"""A scene discretised together with its device: the sampled loop has the modes that are meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave_scenes.certificate.maps import needed
from tautwave_scenes.networks.network import GROUND, Link, Mass, Network
from tautwave_scenes.networks.sampled import linear_scene
from tautwave_scenes.networks.with_device import Held, ideal_modes, tune, why_not
from tautwave_scenes.rig.network import pruned_network

RESONATOR = Path(__file__).parents[2] / "configs" / "scene-resonator.yaml"
HAND = Held(mass=0.143, damping=5.0, stiffness=538.0)


def resonator(masses: int = 1) -> Network:
    """A chain of masses on springs, the last on the ground."""
    names = [*(f"m{at}" for at in range(masses)), GROUND]
    chain = [
        Link(f"s{at}", "spring", names[at], names[at + 1], 14200.0 * (1 + at))
        for at in range(masses)
    ]
    return Network(
        tuple(Mass(name, 0.004, damping=0.01) for name in names[:-1]),
        (Link("coupling", "spring", "p", "m0", 3000.0), *chain),
        ("p",),
    )


def test_without_sampling_the_modes_are_those_of_the_two_masses():
    # x'' of both by hand: the characteristic polynomial of Berdahl's loop.
    m, b, k, M, R, c, w = 0.143, 5.0, 538.0, 0.004, 0.01, 3000.0, 14200.0
    one, two = np.array([m, b, k + c]), np.array([M, R, w + c])
    poles = np.roots(np.polysub(np.polymul(one, two), [c * c]))
    want = sorted((s for s in poles if s.imag > 0.0), key=abs)
    assert ideal_modes(resonator(), HAND) == pytest.approx(want, rel=1e-9)


def test_a_device_whose_handle_moves_the_scene_scaled_has_the_modes_of_both():
    """At scale s the handle's coordinate is s times the device's: c becomes s^2 c and s c."""
    s, c, M, R, w = 2.5, 3000.0, 0.004, 0.01, 14200.0
    one = np.array([HAND.mass, HAND.damping, HAND.stiffness + s * s * c])
    poles = np.roots(np.polysub(np.polymul(one, np.array([M, R, w + c])), [s * s * c * c]))
    want = sorted((z for z in poles if z.imag > 0.0), key=abs)
    assert ideal_modes(resonator(), HAND._replace(scale=s)) == pytest.approx(want, rel=1e-9)


@pytest.mark.parametrize(
    ("scheme", "period", "delay"),
    [
        ("exact", 5e-4, 0),
        ("symplectic", 1e-4, 1),
        pytest.param("discrete_gradient", 5e-4, 0, marks=pytest.mark.slow),
    ],
)
def test_the_chosen_numbers_give_the_modes_that_are_meant(scheme, period, delay):
    found = tune(resonator(), scheme, period, HAND._replace(delay=delay))
    assert found.error < 1e-9
    apart = [abs(a - b) / abs(b) for a, b in zip(found.plain, found.ideal, strict=True)]
    assert max(apart) > 1e-4  # which the numbers as meant do not have


@pytest.mark.slow
def test_two_masses_and_a_scaled_port_as_well():
    held = HAND._replace(scale=0.5)
    assert tune(resonator(2), "exact", 1e-4, held).error < 1e-9


@pytest.mark.slow
def test_right_modes_may_leak_more_than_wrong_ones():
    # At 0.1 ms the exact step leaks an eighth of what it did, the symplectic one twice as much.
    leaks = {}
    for scheme in ("exact", "symplectic"):
        found = tune(resonator(), scheme, 1e-4, HAND)
        leaks[scheme] = [
            needed(linear_scene(one, scheme, 1e-4, "p"), 0.0).damping
            for one in (resonator(), found.network)
        ]
    assert leaks["exact"][1] < 0.2 * leaks["exact"][0]
    assert leaks["symplectic"][1] > 1.5 * leaks["symplectic"][0]


def rig_of(*more: str, rate: int = 2000):
    reference = "{type: minimum_jerk, waypoints: [[0.03, 0.0], [0.034, 0.004], [0.038, 0.0]]}"
    return load_rig(
        RESONATOR,
        [
            f"rate_hz={rate}",
            "duration_s=0.25",
            "scene.forces={}",
            "scene.engage_ramp_s=0",
            "simulation.axes.master.stylus={inertia: 0.05, damping: 0.5}",
            f"simulation.hand.stylus.reference={reference}",
            *more,
        ],
    )


def recorded_modes(rig):
    """Return the modes of a run's free motion, by the recursion that its samples obey."""
    rows = simulate(rig, engine="python")
    assert rows.error is None
    first = round(0.05 * rig.rate_hz)
    motions = [rows["scene.at.object"][first:], rows["master.stylus.position"][first:]]
    # Both are sums of the same four powers: x_k+4 is one combination of the four before.
    parts = [motion / np.abs(motion).max() for motion in motions]
    past = np.vstack([np.stack([p[at : len(p) - 4 + at] for at in range(4)], 1) for p in parts])
    after = np.concatenate([p[4:] for p in parts])
    weights = np.linalg.lstsq(past, after, rcond=None)[0]
    poles = np.roots([1.0, *-weights[::-1]])
    return sorted((np.log(z) / rig.period_s for z in poles if z.imag > 0.0), key=abs)


def test_a_run_has_the_modes_that_are_meant_and_without_the_key_others():
    held = Held(0.05 + 0.143, 0.5 + 5.0, 538.0)
    want = ideal_modes(resonator(), held)
    found = recorded_modes(rig_of("scene.discretise=with_device"))
    assert found == pytest.approx(want, rel=1e-6)
    plain = recorded_modes(rig_of())
    assert abs(plain[0] - want[0]) > 1e-3 * abs(want[0])


def test_check_says_the_modes_and_that_such_a_network_gives_energy():
    lines = certify(rig_of("scene.discretise=with_device", rate=10000)).elements[0].sentences
    text = " ".join(lines)
    assert "dampers below zero" in text
    assert "its modes are" in text
    assert "it runs with spring" in text
    alone = certify(rig_of(rate=10000)).elements[0]
    assert alone.passive.passed
    assert not any("modes" in line for line in alone.sentences)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["scene.links.second={type: spring, between: [object, ground], stiffness: 10}"], "spring"),
        pytest.param(["rate_hz=500"], "no spring and damper values", marks=pytest.mark.slow),
    ],
)
def test_what_has_no_such_numbers_is_refused(more, says):
    with pytest.raises(ConfigError, match=says):
        pruned_network(rig_of("scene.discretise=with_device", *more))


def test_a_network_of_another_kind_is_named():
    two = resonator()._replace(ports=("p", "q"))
    assert "one port" in str(why_not(two))
    contact = Link("c", "contact", "m0", GROUND, 10.0)
    assert "dampers" in str(why_not(resonator()._replace(links=(*resonator().links, contact))))
    assert "at the port" in str(why_not(resonator()._replace(links=resonator().links[1:])))
