"""A rig over simulated CAN gives the rows of a loopback rig with the bus's steps and delay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.config import load_rig
from tautwave.registry import load_driver
from tests.rigs.running import Run, Tree, books, rig_of, run_rig

CONFIG = Path(__file__).parents[2] / "configs" / "bench-canopen-virtual.yaml"
DURATION_S = 4.0


def can_tree(**options: Any) -> Tree:
    data: Tree = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    data["simulation"]["axes"]["master.lever"]["position_noise"] = 1e-5
    data["buses"]["can"]["options"].update(options)
    return data


def admittance_tree() -> Tree:
    data = can_tree()
    data["require"] = "coupled_stable"
    slave = data["slave"]["axes"]["lever"]
    for key in ("inertia", "damping"):
        del slave[key]
    slave |= {"causality": "admittance", "environment_stiffness_upper": 2.0}
    data["coupling"]["pairs"]["lever"]["wave_impedance"] = 0.03
    data["simulation"]["axes"]["slave.lever"] = {"velocity_time_constant_s": 0.002}
    data["simulation"]["environment"]["lever"] = {"type": "spring", "stiffness": 1.0, "position": 0}
    return data


def loopback_tree(data: Tree, *, steps: bool = True) -> Tree:
    """Return the same rig on loopback buses, with the quanta and the command delay of the CAN."""
    rig = rig_of(data)
    bus = rig.buses["can"]
    plugin = load_driver("canopen")
    options = plugin.options.model_validate(bus.options)
    out: Tree = yaml.safe_load(yaml.safe_dump(data))
    period = 1.0 / rig.rate_hz
    out["buses"] = {"can": {"driver": "loopback", "options": {"command_delay_s": period}}}
    assert (options.sync, options.rpdo) == (True, "sync")
    for side in ("master", "slave"):
        axis = rig.axes[f"{side}.lever"]
        quanta = ("encoder_quantum", "effort_quantum", "velocity_quantum")
        for key in quanta:
            out[side]["axes"]["lever"][key] = getattr(axis, key) if steps else 0.0
    return out


def own(column: str) -> bool:
    """Tell whether a column is the CAN driver's own."""
    return column.endswith(".answer_us")


def compare(one: Run, other: Run) -> list[str]:
    shared = [name for name in one.columns if not own(name)]
    assert shared == list(other.columns)
    return [
        name
        for name in shared
        if name not in ("lateness_us", "compute_us")
        and not np.array_equal(one[name], other[name], equal_nan=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "data",
    [can_tree(), can_tree(bitrate=800_000), admittance_tree()],
    ids=["impedance", "slower bus", "admittance"],
)
def test_rows_over_simulated_can_equal_those_of_loopback(data: Tree) -> None:
    over_can = run_rig(data, duration_s=DURATION_S)
    loopback = run_rig(loopback_tree(data), duration_s=DURATION_S)
    assert compare(over_can, loopback) == []
    assert np.ptp(over_can["true.slave.lever.position"]) > 0.1  # it did something


@pytest.mark.slow
def test_the_same_rig_gives_the_same_rows_twice() -> None:
    one, other = (run_rig(can_tree(), duration_s=1.0) for _ in range(2))
    assert np.array_equal(one.table, other.table, equal_nan=True)


@pytest.mark.slow
def test_the_books_close_and_the_difference_to_ideal_drives_is_small() -> None:
    data = can_tree()
    over_can = run_rig(data, duration_s=DURATION_S)
    closed = books(over_can, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow
    assert closed.plant_residual < 1e-9 * closed.plant_flow
    ideal = run_rig(loopback_tree(data, steps=False), duration_s=DURATION_S)
    reported = {}
    for name, limit in (("position", 3e-3), ("velocity", 0.1), ("commanded", 5e-3)):
        for side in ("master", "slave"):
            column = f"{side}.lever.{name}"
            gap = over_can[column] - ideal[column]
            reported[column] = float(np.sqrt(np.mean(gap**2)))
            assert 0.0 < reported[column] < limit, reported
    print("rms difference to drives without steps:", reported)


def test_the_shipped_rig_loads_with_the_steps_of_its_nodes() -> None:
    rig = load_rig(CONFIG)
    axis = rig.axes["slave.lever"]
    assert axis.encoder_quantum == pytest.approx(2 * np.pi / 300_000)
    assert axis.effort_quantum == pytest.approx(5e-4)
