"""What others depend on is as it was, or changed on purpose: `surface.py` says how."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import tautwave
from tests.house import defaults
from tests.house.surface import ROOT, difference

LEVER = "bench-1dof-loopback"
SLOW = (
    "three-bus-sim", "bench-canopen-virtual", "bench-modbus-rtu-sim", "bench-modbus-tcp-sim",
    "bench-2axis-loopback", "network-loopback", "scene-resonator",
)  # fmt: skip
"""Rigs whose check takes long."""
FAILING: tuple[tuple[str, str, int], ...] = (
    (LEVER, "rate_hz=0", 2),
    (LEVER, "name=1", 2),
    (LEVER, "duration_s=-1", 2),
    (LEVER, "require=safe", 2),
    (LEVER, "coupling.law=nothing", 2),
    (LEVER, "coupling.delay_s=0.0005", 2),
    (LEVER, "coupling.pairs.lever.wave_impedance=0", 2),
    (LEVER, "coupling.pairs.wrist={wave_impedance: 0.02}", 2),
    (LEVER, "buses.arm.driver=canbus", 2),
    (LEVER, "buses.arm.options={speed: 1}", 2),
    (LEVER, "loop.missing_limit=0", 2),
    (LEVER, "master.axes.lever.speed=1", 2),
    (LEVER, "master.axes.lever.kind=linear", 2),
    (LEVER, "master.axes.lever.effort_limit=-1", 2),
    (LEVER, "master.axes.lever.position_range=[1,-1]", 2),
    (LEVER, "master.axes.lever.inertia.lower=1", 2),
    (LEVER, "scene={masses: {a: {mass: 1}}}", 2),
    (LEVER, "simulation.environment.lever={type: mud}", 2),
    ("nowhere", "rate_hz=1000", 2),
    (LEVER, "buses.arm.divisor=3", 3),
    (LEVER, "require=passive_quantised", 3),
    (LEVER, "master.axes.lever.damping=0", 3),
    (LEVER, "slave.axes.lever.damping=0", 3),
    (LEVER, "coupling.pairs.lever.wall_slave.stiffness=90", 3),
    (LEVER, "coupling.pairs.lever.wall_slave.stiffness=900", 3),
    (LEVER, "coupling.pairs.lever.wall_master={position: 0.1, stiffness: 500, damping: 0}", 3),
    ("bench-position-coupling", "require=passive", 3),
    ("bench-position-coupling", "require=passive_quantised", 3),
    ("bench-position-coupling", "coupling.pairs.lever.stiffness=500", 3),
    ("bench-1dof-2khz", "require=passive_quantised", 3),
    ("bench-2axis-loopback", "master.axes.wrist.damping=0", 3),
    ("bench-admittance-loopback", "require=passive_quantised", 3),
    ("network-loopback", "require=passive_quantised", 3),
    ("scene-resonator", "require=passive_quantised", 3),
    ("scene-granular", "require=passive", 3),
    ("bench-canopen-virtual", "rate_hz=8000", 4),
    ("bench-dynamixel-sim", "rate_hz=4000", 4),
    ("bench-modbus-rtu-sim", "rate_hz=4000", 4),
    ("bench-modbus-tcp-sim", "rate_hz=20000", 4),
    ("three-bus-sim", "rate_hz=4000", 4),
)


def test_the_surface_is_as_it_was() -> None:
    found = difference()
    assert not found, (
        "changed; if that is meant, `python -m tests.house.surface --write` and say so in "
        "CHANGELOG:\n" + "\n".join(found)
    )


def test_defaults_and_bounds_of_keys_are_as_they_were() -> None:
    changed = defaults.difference()
    assert not changed, (
        "changed; if that is meant, `python -m tests.house.defaults --write` and say so in "
        "CHANGELOG:\n" + "\n".join(changed)
    )


@pytest.mark.parametrize(
    ("rig", "change", "code"),
    [pytest.param(*it, marks=[pytest.mark.slow] if it[0] in SLOW else []) for it in FAILING],
)
def test_a_failing_rig_ends_with_its_exit_code(
    rig: str, change: str, code: int, tmp_path: Path
) -> None:
    ended = tautwave("check", ROOT / "configs" / f"{rig}.yaml", "--set", change, cwd=tmp_path)
    assert ended.exit_code == code, ended.output
