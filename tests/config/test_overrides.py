"""`--set`: every key, typed and checked like the file."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.config import parse_rig
from tests.config.bench import BENCH, problems


def _values(*overrides: str) -> dict[str, Any]:
    return parse_rig(BENCH, overrides=overrides).model_dump()


def test_scalars_are_read_like_the_file() -> None:
    values = _values("rate_hz=5e2", "name='12:30'", "seed=0x10", "loop.lock_memory=false")
    assert values["rate_hz"] == 500.0
    assert values["name"] == "12:30"
    assert values["seed"] == 16
    assert values["loop"]["lock_memory"] is False


def test_spaces_around() -> None:
    assert _values("  coupling . delay_s  = 0.05 ")["coupling"]["delay_s"] == 0.05


def test_an_absent_block_is_made() -> None:
    assert _values("loop.cpu=1")["loop"]["cpu"] == 1
    assert _values("buses.hand.options.command_delay_s=0.002")["buses"]["hand"]["options"] == {
        "command_delay_s": 0.002
    }


def test_an_empty_value_is_the_default() -> None:
    text = BENCH + "loop: {cpu: 3}\n"
    assert parse_rig(text, overrides=["loop.cpu="]).loop.cpu is None


@pytest.mark.parametrize(
    "key",
    [
        'simulation.axes."master.wrist".inertia',
        "simulation.axes.'master.wrist'.inertia",
        "simulation.axes.master.wrist.inertia",
    ],
)
def test_axis_names_hold_a_dot(key: str) -> None:
    assert _values(f"{key}=2e-3")["simulation"]["axes"]["master.wrist"]["inertia"] == 2e-3


@pytest.mark.parametrize("key", ['simulation.axes."slave.wrist"', "simulation.axes.slave.wrist"])
def test_axis_that_the_file_does_not_name(key: str) -> None:
    values = _values(f"{key}.coulomb=1e-3")
    assert values["simulation"]["axes"]["slave.wrist"]["coulomb"] == 1e-3
    values = _values(f"{key}={{coulomb: 1e-3}}")
    assert values["simulation"]["axes"]["slave.wrist"]["coulomb"] == 1e-3


def test_whole_mappings_and_lists() -> None:
    override = "simulation.hand.wrist.reference={type: hold, position: 0.1}"
    values = _values(override, "slave.axes.wrist.position_range=[-1, 1]")
    assert values["simulation"]["hand"]["wrist"]["reference"] == {"type": "hold", "position": 0.1}
    assert values["slave"]["axes"]["wrist"]["position_range"] == (-1.0, 1.0)


def test_items_of_a_list() -> None:
    key = "simulation.hand.wrist.reference.waypoints"
    values = _values(f"{key}.1.1=0.4", f"{key}.2=[3, 0]")
    waypoints = values["simulation"]["hand"]["wrist"]["reference"]["waypoints"]
    assert waypoints == ((0.0, 0.0), (1.0, 0.4), (3.0, 0.0))


def test_later_ones_win() -> None:
    assert _values("rate_hz=500", "rate_hz=2000")["rate_hz"] == 2000.0


def test_a_right_value_replaces_a_wrong_one() -> None:
    text = BENCH.replace("rate_hz: 1000", "rate_hz: fast")
    assert parse_rig(text, overrides=["rate_hz=500"]).rate_hz == 500.0


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("coupling.delay_s=abc", "Input should be a valid number (got 'abc')"),
        (
            "coupling.delay_s=1_0",
            "Input should be a valid number (got '1_0'); leave out the underscores",
        ),
        ("coupling.delay_s=", "Input should be a valid number (got null); the key has no value"),
        (
            "coupling.delay_s=0.0203",
            "must be a whole number of samples at 1000 Hz; nearest: 0.02 or 0.021 (got 0.0203)",
        ),
        (
            "loop.cpus=1",
            "unknown key 'cpus'; did you mean 'cpu'? Allowed: engine, missing_limit, "
            "overrun_limit, fifo_priority, cpu, lock_memory, ring_rows",
        ),
        (
            "buses.hand.options.command_delay_s=-1",
            "Input should be greater than or equal to 0 (got -1)",
        ),
        ("slave.axes.wrist.bus=amr", "unknown bus 'amr'; did you mean 'arm'? Buses: hand, arm"),
        (
            "simulation.axes.master.elbow={coulomb: 1}",
            "unknown axis 'master.elbow'. Axes: master.wrist, slave.wrist",
        ),
        (
            "coupling.pairs.wrist={wave_impedance: 1, wave_impedance: 2}",
            "coupling.pairs.wrist.wave_impedance: duplicate key 'wave_impedance', "
            "in the same mapping",
        ),
        (
            "coupling.pairs.wrist.wall_slave={position: 0, stiffness: -1}",
            "coupling.pairs.wrist.wall_slave.stiffness: Input should be greater than 0 (got -1)",
        ),
        (
            "slave.axes.wrist.load={sine:-0.05}",
            'slave.axes.wrist.load."sine:-0.05": unknown key '
            "'sine:-0.05'; write a space after the colon",
        ),
        (
            "rate_hz.fast=1",
            "rate_hz is 1000 and has no keys below it; set rate_hz as a whole, "
            "such as rate_hz={key: value}",
        ),
        (
            "simulation.hand.wrist.reference.waypoints.7=[1, 1]",
            "simulation.hand.wrist.reference.waypoints has 2 items, indexed from 0",
        ),
        (
            "simulation.hand.wrist.reference.waypoints.last=[1, 1]",
            "simulation.hand.wrist.reference.waypoints is a list; use an index, not 'last'",
        ),
        (
            "name={unclosed",
            "YAML syntax: expected ',' or '}', but got 'stream end' (while parsing a flow mapping)",
        ),
        ("name=a: b: c", "YAML syntax: mapping values are not allowed here"),
        ("rate_hz", "write it as key=value, with dots between keys, such as rate_hz=500"),
        ("", "write it as key=value, with dots between keys, such as rate_hz=500"),
        ("=1", "write it as key=value, with dots between keys, such as rate_hz=500"),
        ("a..b=1", "write it as key=value, with dots between keys, such as rate_hz=500"),
        ('a."b=1', "write it as key=value, with dots between keys, such as rate_hz=500"),
    ],
)
def test_mistakes_name_the_argument(override: str, said: str) -> None:
    assert problems(overrides=[override]) == [f"--set {override}: {said}"]


def test_a_mistake_elsewhere_names_both_places() -> None:
    """The rate comes from the argument, the delay that does not fit it from the file."""
    said = problems(overrides=["rate_hz=30"])
    assert said == [
        "rig.yaml:27: coupling.delay_s: must be a whole number of samples at 30 Hz; nearest: "
        "0 or 0.0333333333333 (got 0.02)"
    ]


def test_all_mistakes_at_once() -> None:
    said = problems(BENCH.replace("id: 1", "id: -1"), ["rate_hz=x", "nonsense", "loop.cpu=-1"])
    assert [line.split(": ")[0] for line in said] == [
        "rig.yaml:11",
        "rig.yaml:21",
        "--set nonsense",
        "--set rate_hz=x",
        "--set loop.cpu=-1",
    ]
