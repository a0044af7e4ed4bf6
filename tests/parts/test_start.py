"""A coupling that starts is as new: it has its place, its reserve and an offset to mend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import pytest

from tautwave import registry
from tautwave.config.keys.coupling import Account
from tautwave.couplings.account import with_account
from tautwave.testing import CouplingBench
from tautwave.testing.steps import controller

PLACES = {"at", "far_position", "origin", "place"}
FUNDS = {"account", "reserve", "funds", "far_level", "level"}
MENDED = {"gap"}
UNCERTAIN = {"p11", "p22", "p33"}  # of a fit that has seen nothing

BENCHES = {
    "wave": {"wave_impedance": 0.02, "wave_filter_hz": 99.0, "pole_master": 0.5, "pole_slave": 0.4},
    "position": {"stiffness": 20.0, "damping": 0.1},
    "pd_damping": {"stiffness": 20.0, "damping": 0.1, "injection": 0.05},
    "four_channel": {"stiffness": 20.0, "damping": 0.1, "force_gain": 0.5, "observer_hz": 50.0},
    "mediated": {
        "stiffness": 20.0,
        "damping": 0.1,
        "observer_hz": 80.0,
        "touch": 0.03,
        "memory_s": 0.5,
        "sure": 0.3,
        "stiffest": 40.0,
        "adopt_s": 0.05,
    },
}


def numbers(state: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers of a state and of those in it."""
    for one in fields(state):
        value = getattr(state, one.name)
        if is_dataclass(value):
            yield from numbers(value, f"{at}{one.name}.")
        else:
            yield f"{at}{one.name}", value


def each(ends: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of both ends."""
    for side, axis in ends.items():
        yield from numbers(axis.end, f"{side}.")


def garble(state: Any) -> None:
    """Put something else into every number of a state."""
    for one in fields(state):
        value = getattr(state, one.name)
        if is_dataclass(value):
            garble(value)
        elif isinstance(value, bool):
            setattr(state, one.name, not value)
        else:
            setattr(state, one.name, type(value)(7))


def started(law: str, accounted: bool, spoilt: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what both ends hold after start and engage, and what new ones hold."""
    plugin = registry.load_coupling(law)
    if accounted:
        plugin = with_account(plugin, Account())
    control = controller(plugin, CouplingBench(plugin, law, BENCHES[law]).block(), samples=3)
    view = control.view.views[0]
    ends = {"master": view.one, "slave": view.two}
    fresh = dict(each(ends))
    view.one.position, view.two.position = 0.25, -0.5
    if spoilt:
        for axis in ends.values():
            garble(axis.end)
    law_of: Any = control.law
    law_of.steps.start(view, 0.125)
    law_of.steps.engage(view)
    return dict(each(ends)), fresh


CASES = [("wave", False), ("position", False), ("position", True), ("pd_damping", False),
         ("four_channel", True), ("mediated", True)]  # fmt: skip


@pytest.mark.parametrize(("law", "accounted"), CASES)
def test_nothing_of_before_is_left(law: str, accounted: bool) -> None:
    assert started(law, accounted, spoilt=True)[0] == started(law, accounted, spoilt=False)[0]


@pytest.mark.parametrize(("law", "accounted"), CASES)
def test_it_begins_with_its_place_its_reserve_and_what_is_to_be_mended(
    law: str, accounted: bool
) -> None:
    after, fresh = started(law, accounted, spoilt=False)
    changed = {name: value for name, value in after.items() if fresh.get(name, value) != value}
    for name, value in changed.items():
        last = "place" if ".place." in name else name.rpartition(".")[2]
        assert last in PLACES | FUNDS | MENDED | UNCERTAIN, (name, value)
        if last in PLACES:
            assert value in (0.25, -0.5), (name, value)
