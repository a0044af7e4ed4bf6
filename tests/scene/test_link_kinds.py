"""What the table of link kinds says of a kind, held against the law that its number names."""

from __future__ import annotations

import math
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_scenes.config.keys import SceneLink
from tautwave_scenes.config.keys3d import Link3d
from tautwave_scenes.models import interaction as law
from tautwave_scenes.models.link_kinds import LINK_KINDS, Constants, Proof, Symbol
from tautwave_scenes.networks.compiling import compile_network
from tautwave_scenes.networks.network import Link, Network
from tautwave_scenes.networks.schemes.stepping import move_ports, pull_links

SIZES = st.floats(0.1, 1e3)
CONSTANTS = st.builds(
    Constants,
    k=SIZES,
    e=st.sampled_from((1.0, 1.5, 2.0, 3.0)),
    z=st.floats(0.0, 10.0),
    loss=st.sampled_from((0.0, 0.5)),
    limit=SIZES,
    scale=st.floats(1e-3, 1.0),
    depth=st.sampled_from((math.inf, 1e-3, 0.1)),
)
EVERY = pytest.mark.parametrize("name", LINK_KINDS)


def total(kind: int, c: Constants, d: float, w: float) -> float:
    """Return the tension of a link at stretch `d` [m] and rate `w` [m/s]."""
    if kind >= law.FRICTION:
        return law.rate_tension(kind, c.z, c.limit, c.scale, w)[0]
    elastic = law.elastic_tension(kind, c.k, c.e, d)
    return elastic * max(1.0 - c.loss * w, 0.0) + c.z * w


@pytest.mark.parametrize("union", [SceneLink, Link3d])
def test_a_rig_file_has_the_kinds_of_the_table(union: Any) -> None:
    models = get_args(get_args(union)[0])
    words = [get_args(model.model_fields["type"].annotation)[0] for model in models]
    assert sorted(words) == sorted(LINK_KINDS)


@EVERY
def test_words_are_known_and_one_way_links_come_first(name: str) -> None:
    kind = LINK_KINDS[name]
    assert kind.proof in get_args(Proof)
    assert kind.symbol in get_args(Symbol)
    order = [one.one_way for one in LINK_KINDS.values()]
    assert order == sorted(order, reverse=True)  # `pull_links` passes over open ones by number


@EVERY
@given(c=CONSTANTS, w=st.floats(-2.0, 2.0), share=st.floats(-1.0, 1.0))
def test_proof_and_steepest_hold_of_the_law(
    name: str, c: Constants, w: float, share: float
) -> None:
    kind = LINK_KINDS[name]
    number = kind.number
    if kind.proof == "linear" or kind.bounded:
        c = c._replace(e=1.0, loss=0.0)
    if kind.proof in ("linear", "curved"):  # only a contact's elastic force has a loss
        c = c._replace(z=c.z if not kind.one_way else 0.0)
    if not kind.one_way:
        c = c._replace(loss=0.0)
    deep = c.depth if math.isfinite(c.depth) else 0.05
    d = share * deep
    power = total(number, c, d, w) - total(number, c, d, 0.0)
    if kind.proof == "active":
        assert power * w <= 0.0
    else:
        assert power * w >= 0.0  # what depends on the rate takes energy
    stiffness, damping = kind.steepest(c)
    small = 1e-6
    if stiffness > 0.0 and number < law.FRICTION and abs(share) < 0.99:
        slope = (total(number, c, d + small * deep, 0.0) - total(number, c, d, 0.0)) / (
            small * deep
        )
        assert slope <= stiffness * (1.0 + 1e-5)
    if damping > 0.0:
        given_rate = (total(number, c, d, w + small) - total(number, c, d, w)) / small
        assert given_rate <= damping * (1.0 + 1e-4) + 1e-9


@EVERY
def test_a_potential_gives_back_what_it_took_and_a_bounded_spring_bears_its_limit(
    name: str,
) -> None:
    kind = LINK_KINDS[name]
    if kind.number >= law.FRICTION:
        return
    link = Link("link", name, "hand", "ground", stiffness=100.0, limit=1.0)
    arrays = compile_network(Network((), (link,), ("hand",))).arrays
    tensions, stored = [], []
    for x in (0.0, -0.005, -0.02, -0.05, -0.02, 0.0):
        move_ports(arrays, 0, x, 1e-3)
        pull_links(arrays)
        tensions.append(abs(arrays.tension[0]))
        stored.append(arrays.stored[0])
    assert (max(tensions) <= 1.0 + 1e-12) == kind.bounded
    assert (stored[-1] == pytest.approx(0.0, abs=1e-12)) == kind.potential
