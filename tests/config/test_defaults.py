"""`defaults`: the same rig as written out, and messages that name the default's own line."""

from __future__ import annotations

import json

import pytest

from tautwave.config import Rig, parse_rig, resolved_yaml, rig_schema
from tautwave.config.text.yaml12 import parse_yaml
from tests.config.bench import BENCH, problems

SIX = (1, 2, 3, 4, 5, 6)
KEYS = """\
kind: rotary
      inertia: {value: 4.0e-4, lower: 2.5e-4, source: assumed}
      damping: {value: 2.0e-3, lower: 1.2e-3, source: assumed}
      effort_limit: 0.06
      effort_rate_limit: 20
      velocity_limit: 15
      position_range: [-1.5, 1.5]"""


def arms(leader: str = "", follower: str = "", pairs: str = "") -> str:
    """Return two arms of six joints, in as few lines as an operator would write."""

    def axes(text: str) -> str:
        own = {1: text} if text else {}
        return "\n".join(f"    j{n}: {{id: {n}{own.get(n, '')}}}" for n in SIX)

    def side(name: str, bus: str, text: str) -> str:
        defaults = KEYS.replace("      ", "    ")
        return f"{name}:\n  defaults:\n    bus: {bus}\n    {defaults}\n  axes:\n{axes(text)}\n"

    coupled = "\n".join(f"    j{n}: {{{pairs if n == 1 else ''}}}" for n in SIX)
    return (
        "name: arms\nrate_hz: 300\nduration_s: 30\nbuses:\n"
        "  hand: {driver: loopback}\n  arm: {driver: loopback}\n"
        + side("master", "hand", leader)
        + side("slave", "arm", follower)
        + "coupling:\n  defaults: {wave_impedance: 5.0e-3, wave_filter_hz: 30}\n"
        f"  pairs:\n{coupled}\nsimulation: {{}}\n"
    )


def written_out(rig: Rig) -> Rig:
    """Return what the resolved rig of a rig reads as."""
    return parse_rig(resolved_yaml(rig))


def test_six_pairs_in_sixty_lines_are_the_rig_written_out() -> None:
    text = arms(", effort_limit: 0.03", pairs="wave_filter_hz: 25")
    assert len(text.splitlines()) <= 60
    rig = parse_rig(text)
    assert written_out(rig) == rig
    assert "defaults" not in resolved_yaml(rig)
    assert [axis.effort_limit for axis in rig.master.axes.values()] == [0.03, *[0.06] * 5]
    assert [axis.id for axis in rig.slave.axes.values()] == list(SIX)
    assert {axis.bus for axis in rig.slave.axes.values()} == {"arm"}
    filters = [pair.model_dump()["wave_filter_hz"] for pair in rig.coupling.pairs.values()]
    assert filters == [25.0, *[30.0] * 5]


def test_own_keys_come_before_the_sides_and_those_before_the_bus() -> None:
    text = arms(", velocity_limit: 3").replace(
        "hand: {driver: loopback}",
        "hand: {driver: loopback, defaults: {velocity_limit: 9, effort_quantum: 0.001}}",
    )
    text = text.replace("    velocity_limit: 15\n", "", 1)
    rig = parse_rig(text)
    assert [axis.velocity_limit for axis in rig.master.axes.values()] == [3.0, *[9.0] * 5]
    assert {axis.effort_quantum for axis in rig.master.axes.values()} == {0.001}
    assert {axis.velocity_limit for axis in rig.slave.axes.values()} == {15.0}


def test_mappings_are_merged_so_that_set_reaches_one_key_below_a_default() -> None:
    rig = parse_rig(
        arms(),
        overrides=[
            "master.axes.j2.inertia.lower=1e-4",
            "slave.defaults.effort_limit=0.01",
            "coupling.pairs.j3.wave_impedance=0.006",
        ],
    )
    inertia = rig.master.axes["j2"].inertia
    assert inertia is not None
    assert (inertia.value, inertia.lower) == (4e-4, 1e-4)
    assert {axis.effort_limit for axis in rig.slave.axes.values()} == {0.01}
    assert rig.coupling.pairs["j3"].model_dump()["wave_impedance"] == 0.006


def line_of(text: str, part: str) -> int:
    return next(at for at, line in enumerate(text.splitlines(), 1) if part in line)


def test_a_mistake_in_a_default_is_reported_once_where_it_stands() -> None:
    text = arms().replace("effort_limit: 0.06", "effort_limit: -1", 1)
    assert problems(text) == [
        f"rig.yaml:{line_of(text, 'effort_limit: -1')}: master.defaults.effort_limit: "
        "Input should be greater than 0 (got -1)"
    ]


def test_a_mistake_that_only_some_axes_have_names_them() -> None:
    text = arms(", causality: admittance")
    said = problems(text)
    at = line_of(text, "inertia:")
    assert [line for line in said if f"rig.yaml:{at}: master.defaults.inertia" in line]
    assert all("(in master.axes.j1)" in line for line in said if "master.defaults" in line)


def test_a_misspelt_default_has_its_nearest_key() -> None:
    text = arms().replace("velocity_limit", "velocity_limt", 1)
    (said,) = problems(text)
    assert said.startswith(
        f"rig.yaml:{line_of(text, 'velocity_limt')}: master.defaults.velocity_limt: unknown key"
    )
    assert "'velocity_limit'" in said


def test_a_mistake_set_from_outside_names_the_argument() -> None:
    assert problems(arms(), ["slave.defaults.effort_limit=-1"]) == [
        "--set slave.defaults.effort_limit=-1: Input should be greater than 0 (got -1)"
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            BENCH.replace("master:", "master:\n  defaults: {kind: linear}"),
            "rig.yaml:8: master.defaults.kind: no axis of this side uses this default; remove it",
        ),
        (
            BENCH.replace("hand: {driver: loopback}", "hand: {driver: loopback, defaults: [1]}"),
            "rig.yaml:5: buses.hand.defaults: Input should be a mapping (got a list)",
        ),
        (
            BENCH.replace("  pairs:", "  defaults: {wave_impedance: 1}\n  pairs:"),
            "rig.yaml:28: coupling.defaults.wave_impedance: no pair uses this default; remove it",
        ),
    ],
)
def test_a_default_that_nobody_takes_is_a_mistake(text: str, said: str) -> None:
    assert problems(text) == [said]


def test_the_schema_asks_for_keys_only_where_no_default_can_give_them() -> None:
    checker = pytest.importorskip("jsonschema").Draft202012Validator(rig_schema())

    def valid(text: str) -> bool:
        return bool(checker.is_valid(json.loads(json.dumps(parse_yaml(text).value))))

    assert valid(arms())
    assert not valid(BENCH.replace("      kind: rotary\n", "", 1))
    assert not valid(arms().replace("velocity_limit", "velocity_limt", 1))
    spring = BENCH.replace("  pairs:", "  law: position\n  pairs:")
    spring = spring.replace("wave_impedance: 0.02", "damping: 0.1")
    assert not valid(spring)
    assert valid(spring.replace("  pairs:", "  defaults: {stiffness: 2}\n  pairs:"))


def test_a_default_that_is_set_aside_for_one_command_is_no_mistake() -> None:
    sets = [f"master.axes.j{n}.effort_limit=0.01" for n in SIX]
    rig = parse_rig(arms(), "rig.yaml", sets)
    assert {axis.effort_limit for axis in rig.master.axes.values()} == {0.01}
    assert {axis.effort_limit for axis in rig.slave.axes.values()} == {0.06}
