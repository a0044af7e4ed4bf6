"""Ports in space and their motors' limits: what slow rounds give, against the certificate."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave import Rig
from tautwave.certificate import certify
from tests.scene.test_port_limits import ROUND, given, passive, rig

ALONG = (1.0, 0.0, 0.0)
MASS = {"mass": 0.05, "damping": 1.0}


def port(*axes: str, ways: tuple[tuple[float, ...], ...] = (ALONG,), **keys: Any) -> dict[str, Any]:
    given = {"axes": list(axes), "directions": [list(way) for way in ways]}
    return given | {"to": "o", "stiffness": 500.0} | keys


def between(limits: dict[str, float], **scene: Any) -> Rig:
    """Two ports that hold one mass, each moved by one axis."""
    ports = {name: port(name) for name in limits}
    return rig(limits, **{"dimension": 3, "masses": {"o": MASS}, "ports": ports, **scene})


def corner(limit: float) -> Rig:
    """A mass on a spring that turns about a ground, moved by two axes of one port."""
    return rig(
        {"a": limit, "c": limit},
        dimension=3,
        masses={"o": MASS},
        grounds={"below": [0.0, 0.0, -0.1]},
        links={"s": {"type": "spring", "between": ["o", "below"], "stiffness": 400, "rest": 0.1}},
        ports={"p": port("a", "c", ways=(ALONG, (0.0, 0.0, 1.0)))},
    )


@pytest.mark.slow
def test_unequal_limits_give_each_round_and_are_not_certified() -> None:
    found = between({"a": 20.0, "c": 1.0})
    good, why = passive(found)
    assert not good
    assert "their limits differ in the scene's force: 20 N at a, 1 N at c" in why
    once, often = (given(found, ROUND, rounds) for rounds in (1, 2))
    assert once > 1.0
    assert often == pytest.approx(2.0 * once, rel=0.1)  # without end


@pytest.mark.slow
def test_equal_limits_along_one_line_are_certified_and_no_slow_round_gives() -> None:
    found = between({"a": 5.0, "c": 5.0})
    assert passive(found)[0]
    assert given(found, ROUND) < 1e-3


def test_what_joins_two_ports_must_be_held_by_nothing_else_and_move_along_one_line() -> None:
    assert passive(between({"a": 5.0, "c": 5.0}))[0]
    held = {"g": {"type": "spring", "between": ["o", "ground"], "stiffness": 40}}
    for scene, why in (
        ({"links": held}, "joins them with a ground"),
        ({"gravity": 9.81}, "have weight"),
        ({"ports": {"a": port("a"), "c": port("c", ways=((0.0, 1.0, 0.0),))}}, "along one line"),
        ({"ports": {"a": port("a"), "c": port("c", position_scale=0.5)}}, "limits differ"),
    ):
        good, said = passive(between({"a": 5.0, "c": 5.0}, **scene))
        assert not good
        assert why in said
    good, said = passive(between({"a": 5.0, "b": 5.0, "c": 5.0}))
    assert not good
    assert "joins more than two ports" in said
    other = {"a": port("a"), "c": port("c") | {"to": "q"}}
    apart = between({"a": 5.0, "c": 1.0}, masses={"o": MASS, "q": MASS}, ports=other)
    assert passive(apart)[0]


@pytest.mark.slow
def test_a_port_that_two_axes_move_gives_at_their_limits_and_says_so() -> None:
    """Its limits are alike: one is reached and the other is not."""
    path = {"a": [0.0, 0.1, 0.1, 0.0], "c": [0.0, 0.0, 0.1, 0.1]}
    often = [given(corner(5.0), path, rounds) for rounds in (1, 2)]
    assert often[0] > 0.05
    assert often[1] == pytest.approx(2.0 * often[0], rel=0.1)
    assert given(corner(500.0), path) < 0.0
    found = certify(corner(5.0)).verdicts["passive"]
    assert found.passed
    for axis in ("a", "c"):
        assert any(
            f"the motor of master.{axis} is not at its effort_limit while other axes move p" in one
            for one in found.conditions
        )
