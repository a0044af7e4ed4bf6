"""Reasons of a wave coupling to stop: each with its numbers, and what acts from then on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from tautwave.couplings.wave.from_keys import PATIENCE_S
from tautwave.errors import SafetyStop
from tautwave.rig import command_delays, make_control
from tautwave.runtime.control import CoupledControl
from tautwave.types import JointState
from tests.certificate.rigs import rig

NAME = "bench-1dof-2khz"
QUIET = [
    f"{side}.axes.lever.{key}=0"
    for side in ("master", "slave")
    for key in ("position_noise", "encoder_quantum")
]


def control(*changes: str) -> CoupledControl:
    loaded = rig(*changes, "coupling.engage_ramp_s=0", name=NAME)
    return make_control(loaded, command_delays(loaded), 100_000)


def step(c: CoupledControl, slot: int, one: float, two: float = 0.0, skipped: int = 0) -> Any:
    """Take both positions, NaN for a missing sample; return the master."""
    for which, x in enumerate((one, two)):
        c.take(which, JointState(x, math.nan, math.nan, not math.isnan(x), 0), slot)
    c.step(slot, skipped)
    return c.axes[0]


def sentence(c: CoupledControl) -> str:
    error = c.error()
    assert isinstance(error, SafetyStop)
    assert error.exit_code == 6
    return str(error)


def giving_way(c: CoupledControl) -> Iterator[Any]:
    """Yield the master, which moves as its motor pushes it, and is pushed back now and then."""
    x, master = 0.0, step(c, 0, 0.0)
    for slot in range(1, 4000):
        x += math.copysign(6e-3, master.command) if slot % 3 else 2e-3
        master = step(c, slot, x)
        yield master


def test_an_overdrawn_port_stops_with_its_numbers_and_sends_nothing_below_its_floor() -> None:
    c = control(*QUIET, "master.axes.lever.position_range=null")
    for master in giving_way(c):
        if master.stopping:
            break
    assert "J in debt (limit " in sentence(c)
    assert f"{master.end.account:.3g}"[1:] in sentence(c)
    assert master.end.account < -c.params[0].end.port.reserve
    slot = c.state.slot
    x = master.position
    for at in range(1, 60):
        x += 5e-3 if at % 2 else -5e-3
        assert step(c, slot + at, x).end.account < -c.params[0].end.port.reserve
        assert master.command == 0.0


def test_skipped_slots_between_missing_samples_count_as_missing() -> None:
    """Each alone is allowed: two samples missing of five, and skips of two slots of forty."""
    c = control()
    for slot in range(3):
        step(c, slot, 0.0)
    step(c, 5, math.nan, skipped=2)
    assert c.error() is None
    step(c, 8, math.nan, skipped=2)
    assert "had no sample for too long" in sentence(c)


def test_without_a_sample_a_stopping_port_lets_go_at_its_ramp() -> None:
    c = control("master.axes.lever.effort_rate_limit=100", "loop.overrun_limit=5")
    for slot in range(40):
        master = step(c, slot, 1e-3 * slot)
    held = abs(master.total)
    assert held > 0.2
    c.overrun(45, 5)
    master = step(c, 45, math.nan, skipped=5)
    assert abs(master.total) == pytest.approx(held - 6 * 100 * 0.5e-3)


def owing(c: CoupledControl, slots: int, gap: float, shrinks: float) -> int:
    """Let the master's port owe a displacement that it cannot pay for; return when it stopped."""
    end = step(c, 0, 0.0).end
    for slot in range(1, slots):
        end.gap = gap * shrinks**slot * c.params[0].end.position_debt
        end.account = 0.4 * c.params[0].end.port.reserve
        step(c, slot, 0.0)
        if c.stopped:
            return slot
    return 0


def test_a_gap_that_nobody_repays_ends_the_run() -> None:
    slow = (*QUIET, "rate_hz=400", "coupling.pairs.lever.wave_filter_hz=100")
    slots = round(PATIENCE_S * 400)
    c = control(*slow)
    assert slots < owing(c, slots + 20, 1.5, 1.0)
    assert "owes the other end a displacement of 0.0563 that does not shrink" in sentence(c)
    assert owing(control(*slow), slots + 20, 30.0, 0.9995) == 0  # a slow one is on its way


def test_the_damping_of_a_stop_does_not_act_through_a_series_damper() -> None:
    """Else a matched end would pay F**2 T / b, more than it takes, and let go."""
    c = control(
        *QUIET,
        "coupling.pairs.lever.matched_master=true",
        "master.axes.lever.position_range=null",
        "master.axes.lever.damping={value: 0.2, lower: 0.2, source: test}",
    )
    step(c, 0, 0.0)
    c.overrun(40, 40)
    for slot in range(41, 300):
        master = step(c, slot, 1e-3 * slot)
    assert master.command == pytest.approx(-0.2 * 2.0, rel=0.5)


def test_a_gap_that_shrinks_does_not() -> None:
    c = control(*QUIET)
    end = step(c, 0, 0.0).end
    end.gap = 3.0 * c.params[0].end.position_debt
    for slot in range(1, 3000):
        step(c, slot, 0.0)
    assert c.error() is None
    assert abs(end.gap) < c.params[0].end.position_debt
    assert end.owing == 0
