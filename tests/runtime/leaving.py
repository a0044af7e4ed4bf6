"""How every run of the loop has to leave its axes."""

from __future__ import annotations

import math

from tautwave.types import SAFE_COMMAND
from tests.runtime.parts import Bench

ENDING = ["write", "disable", "close"]


def assert_left_safely(bench: Bench) -> None:
    """Every bus: safe command, disable, close, in this order and at the end; then only faults."""
    tail = [one for one in bench.log if one[1] != "faults"][-6:]
    assert tail == [(bus, method) for method in ENDING for bus in ("hand", "arm")]
    for driver in (bench.hand, bench.arm):
        assert driver.written[-1] == [SAFE_COMMAND]


def assert_finite_commands(bench: Bench) -> None:
    """Numbers for what the axes take; no goal for a device that takes none."""
    for driver in (bench.hand, bench.arm):
        for command in (one for commands in driver.written for one in commands):
            assert math.isfinite(command.effort)
            assert math.isfinite(command.velocity)
            assert math.isnan(command.position)
