"""Networks of masses, springs and dampers: matrices, determinants, passivity."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.exact.positive_real import LOSSLESS, positive_real
from tautwave.analysis.exact.rational import rational
from tautwave.errors import ConfigError
from tautwave_scenes.certificate.impedance import (
    GROUND,
    Damper,
    Mass,
    Matrix,
    Part,
    Spring,
    _assemble,
    admittance,
    impedance,
    nodes_of,
)
from tests.examples import tried

values = st.sampled_from([0.001, 0.143, 0.5, 2.0, 5.0, 538.0, 14200.0])
NODES = ("a", "b", "c", "d")


def _as_array(rows: list[list[Fraction]]) -> Matrix:
    return np.array([[float(c) for c in row] for row in rows]).reshape(len(rows), len(rows))


def matrices(parts: Sequence[Part]) -> tuple[Matrix, Matrix, Matrix]:
    """Return mass, damping and stiffness matrix, each (n, n) in the order of `nodes_of`.

    Raises
    ------
    ConfigError
        If a value is negative: such a part is not passive.
    """
    mass, damping, stiffness = _assemble(parts)
    return _as_array(mass), _as_array(damping), _as_array(stiffness)


@st.composite
def networks(draw: st.DrawFn) -> list[Part]:
    """Random passive networks in which every node has a mass or a way to ground."""
    count = draw(st.integers(1, 4))
    parts: list[Part] = []
    for i, node in enumerate(NODES[:count]):
        kind = draw(st.sampled_from(["mass", "spring", "damper"]))
        to = NODES[draw(st.integers(0, i - 1))] if i else GROUND
        parts.append({"mass": Mass(node, draw(values)), "spring": Spring(node, to, draw(values)),
                      "damper": Damper(node, to, draw(values))}[kind])  # fmt: skip
    for _ in range(draw(st.integers(0, 4))):
        first = NODES[draw(st.integers(0, count - 1))]
        second = draw(st.sampled_from([GROUND, *NODES[:count]]))
        if second != first:
            parts.append(draw(st.sampled_from([Spring, Damper]))(first, second, draw(values)))
    return parts


@given(networks())
@settings(max_examples=tried(60))
def test_every_passive_network_is_positive_real_at_every_node(parts: list[Part]) -> None:
    for node in nodes_of(parts):
        found = positive_real(impedance(parts, node))
        assert found.positive_real, found.reason


@given(networks())
@settings(max_examples=tried(40))
def test_impedance_is_that_of_the_matrices(parts: list[Part]) -> None:
    mass, damping, stiffness = matrices(parts)
    s = 0.7 + 3.0j
    flexibility = np.linalg.inv(mass * s * s + damping * s + stiffness)
    for i, node in enumerate(nodes_of(parts)):
        assert impedance(parts, node)(s) == pytest.approx(1.0 / (s * flexibility[i, i]), rel=1e-6)


def test_without_dampers_it_is_lossless() -> None:
    parts = [Mass("a", 1), Spring("a", "b", 3), Mass("b", 2), Spring("b", GROUND, 5)]
    assert positive_real(impedance(parts, "a")).strictness == LOSSLESS
    assert admittance(parts, "a") == impedance(parts, "a").inverse()


def test_parts_in_parallel_add_and_the_mean_of_a_chain_is_exact() -> None:
    single = [Mass("a", 0.1), Damper("a", GROUND, 0.2), Spring("a", GROUND, 0.3)]
    assert impedance(single, "a") == rational([0.1, 0.2, 0.3], [1, 0])
    series = [Spring("a", "b", 2), Damper("b", GROUND, 3)]  # Maxwell: 1/(s/2 + 1/3)
    assert impedance(series, "a") == rational([6], [3, 2])


def test_bad_networks_are_sentences() -> None:
    with pytest.raises(ConfigError, match="to be passive"):
        matrices([Spring("a", GROUND, -1)])
    with pytest.raises(ConfigError, match="no node b"):
        impedance([Mass("a", 1)], "b")
    with pytest.raises(ConfigError, match="tied to nothing"):
        impedance([Mass("a", 1), Spring("b", "c", 1)], "a")
    with pytest.raises(ConfigError, match="both ends"):
        matrices([Spring("a", "a", 1)])
    with pytest.raises(ConfigError, match="nothing is connected to it"):
        admittance([Spring("a", "b", 1)], "a")
