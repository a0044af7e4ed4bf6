"""The certificate after a run that was tuned looks at the worst that acted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tautwave.config import load_rig, local_wall
from tautwave.report.run.after_run import worst_rig

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


class Run:
    checked_rig = load_rig(BENCH)

    def __init__(self, **columns: list[float]) -> None:
        self._columns = {name.replace("__", "."): np.array(c) for name, c in columns.items()}

    def read(self, *names: str) -> dict[str, Any]:
        return {name: self._columns[name] for name in names if name in self._columns}


def test_the_worst_row_of_a_wall_is_certified_and_said() -> None:
    run: Any = Run(
        tuning__slave__lever__wall_stiffness=[3.0, 8.0, 2.0],
        tuning__slave__lever__wall_damping=[4e-4, 4e-4, 3e-3],
    )
    rig, said = worst_rig(run)
    wall = local_wall(rig, "slave.lever")
    assert wall is not None
    assert (wall.stiffness, wall.damping) == (8.0, 4e-4)  # 4.4e-3 against 1.9e-3 and 4.0e-3
    assert len(said) == 1
    assert "slave.lever: its wall was tuned" in said[0]
    assert local_wall(rig, "master.lever") == local_wall(run.checked_rig, "master.lever")


def test_a_run_that_was_not_tuned_is_as_it_was() -> None:
    bare: Any = Run()
    rig, said = worst_rig(bare)
    assert rig == bare.checked_rig
    assert not said
    run: Any = Run(
        tuning__slave__lever__wall_stiffness=[3.0] * 3,
        tuning__slave__lever__wall_damping=[4e-4] * 3,
    )
    rig, said = worst_rig(run)
    assert local_wall(rig, "slave.lever") == local_wall(run.checked_rig, "slave.lever")
    assert not said
