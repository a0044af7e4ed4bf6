"""Alike parallel links are one, to the bit: the laws, the networks, and what `check` says."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.cli import main
from tautwave_scenes.models import interaction as law
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks import compiling, live
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.parallel_links import join_links
from tautwave_scenes.networks.pruning import prune
from tautwave_scenes.networks.schemes import gradient, islands
from tautwave_scenes.networks.schemes.exact import linear_matrices
from tests.examples import tried
from tests.scene.test_keys import CONFIGS

NUMBERS = st.floats(-1.0, 1.0).filter(lambda x: x == 0.0 or abs(x) > 1e-12)
STRENGTH = st.floats(1e-3, 1e9)
ALL = ("spring", "damper", "contact", "nonlinear", "plastic", "friction", "bow",
       "negative_damper", "energy_source")  # fmt: skip


@given(
    st.sampled_from([law.SPRING, law.POWER, law.CONTACT]),
    STRENGTH,
    st.sampled_from([1.0, 1.5, 2.0, 3.0, 2.7]),
    NUMBERS,
    NUMBERS,
)
@settings(max_examples=tried(300))
def test_elastic_laws_double_to_the_bit(kind, k, e, d, moved):
    twice = law.mean_tension(kind, 2.0 * k, e, d, moved)
    assert twice == tuple(2.0 * part for part in law.mean_tension(kind, k, e, d, moved))
    assert law.elastic_tension(kind, 2.0 * k, e, d) == 2.0 * law.elastic_tension(kind, k, e, d)
    assert law.elastic_energy(kind, 2.0 * k, e, d) == 2.0 * law.elastic_energy(kind, k, e, d)
    lossy = law.lossy_contact(*twice, 0.3, d, 1e3)
    once = law.lossy_contact(0.5 * twice[0], 0.5 * twice[1], 0.3, d, 1e3)
    assert lossy == tuple(2.0 * part for part in once)


@given(
    st.sampled_from([law.SPRING, law.FRICTION, law.BOW, law.NEGATIVE, law.SOURCE]),
    STRENGTH,
    STRENGTH,
    NUMBERS,
)
@settings(max_examples=tried(200))
def test_laws_of_the_rate_double_to_the_bit(kind, z, f, w):
    once = law.rate_tension(kind, z, f, 0.03, w)
    assert law.rate_tension(kind, 2.0 * z, 2.0 * f, 0.03, w) == tuple(2.0 * x for x in once)


def random_network(seed: int, kinds: tuple[str, ...] = ALL) -> Network:
    """Masses under a port with bundles of 1 to 9 alike links, shuffled among each other."""
    rng = random.Random(seed)
    names = [f"m{i}" for i in range(rng.randint(1, 5))]
    masses = tuple(
        Mass(n, 0.01 * (1 + rng.random()), 0.01 * rng.random(), rng.uniform(-0.3, 0.3), 0.05)
        for n in names
    )
    links: list[Link] = []
    for at in range(rng.randint(3, 9)):
        kind = rng.choice(kinds)
        one, two = rng.sample([*names, "p", "ground"], 2)
        if {one, two} == {"p", "ground"}:
            one = names[0]
        elastic = kind in ("spring", "contact", "nonlinear", "plastic")
        link = Link(
            f"l{at}",
            kind,
            one,
            two,
            stiffness=rng.choice([30.0, 100.0 * rng.random()]) if elastic else 0.0,
            damping=0.1 * rng.random() if kind in ("spring", "damper") else 0.0,
            rest=rng.choice([0.0, 0.01]) if elastic else 0.0,
            exponent={"contact": rng.choice([1.0, 1.5, 2.0]), "nonlinear": 3.0}.get(kind, 1.0),
            loss=0.2 if kind == "contact" else 0.0,
            limit=0.02 * rng.random(),
            scale=0.05,
        )
        if kind == "negative_damper":
            link = link._replace(damping=0.01 * rng.random())
        links += [link._replace(name=f"l{at}.{i}") for i in range(rng.randint(1, 9))]
        field = rng.choice(("stiffness", "damping", "loss", "limit", "rest"))
        other = link._replace(**{field: 1.3 * getattr(link, field)})  # alike, but for one number
        links += [other._replace(name=f"l{at}x.{i}") for i in range(rng.randint(0, 4))]
    links.append(Link("hold", "spring", "p", names[0], stiffness=50.0, damping=0.2))
    rng.shuffle(links)
    network = Network(masses, tuple(links), ("p",), forced=(names[0],))
    return prune(network, merge=False).network


def run(network: Network, scheme: str, steps: int = 60) -> list[float]:
    return moved(SceneModel(network, scheme, 1e-3), steps)


def moved(model: SceneModel, steps: int = 60) -> list[float]:
    reported: list[float] = []
    free = model.arrays.count[0] + model.arrays.count[1]
    for k in range(steps):
        reported += model.advance([0.01 * math.sin(0.05 * k)], [0.1 * math.sin(0.2 * k)])
        reported += [*model.arrays.x, *model.arrays.v, *model.arrays.force[:free]]
    assert all(map(math.isfinite, reported))
    return reported


@pytest.mark.parametrize("scheme", ["symplectic", "discrete_gradient", "exact"])
@pytest.mark.parametrize("seed", range(8))
def test_merged_equals_unmerged_to_the_bit(scheme, seed):
    network = random_network(seed, ("spring", "damper") if scheme == "exact" else ALL)
    merged = prune(network).network
    assert len(merged.links) < len(network.links)
    assert run(merged, scheme) == run(network, scheme)


def bundles(links):
    """Of each link in the arrays' order, the members whose forces are added first; see below."""
    order = sorted(links, key=lambda link: compiling.ORDER.index(LINK_KINDS[link.kind].number))
    into = {link.name: name or link.name for link, name in join_links(links)}
    at = {link.name: index for index, link in enumerate(order)}
    members: dict[int, list[int]] = {index: [] for index in range(len(order))}
    for link in order:
        members[at[into[link.name]]].append(at[link.name])
    return members


