"""What a wall gave beyond what it took, from rows made by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.report.run.after_run import wall_balance, wall_debt

RIG = load_rig(Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml")
AXIS = "slave.lever"
PUSHED = [0.0, 0.2, 0.2, 0.2, 0.0, 0.0]
TAKEN = [0.0, 0.0, 0.0, -1e-3, -1e-3, -1e-3]
"""[J] The wall gives a millijoule in the third sample of its push, and has taken none."""


def run_of(position: list[float], **more: list[float]) -> Any:
    columns = {
        "skipped_slots": [0.0] * len(position),
        f"{AXIS}.valid": [1.0] * len(position),
        f"{AXIS}.position": position,
        f"{AXIS}.wall_effort": PUSHED,
        "lever.wall_slave.absorbed": TAKEN,
        **more,
    }

    def read(*names: str) -> dict[str, Any]:
        return {name: np.array(columns[name]) for name in names}

    return SimpleNamespace(read=read, rig={})


def test_what_a_wall_gives_is_a_debt_from_its_first_push_on() -> None:
    still = run_of([0.0] * 6)
    assert wall_debt(still, RIG, AXIS) == pytest.approx(1e-3)
    assert wall_balance(still, RIG, AXIS) == pytest.approx(-1e-3)
    moved = run_of([0.0, 0.0, 0.01, 0.01, 0.01, 0.01])
    debt = wall_debt(moved, RIG, AXIS)
    assert debt is not None
    assert 0.0 < debt < 0.99e-3  # what damping took while it pushed, before, is counted in
    before = run_of([-0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert wall_debt(before, RIG, AXIS) == pytest.approx(1e-3)  # it did not push yet
