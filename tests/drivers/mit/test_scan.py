"""`scan mit` over simulated motors, what `new` makes of it, and the bench of a cycle."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave_drivers.mit import plugin
from tautwave_drivers.mit.measure import measure
from tautwave_drivers.mit.options import MitOptions
from tautwave_drivers.mit.scan import ScanOptions, look
from tests.drivers.mit.benches import Rig, motor, simulated


def found(rig: Rig, **options: Any) -> list[dict[str, Any]]:
    before = [dict(one.registers._now) for one in rig.motors]
    rows = look(rig.line.transport, rig.clock, ScanOptions(**options))
    assert [dict(one.registers._now) for one in rig.motors] == before
    assert all(one.state == 0 for one in rig.motors)
    return [dict(row) for row in rows]


def test_every_motor_is_a_row_with_what_a_rig_needs() -> None:
    rows = found(simulated(motor(1), motor(5, feedback_id=0x25, v_max=8.0)))
    assert [(row["id"], row["feedback_id"]) for row in rows] == [(1, 0x11), (5, 0x25)]
    first, second = rows
    assert (first["p_max"], first["v_max"], first["t_max"]) == (12.5, 30.0, 10.0)
    assert second["v_max"] == 8.0
    assert first["firmware"] == "6113.1"
    assert first["watchdog_s"] == 0.0
    assert first["mode"] == "position and velocity"
    assert first["errors"] == "none"


def test_ids_that_are_asked_for_are_the_only_ones() -> None:
    rig = simulated(motor(1), motor(0x45, feedback_id=0x55))
    assert [row["id"] for row in found(rig)] == [1]
    assert [row["id"] for row in found(rig, ids=[0x45])] == [0x45]


def test_what_is_wrong_with_a_motor_is_in_its_row() -> None:
    rig = simulated(
        motor(1),
        motor(2),
        motor(3),
        data_bitrate=5_000_000,
        simulator={"motors": {"1": {"registers": {"7": 0}}, "2": {"registers": {"35": 4}}}},
    )
    rows = found(rig, data_bitrate=5_000_000)
    assert {row["id"]: row["errors"] for row in rows} == {
        1: "MST_ID is 0: give it its own",
        2: "answers in classic CAN",
        3: "none",
    }


def test_two_motors_of_one_id_are_told() -> None:
    rig = simulated(motor(1), motor(2))
    rig.motors[1].registers.put(8, 1)
    rig.motors[1].registers.put(7, 17)
    (row,) = found(rig)
    assert row["errors"] == "2 motors have this id"


def test_what_is_found_becomes_a_bus_of_a_rig() -> None:
    rows = found(
        simulated(motor(1), motor(2), simulator={"motors": {"2": {"registers": {"7": 0}}}})
    )
    assert plugin.survey is not None
    options = ScanOptions(channel="can1")
    (bus,) = plugin.survey.propose(options, rows)
    assert (bus.driver, bus.listed_as) == ("mit", "motors")
    assert bus.options["channel"].value == "can1"
    (device,) = bus.devices
    assert device.options == {
        "id": 1, "feedback_id": 17, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0,
    }  # fmt: skip
    assert device.axis["inertia"].value["value"] == pytest.approx(1.8e-3)
    assert "registers 12 and 20" in device.axis["inertia"].value["source"]
    assert any("motor 2: MST_ID is 0" in note for note in bus.notes)
    MitOptions(motors=(device.options,))  # type: ignore[arg-type]
    assert plugin.survey.propose(options, []) == []


def test_a_cycle_and_its_floor_are_measured() -> None:
    two_motors, two_arms = measure(40)
    for cost in (two_motors, two_arms):
        assert len(cost.spent_us) == len(cost.floor_us) == 40
        assert all(spent > 0.0 for spent in (*cost.spent_us, *cost.floor_us))
    assert two_arms.goal_ratio == 1.5
