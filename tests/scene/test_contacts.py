"""Contacts closed: the bound of the certificate, what it refuses, and users who test it."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import Certificate, certify
from tautwave.config import load_rig
from tautwave.errors import SafetyStop
from tautwave.models.linear import flow_rows
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.contacts import Press, pressed, regimes, text_of, together
from tautwave_scenes.certificate.joint import responses
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks.sampled import PortMap, linear_scene, loop_poles
from tautwave_scenes.rig.network import hold_claim, hold_limit, pruned_network
from tautwave_scenes.runtime.hold import HoldAccount
from tests.commands import tautwave

LONG = pytest.mark.slow, pytest.mark.nightly

CONFIGS = Path(__file__).parents[2] / "configs"
WALL = Path(__file__).parent / "wall.yaml"
NO_DELAY = {"master.stick": CommandDelay(0, 0.0)}


def wall(*overrides: str) -> Certificate:
    return certify(load_rig(WALL, overrides))


def contacts(certificate: Certificate) -> Any:
    return next(one for one in certificate.elements if one.name == "contacts")


@pytest.mark.parametrize("scheme", ["discrete_gradient", "symplectic"])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_wall_at_a_port_needs_what_colgate_and_schenkel_say(scheme, scale):
    words = [f"scene.scheme={scheme}", f"scene.ports.stick.position_scale={scale}"]
    found = contacts(wall(*words))
    assert found.numbers["share"] == pytest.approx(20_000 * scale**2 * 1e-3 / 2.0 / 0.2)
    assert found.numbers["greatest_stiffness"] == pytest.approx(400.0 / scale**2, rel=1e-3)
    for stiffness, passed in ((399.0, True), (401.0, False)):
        link = f"scene.links.wall.stiffness={stiffness / scale**2}"
        assert contacts(wall(link, *words)).passive.passed == passed


def test_a_command_delay_counts():
    late = ["buses.hand.options={command_delay_s: 0.002}"]
    assert contacts(wall(*late)).numbers["share"] == pytest.approx(50.0 / 0.2, rel=1e-6)


def test_contacts_count_each_and_all_at_once():
    """Two walls of 300 N/m on one side: each is borne, both are not; so are they on both sides."""
    two = "scene.links.second={type: contact, between: %s, stiffness: 300, gap: %s}"
    for ends, gap in (("[stick, ground]", 0.001), ("[ground, stick]", -0.1)):
        found = contacts(wall("scene.links.wall.stiffness=300", two % (ends, gap)))
        assert found.numbers["share"] == pytest.approx(600 * 1e-3 / 2.0 / 0.2)
        assert "with wall and second closed" in found.passive.reason


def test_a_power_law_counts_with_its_tangent_where_the_effort_is_at_its_limit():
    """Two that share it: 1.5 k d**0.5 at 30 N each; the steepest elsewhere is by energy."""
    link = Link("w", "contact", "stick", "m", 4e5, exponent=1.5, loss=0.5)
    press = Press({"stick": 60.0}, 0.02)
    deep = (60.0 / 4e5) ** (2.0 / 3.0)
    assert pressed([link], press, 1.0)["w"][:3] == pytest.approx(
        (1.5 * 4e5 * math.sqrt(deep), 30.0, 60.0)
    )
    both = pressed([link, link._replace(name="v")], press, 1.0)
    assert both["v"].force == both["w"].force == 30.0
    inner = pressed([link._replace(a="n", exponent=2.0)], press, 1.0)["w"]
    deep = (3.0 * 0.02 / 4e5) ** (1.0 / 3.0)
    assert inner.stiffness == pytest.approx(2.0 * 4e5 * deep)
    shares = [one.closed["w"].force / 60.0 for one in regimes([link], press, lambda one: one)]
    assert shares == pytest.approx([1.0, 0.1, 0.01])
    clay = Link("c", "plastic", "stick", "m", 800.0, limit=1.0)
    assert pressed([clay], press, 1.0)["c"][:3] == (800.0, 0.0, 1.0)


def test_few_contacts_are_closed_in_every_way_and_many_by_kind_and_by_mass():
    def link(name: str, one: str, two: str) -> Link:
        return Link(name, "contact", one, two, 1.0)

    few = [link(f"a{i}", "p", "m") for i in range(3)]
    assert len(together(few, lambda one: one.name)) == 7
    more = [link(f"a{i}", "p", f"m{i}") for i in range(5)]
    assert len(together(more[:4], lambda one: one.name)) == 15
    assert [len(group) for group in together(more, lambda one: one.name)] == [1] * 5 + [5]
    grains = [link(f"{of}{i}", of, f"g{i}") for of in ("bar", "floor") for i in range(10)]
    groups = together(grains, lambda one: one.a)
    assert [len(group) for group in groups] == [1, 1, 2, 10, 10, 20]


def test_a_regime_names_its_contacts_up_to_three_and_else_how_many():
    links = [Link(name, "contact", "p", "m", 1.0) for name in "abcde"]
    for size, name in {
        1: "with a closed",
        2: "with a and b closed",
        3: "with a and b and c closed",
        4: "with a to d, 4 contacts closed",
        5: "with all 5 contacts closed",
    }.items():
        assert text_of(links[:size], len(links)) == name


@pytest.mark.slow
def test_a_contact_behind_a_mass_counts_with_its_resonance():
    """Closed, it is the resonator that such a spring makes."""
    more = [
        "scene.masses={m: {mass: 0.02, damping: 0.5}}",
        "scene.links.wall={type: contact, between: [stick, m], stiffness: 20000}",
        "scene.links.hold={type: spring, between: [m, ground], stiffness: 3000}",
    ]
    found = contacts(wall(*more))
    network = pruned_network(load_rig(WALL, more)).network
    springs = tuple(link._replace(kind="spring") for link in network.links)
    scene = linear_scene(network._replace(links=springs), "discrete_gradient", 1e-3, "stick")
    theta = np.linspace(1e-3, np.pi, 20_000)
    at = np.exp(1j * theta)
    states = [np.linalg.solve(z * np.eye(len(scene.a)) - scene.a, scene.b) for z in at]
    law = np.array(states) @ scene.c + scene.d
    want = (0.5e-3 * (law.real - law.imag / np.tan(0.5 * theta))).max()
    assert found.numbers["share"] == pytest.approx(want / 0.2, rel=1e-3)
    assert want > 20.0  # twice the wall's 10


def test_modes_that_coincide_are_not_taken_apart():
    """A double pole has no modes; the response is 1 / (z - 0.5)**2."""
    law = PortMap(np.array([[0.5, 1.0], [0.0, 0.5]]), np.array([[0.0], [1.0]]),
                  np.array([[1.0, 0.0]]), np.zeros((1, 1)), 1e-3)  # fmt: skip
    z = np.exp(1j * np.linspace(0.1, 3.0, 20))
    assert responses(law, z)[:, 0, 0] == pytest.approx(1.0 / (z - 0.5) ** 2, rel=1e-9)


def test_ports_count_together():
    """A contact between two ports moves both ways at once: each needs K T / 2, both K T."""
    axis = (
        "{bus: hand, id: 1, kind: linear, inertia: {value: 0.1, lower: 0.1, source: a}, "
        "damping: {value: 1, lower: 1, source: a}, effort_limit: 60}"
    )
    found = contacts(
        wall(
            f"master.axes={{stick: {axis}, pen: {axis.replace('id: 1', 'id: 2')}}}",
            "scene.ports={stick: {}, pen: {}}",
            "scene.links.wall={type: contact, between: [stick, pen], stiffness: 800}",
            "simulation={}",
        )
    )
    assert found.numbers["share"] == pytest.approx(2.0 * 800 * 1e-3 / 2.0)


def test_a_wall_rests_on_nothing_if_devices_and_hand_dissipate_all_that_it_leaks():
    """Beside a resonator that leaks more, the loop is stable either way; switching is unproved."""
    assert wall("scene.links.wall.stiffness=399").verdicts["coupled_stable"].state == "passed"
    more = [
        "scene.masses={object: {mass: 0.004, damping: 0.01}}",
        "scene.links.spring={type: spring, between: [object, ground], stiffness: 14200}",
        "scene.links.coupling={type: spring, between: [stick, object], stiffness: 1000}",
        "scene.scheme=discrete_gradient",
    ]
    verdict = wall("scene.links.wall.stiffness=399", *more).verdicts["coupled_stable"]
    assert verdict.state == "conditional"
    assert "at wall stays small" in verdict.conditions[0]


def test_a_scheme_that_cannot_run_a_closed_contact_is_refused():
    more = [
        "scene.scheme=symplectic",
        "scene.masses={m: {mass: 0.001, damping: 0.01}}",
        "scene.links.wall={type: contact, between: [m, ground], stiffness: 5000}",
        "scene.links.hold={type: spring, between: [stick, m], stiffness: 10}",
    ]
    found = wall(*more)
    assert not found.passed
    assert "unstable by itself with wall closed" in found.sentences()[0]


# -- what is refused ------------------------------------------------------------------------------

STIFFENED = {
    "drum": "scene.links.felt={type: contact, between: [stick, ring1], stiffness: 4.0e6, "
    "exponent: 1.5}",
    "granular": "scene.links.bar_spring.stiffness=1.0e9",
    "net": "scene.links.ball={type: contact, between: [finger, knot], stiffness: 4.0e4, "
    "exponent: 1.5, gap: 0.025}",
    "resonator": "scene.ports.stylus.stiffness=20000",
}


@pytest.mark.sparse(4)
@pytest.mark.parametrize("name", STIFFENED)
def test_a_shipped_scene_stiffened_beyond_its_bound_is_refused(name):
    path = CONFIGS / f"scene-{name}.yaml"
    assert certify(load_rig(path)).passed
    refused = certify(load_rig(path, [STIFFENED[name]]))
    assert not refused.passed
    assert "unstable with" in refused.sentences()[0]


def test_a_string_gives_way_so_that_a_plucked_one_is_stable_but_not_passive():
    hair = "scene.links.hair={type: plastic, between: [bow, string], stiffness: %s, yield_force: 1}"
    for stiffness in ("800", "1.0e6"):
        found = certify(load_rig(CONFIGS / "scene-string.yaml", [hair % stiffness]))
        assert found.passed
        assert contacts(found).passive.passed == (stiffness == "800")


@pytest.mark.slow
def test_the_wall_is_refused_by_check_and_forced_it_stays_within_its_claim(tmp_path):
    for require in ("passive", "coupled_stable"):
        done = tautwave("check", str(WALL), "--set", f"require={require}", cwd=tmp_path)
        assert done.exit_code == 3
        assert "with wall closed (2e+04 N/m at 60 N)" in done.stdout.replace("\n", " ")
    assert "has created 0.01 J" in " ".join(done.stdout.split())
    rig = load_rig(WALL)
    rows = simulate(rig, engine="python")
    assert isinstance(rows.error, SafetyStop)
    assert "by over 0.01 J (scene.hold_limit_j)" in str(rows.error)
    given = rows["plant.master.stick.motor_work"] - rows["plant.master.stick.viscous_loss"]
    assert given.max() <= hold_claim(rig, ["stick"], NO_DELAY)


# -- users who test it ----------------------------------------------------------------------------


class Trial(NamedTuple):
    """What a user got [J], the limit [J], and whether the account would have stopped the run."""

    gained: float
    limit: float
    stopped: bool


def press_on(rig: Any, stiffness: float, rng: np.random.Generator) -> Trial:
    """Let a lossless user, tuned to the closed contact, press on it and sway.

    A mass and a spring without damping hold the device, with a constant force: their energy and
    the device's rises only by what the scene gives.
    """
    network = pruned_network(rig).network
    scheme, period = rig.scene.scheme, rig.period_s
    axis = rig.axes["master.stick"]
    damping = axis.damping.lower
    closed = network._replace(
        links=tuple(
            link._replace(kind="spring") if link.kind == "contact" else link
            for link in network.links
        )
    )
    law = linear_scene(closed, scheme, period, "stick")
    users = [
        (axis.inertia.lower * (1.0 + heavier), spring)
        for heavier in (0.0, 0.5, 2.0, 8.0)
        for spring in (0.0, *np.geomspace(0.01, 30.0, 12) * stiffness)
    ]
    mass, spring = max(
        users, key=lambda one: np.abs(loop_poles(law, one[0], damping, one[1], 0)).max()
    )
    limit = hold_limit(rig, ["stick"])
    deep = math.sqrt(40.0 * limit / stiffness)
    still = float(np.linalg.solve(np.eye(len(law.a)) - law.a, law.b) @ law.c) + law.d
    bias = -(still + spring) * deep
    xv, xn, _, vv, vn, _ = flow_rows(spring, damping, mass, period)[:6]
    model = SceneModel(network, scheme, period, keep_books=True)
    x, v = -deep * (1.0 + 0.1 * rng.uniform(0.5, 1.0)), 0.0
    model.reset([x])
    for at in range(len(network.masses)):  # the network in equilibrium under the hand
        rest = np.linalg.solve(np.eye(len(law.a)) - law.a, law.b) * -deep
        model.arrays.x[at] = float(rest[at])
    site: Any = SimpleNamespace(position=x, valid=True, end=SimpleNamespace(absorbed=0.0))
    account = HoldAccount([site], [(0, 0.0)], [damping], period, limit,
                          holds_forces=scheme == "symplectic")  # fmt: skip
    account.begin()

    def energy() -> float:
        return 0.5 * mass * v * v + 0.5 * spring * x * x - bias * x

    start, gained, stopped, asked = 0.0, 0.0, False, model.advance([x])[0]
    account.overdrawn([asked], 1, model.booked)
    account.begin()
    account.state.created = model.booked.port_work + model.booked.numeric - model.booked.lost
    booked = model.booked
    start = energy() + booked.kinetic + booked.stored
    for _ in range(6000):
        push = bias - asked
        x, v, before = (
            (1.0 - spring * xn) * x + (xv - damping * xn) * v + xn * push,
            (-spring * vn * x + (1.0 + vv - damping * vn) * v + vn * push),
            x,
        )
        site.position = x
        site.end.absorbed += asked * (x - before)
        moved = model.advance([x])[0]
        stopped = account.overdrawn([asked], 1, model.booked) or stopped
        asked = moved
        gained = max(gained, energy() - start)
    return Trial(gained, limit, stopped)


def drawn(rng: np.random.Generator) -> list[str]:
    """Return a random rig: a wall at the port, or one in front of a mass on a spring."""
    rate = rng.choice([500, 1000, 2000])
    damping, mass = rng.uniform(0.2, 2.0), rng.uniform(0.02, 0.2)
    words = [
        f"rate_hz={rate}",
        f"scene.scheme={rng.choice(['discrete_gradient', 'symplectic'])}",
        f"master.axes.stick.damping={{value: {damping}, lower: {damping}, source: sheet}}",
        f"master.axes.stick.inertia={{value: {mass}, lower: {mass}, source: sheet}}",
        "master.axes.stick.effort_limit=1000",
        "simulation={}",
        "require=passive",
    ]
    if rng.random() < 0.5:
        inner = rng.uniform(0.05, 0.5)
        words += [
            f"scene.masses={{m: {{mass: {inner}, damping: {rng.uniform(0.5, 5.0)}}}}}",
            "scene.links.wall={type: contact, between: [stick, m], stiffness: 50000}",
            f"scene.links.hold={{type: spring, between: [m, ground], "
            f"stiffness: {inner * rng.uniform(20.0, 100.0) ** 2}}}",
        ]
    return words


def tried(words: list[str], share: float, rng: np.random.Generator) -> Trial | None:
    """Return what a tuned user makes of a contact at a share of its bound; None without a bound."""
    stiff = [*words, "scene.links.wall.stiffness=50000"]
    found = contacts(wall(*stiff))
    if "greatest_stiffness" not in found.numbers or found.numbers["greatest_stiffness"] < 1.0:
        return None
    stiffness = share * found.numbers["greatest_stiffness"]
    overrides = [*words, f"scene.links.wall.stiffness={stiffness}"]
    assert wall(*overrides).verdicts["passive"].passed == (share < 1.0)
    return press_on(load_rig(WALL, overrides), stiffness, rng)


def trials(share: float, count: int) -> list[Trial]:
    rng = np.random.default_rng(13)
    found = [tried(drawn(rng), share, rng) for _ in range(count)]
    return [one for one in found if one is not None]


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=LONG)])
def test_a_certified_scene_gives_a_tuned_user_no_more_than_its_limit(count):
    found = trials(0.99, count)
    assert len(found) > 0.7 * count
    for one in found:
        assert one.gained <= one.limit
        assert not one.stopped


@pytest.mark.parametrize("count", [4, pytest.param(20, marks=LONG)])
def test_beyond_the_bound_a_tuned_user_breaks_more_than_half(count):
    found = trials(1.3, count)
    assert sum(one.gained > one.limit for one in found) > 0.5 * len(found)
    assert all(one.stopped for one in found if one.gained > one.limit)