@pytest.mark.parametrize("seed", range(8))
def test_the_gradient_step_with_every_link_by_itself_is_the_same_to_the_bit(seed, monkeypatch):
    """Each link's own tension, those of a bundle added up first: what joining stands for."""
    network = random_network(seed)
    merged = run(prune(network).network, "discrete_gradient")
    pull = gradient.link_pull
    members = bundles(network.links)

    def summed(s, i, moved, period):
        pulls = [pull(s, j, moved, period) for j in members[i]]
        return math.fsum(p for p, _ in pulls), math.fsum(slope for _, slope in pulls)

    monkeypatch.setattr(compiling, "join_links", lambda links: [(link, "") for link in links])
    monkeypatch.setattr(gradient, "link_pull", summed)
    monkeypatch.setattr(islands, "link_pull", summed)
    each = SceneModel(network, "discrete_gradient", 1e-3)
    books = gradient.book_link

    def book_each(s, i, moved, tension, period):
        # Plastic links remember how far they gave way, each for itself; forces come in a bundle.
        before = list(s.force)
        own, _ = pull(s, i, moved, period)
        books(s, i, moved, own, period)
        s.force[:] = before
        s.force[s.a[i]] -= tension
        s.force[s.b[i]] += tension
        s.tension[i] = tension

    monkeypatch.setattr(gradient, "book_link", book_each)
    monkeypatch.setattr(islands, "book_link", book_each)
    assert moved(each) == merged


@pytest.mark.parametrize("seed", range(8))
def test_the_symplectic_step_with_every_link_by_itself_is_the_same_to_the_bit(seed, monkeypatch):
    network = random_network(seed, tuple(kind for kind in ALL if kind != "plastic"))
    merged = run(prune(network).network, "symplectic")
    members = bundles(network.links)

    def own(s, i):
        d = s.x[s.a[i]] - s.x[s.b[i]] - s.rest[i]
        w = s.v[s.a[i]] - s.v[s.b[i]]
        if s.kind[i] >= law.FRICTION:
            return law.rate_tension(s.kind[i], s.z[i], s.limit[i], s.scale[i], w)[0]
        tension = law.elastic_tension(s.kind[i], s.k[i], s.e[i], d)
        if s.kind[i] == law.CONTACT:
            return tension * max(1.0 - s.loss[i] * w, 0.0)
        return tension + s.z[i] * w

    def pull_each(s):
        s.force[: s.count[0] + s.count[1]] = [0.0] * (s.count[0] + s.count[1])
        for i in range(s.count[2]):
            tension = math.fsum(own(s, j) for j in members[i])
            s.force[s.a[i]] -= tension
            s.force[s.b[i]] += tension

    monkeypatch.setattr(compiling, "join_links", lambda links: [(link, "") for link in links])
    monkeypatch.setattr(live, "pull_links", pull_each)
    assert run(network, "symplectic") == merged


@pytest.mark.parametrize("seed", range(8))
def test_matrices_of_merged_links_have_the_same_entries(seed):
    network = random_network(seed, ("spring", "damper"))
    arrays = [compiling.compile_network(net).arrays for net in (prune(network).network, network)]
    masses = range(len(network.masses))
    for one, two in zip(*(linear_matrices(s, masses) for s in arrays), strict=True):
        assert np.array_equal(one, two)


def test_only_what_is_alike_is_joined():
    spring = Link("a", "spring", "m", "ground", stiffness=0.3, damping=0.1)
    links = (
        spring,
        spring._replace(name="b", stiffness=0.6, damping=0.2),  # as strong as two
        spring._replace(name="c"),
        spring._replace(name="other place", b="p"),
        spring._replace(name="turned round", a="ground", b="m"),
        spring._replace(name="longer", rest=0.1),
        spring._replace(name="softer", stiffness=0.2),
        spring._replace(name="less damped", damping=0.0),
    )
    reported = [(link.name, link.stiffness, into) for link, into in join_links(links)]
    assert reported[:3] == [("a", 4.0 * 0.3, ""), ("b", 0.0, "a"), ("c", 0.0, "a")]
    assert [into for *_, into in reported[3:]] == [""] * 5
    for change in ("stiffness", "damping", "rest", "loss", "limit", "exponent", "scale"):
        pair = [spring, spring._replace(name="b", **{change: 7.0})]
        assert join_links(pair) == [(link, "") for link in pair]
    three = join_links([spring._replace(name=name) for name in "abc"])
    assert [link.stiffness for link, _ in three] == [0.6, 0.0, 0.3]
    kept = [link for link, into in join_links(links) if not into]
    assert [link for link, _ in join_links(kept)] == kept


@pytest.mark.slow
def test_check_lists_what_was_joined():
    again = "scene.links.twin={type: spring, between: [object, ground], stiffness: 14200}"
    done = CliRunner().invoke(
        main, ["check", "-v", str(CONFIGS / "scene-resonator.yaml"), "--set", again]
    )
    assert "merged with spring, exactly" in " ".join(done.output.split())
