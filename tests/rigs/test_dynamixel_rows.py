"""A rig on simulated servos gives the rows of a rig on loopback with the servos' steps and delay.

On the fake clock, over the bytes of the whole protocol: positions, waves, efforts and the truth of
every slot are the same numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tautwave.config import Rig
from tests.rigs.running import Tree, books, rig_of, run_rig, tree

QUANTUM = 2.0 * np.pi / 4096.0
REFERENCE = {
    "type": "minimum_jerk",
    "waypoints": [[0.05, 0.0], [0.35, 0.4], [0.6, 0.4], [0.85, -0.3], [1.1, 0.1]],
}


def axis(bus: str, device_id: int, causality: str = "impedance") -> Tree:
    made: Tree = {
        "bus": bus, "id": device_id, "kind": "rotary", "causality": causality,
        "effort_limit": 0.5, "effort_rate_limit": 500.0, "velocity_limit": 8.0,
        "position_range": [-1.5, 1.5],
    }  # fmt: skip
    if causality == "impedance":
        made["inertia"] = {"value": 9e-3, "lower": 6e-3, "source": "test"}
        made["damping"] = {"value": 0.05, "lower": 0.03, "source": "test"}
    return made


def servos(*devices: Tree, **more: Any) -> Tree:
    options = {"port": "sim", "baud": 4_000_000, "servos": list(devices), **more}
    return {"driver": "dynamixel", "options": options}


def rig_tree(buses: Tree, master: Tree, slave: Tree, **changes: Any) -> Tree:
    impedance = slave["causality"] == "impedance"
    return tree(
        {
            "duration_s": 1.2,
            "rate_hz": 1000.0,
            "buses": buses,
            "master.axes.a": master,
            "slave.axes.a": slave,
            "coupling.delay_s": 0.004,
            "coupling.pairs.a.wave_filter_hz": 100.0,
            "coupling.pairs.a.wave_impedance": 0.1,
            "simulation": {
                "axes": {
                    "master.a": {"inertia": 8e-3, "damping": 0.04, "coulomb": 0.01},
                    "slave.a": {"inertia": 1.1e-2, "damping": 0.06, "coulomb": 0.02}
                    if impedance
                    else {"velocity_time_constant_s": 0.004},
                },
                "hand": {"a": {"lever_arm": 0.1, "reference": REFERENCE}},
                "environment": {
                    "a": {"type": "wall", "position": 0.2, "stiffness": 6.0, "damping": 0.005}
                    if impedance
                    else {"type": "spring", "position": 0.0, "stiffness": 1.0}
                },
            },
            **changes,
        }
    )


def on_loopback(rig: Rig, data: Tree) -> Tree:
    """The same rig on loopback buses, its steps written out as the servos' options made them."""
    delay = {"driver": "loopback", "options": {"command_delay_s": 1.0 / rig.rate_hz}}
    out = tree({"buses": dict.fromkeys(data["buses"], delay)}, base=data)
    for side, axes in (("master", rig.master.axes), ("slave", rig.slave.axes)):
        for name, one in axes.items():
            for step in ("encoder_quantum", "effort_quantum", "velocity_quantum"):
                out[side]["axes"][name][step] = getattr(one, step)
    return out


ONE, TWO = {"id": 1, "model": "XM430-W350"}, {"id": 2, "model": "XL330-M288"}
RIGS: dict[str, Tree] = {
    "one line": rig_tree({"line": servos(ONE, TWO)}, axis("line", 1), axis("line", 2)),
    "fast": rig_tree(
        {"line": servos(ONE, TWO, read="fast_sync")}, axis("line", 1), axis("line", 2)
    ),
    "two lines": rig_tree(
        {"hand": servos(ONE), "arm": servos(TWO, status_block=True)},
        axis("hand", 1),
        axis("arm", 2),
    ),
    "mirrored": rig_tree(
        {
            "line": servos(
                {**ONE, "direction": -1, "gear_ratio": 1.5, "torque_constant": 1.6},
                {**TWO, "direction": -1, "zero_counts": 100},
                return_delay_s=20e-6,
            )
        },
        axis("line", 1),
        axis("line", 2),
    ),
    "admittance": rig_tree(
        {"line": servos(ONE, {**TWO, "direction": -1})},
        axis("line", 1),
        axis("line", 2, "admittance"),
    ),
}


@pytest.mark.sparse(8)
@pytest.mark.parametrize("name", RIGS)
def test_the_rows_are_those_of_loopback(name: str) -> None:
    data = RIGS[name]
    rig = rig_of(data)
    over_bytes = run_rig(rig)
    loopback = run_rig(on_loopback(rig, data))
    assert over_bytes.result.cycles == loopback.result.cycles == 1200
    assert sum(over_bytes.result.lost) == 0
    compared = [column for column in loopback.columns if column not in ("compute_us", "time_s")]
    for column in compared:
        assert np.array_equal(over_bytes[column], loopback[column]), column
    assert any(column.startswith("true.") for column in compared)
    # The hand has moved the slave, and steps are servo steps.
    slave = over_bytes["slave.a.position"]
    assert slave.max() > 0.1
    step = rig.slave.axes["a"].encoder_quantum
    assert np.allclose(slave / step, np.round(slave / step), atol=1e-6)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("name", ["one line", "admittance"])
def test_the_books_close(name: str) -> None:
    run = run_rig(RIGS[name])
    closed = books(run)
    assert closed.gross_flow > 1e-3
    assert closed.residual < 1e-9 * closed.gross_flow
    assert closed.plant_residual < 1e-9 * closed.plant_flow


@pytest.mark.slow
def test_a_servo_with_another_step_has_other_rows() -> None:
    """The comparison above can fail."""
    data = RIGS["one line"]
    rig = rig_of(data)
    other = on_loopback(rig, data)
    other["slave"]["axes"]["a"]["encoder_quantum"] *= 1.01
    assert not np.array_equal(run_rig(rig)["slave.a.position"], run_rig(other)["slave.a.position"])
