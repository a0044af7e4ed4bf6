"""A coupling whose steps are wrong is caught: by its suite, and live by the loop's guards."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.controller.steps import OWN_GUARDS, Guard, Law
from tautwave.registry import load_coupling, load_named
from tautwave.testing import CouplingBench, CouplingContract
from tautwave.testing.steps import CYCLES, at_random, controller, drive, there_and_back
from tests.parts.test_suites import example

KEPT: list[float] = []


def bench(guards: dict[int, Guard] | None = None, **steps: Any) -> CouplingBench:
    """Return the example's coupling with other steps."""
    plugin = example("pd_injection").plugin
    law: Law = plugin.law._replace(steps=plugin.law.steps._replace(**steps), guards=guards or {})
    keys = {"stiffness": 1.5, "damping": 0.01, "injection": 0.05}
    return CouplingBench(plugin._replace(law=law), "pd_injection", keys)


def own_think(s: Any, p: Any, free_velocity: float) -> float:
    found: float = example("pd_injection").plugin.law.steps.compute_effort(s, p, free_velocity)
    return found


def nan(s: Any, p: Any, free_velocity: float) -> float:
    return math.nan if s.position > 1e-3 else own_think(s, p, free_velocity)


def active(s: Any, p: Any, free_velocity: float) -> float:
    return -0.3 * s.velocity


def hoarding(s: Any, p: Any, free_velocity: float) -> float:
    KEPT.append(free_velocity + 0.1)
    return own_think(s, p, free_velocity)


def lying(s: Any, p: Any, displacement: float, count: float, span: float, port: float) -> None:
    s.end.absorbed += 0.9 * port * displacement


def remembering(s: Any, p: Any, free_velocity: float) -> float:
    KEPT.append(1.0)
    return own_think(s, p, free_velocity) + 1e-6 * len(KEPT)


def alarmed(s: Any, p: Any, free_velocity: float) -> float:
    if s.position > 1e-3:
        s.alarm = OWN_GUARDS + 7
    return own_think(s, p, free_velocity)


def test_what_is_moved_there_and_back_begins_and_ends_at_rest() -> None:
    """x = 0.1 r sin p and y = 0.05 r sin 2 p, r = (1 - cos p) / 2: exact at eighths of a turn."""
    half, low, high = math.sqrt(0.5), 0.5 - 0.5 * math.sqrt(0.5), 0.5 + 0.5 * math.sqrt(0.5)
    quarter = [(0.0, 0.0), (low * half, low), (0.5, 0.0), (high * half, -high)]
    eighths = [*quarter, (0.0, 0.0), *((-x, -y) for x, y in reversed(quarter))]
    for (x, y, *rest), (one, two) in zip(there_and_back(9), eighths, strict=True):
        assert (x, y) == pytest.approx((0.1 * one, 0.05 * two), abs=1e-15)
        assert rest == [True, True, 0]
    moves = list(there_and_back())
    assert len(moves) == CYCLES
    for first, second in (moves[:2], moves[:-3:-1]):
        assert first[:2] == pytest.approx((0.0, 0.0), abs=1e-15)
        assert abs(second[0]) < 1e-9
        assert abs(second[1]) < 1e-9


@pytest.mark.parametrize(
    ("steps", "check", "more"),
    [
        ({"compute_effort": nan}, "its_steps_return_numbers", (0,)),
        ({"compute_effort": active}, "it_gives_no_energy", ()),
        ({"compute_effort": hoarding}, "a_cycle_allocates_nothing_but_numbers", ()),
        ({"close": lying}, "its_books_close", (0,)),
        ({"compute_effort": remembering}, "no_run_remembers_another", ()),
    ],
)
def test_a_planted_fault_is_caught(
    steps: dict[str, Any], check: str, more: tuple[int, ...]
) -> None:
    with pytest.raises(AssertionError):
        getattr(CouplingContract(), f"test_{check}")(bench(**steps), *more)


def test_what_is_not_finite_stops_the_run_and_names_the_law() -> None:
    made = bench(compute_effort=nan)
    control = controller(made.plugin, made.block())
    reported = drive(control, at_random())
    assert "was commanded a non-finite effort by its coupling, law pd_injection" in reported.reason
    place = control.place()
    assert place is not None
    assert place.reason == "coupling_not_finite"
    assert all(map(math.isfinite, reported.column("master.wrist.commanded")))


def test_a_part_has_guards_of_its_own() -> None:
    made = bench({OWN_GUARDS + 7: Guard("port_starved", "let go")}, compute_effort=alarmed)
    control = controller(made.plugin, made.block())
    reported = drive(control, at_random())
    assert "wrist let go at" in reported.reason
    place = control.place()
    assert place is not None
    assert place.reason == "port_starved"


def test_before_a_drive_nothing_is_on_its_way() -> None:
    plugin = load_coupling("wave")
    keys = {"wave_impedance": 0.05, "wave_filter_hz": 100.0, "pole_master": 0.5, "pole_slave": 0.5}
    coupling = load_named(plugin.keys).model_validate({"law": "wave", "pairs": {"lever": keys}})
    control = controller(plugin, coupling, samples=4)
    assert list(control.table) == [0.0] * 4 * load_named(plugin.law).rings
    assert len(control.table) > 4
