"""`tautwave scan feetech` and what `new` makes of it: nothing is written to a servo."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave_drivers.feetech.measure import measure
from tautwave_drivers.feetech.scan import ScanOptions, look
from tautwave_drivers.feetech.survey import survey
from tests.foreign.feetech_line import READ, Line, Servo


def found(*servos: Servo, ids: tuple[int, ...] = (), **more: Any) -> list[dict[str, Any]]:
    line = Line(FakeClock(), *servos)
    for key, value in more.items():
        setattr(line, key, value)
    rows = list(look(line, line.clock, 1_000_000, ids, 1e-3))
    assert {code for _, code, _ in line.sent} <= {1, READ}
    return rows


@pytest.mark.parametrize("echoes", [False, True])
def test_servos_of_every_series_are_told_apart(echoes: bool) -> None:
    rows = found(
        Servo(1, "STS", registers={7: 250, 31: 44, 32: 8}), Servo(4), Servo(9, "SCS"), echoes=echoes
    )
    sts, hls, scs = rows
    assert (sts["series"], sts["model"], sts["return_delay_us"]) == ("STS", "STS3215", 500)
    assert (sts["offset"], sts["mode"], sts["voltage"]) == (-44, "position", 7.4)
    assert (hls["series"], hls["second_id"], hls["errors"]) == ("HLS", 255, "")
    assert (scs["series"], scs["model"]) == ("SCS", "SCS0009")
    assert scs["errors"] == "unknown: no axis runs on it"


def test_two_of_one_id_are_named() -> None:
    rows = found(Servo(2, "STS"), Servo(2, "STS", registers={7: 100}), ids=(2,))
    assert [row["errors"] for row in rows] == ["two servos have this id"]


def test_garbled_answers_are_named() -> None:
    rows = found(Servo(2), ids=(2,), spoil=lambda answer: answer[:-1] + bytes((answer[-1] ^ 1,)))
    assert "garbled" in rows[0]["errors"]


def test_servos_that_know_no_broadcast_ping_are_found_by_their_usual_ids() -> None:
    one = Servo(6)
    line = Line(FakeClock(), one)
    take = line._take
    line._take = lambda at, who, code, data: None if code == 1 else take(at, who, code, data)  # type: ignore[method-assign]
    rows = list(look(line, line.clock, 1_000_000, (), 1e-3))
    assert [row["id"] for row in rows] == [6]


def test_new_writes_a_bus_of_what_can_take_effort() -> None:
    rows = found(
        Servo(1, "STS", registers={7: 250, 31: 30}), Servo(2), Servo(3, "SCS"),
        Servo(5, registers={3: 9, 4: 11}),
    )  # fmt: skip
    (bus,) = survey.propose(ScanOptions(port="/dev/ttyACM0"), rows)
    assert [device.options["model"] for device in bus.devices] == ["STS3215", "HLS3625"]
    assert bus.devices[0].options["offset"] == 30
    assert bus.options["return_delay_s"].value == pytest.approx(500e-6)
    assert bus.options["power_cut"].value == "TODO"
    damping = bus.devices[0].axis["damping"].value
    assert damping["value"] == pytest.approx(0.61)  # 0.059 and a back-EMF of 0.546
    assert any("id 3" in note for note in bus.notes)
    assert any("id 5" in note and "torque constant" in note for note in bus.notes)


@pytest.mark.slow
def test_the_hosts_cost_is_measured_over_a_pty() -> None:
    (cost,) = measure(40)
    assert len(cost.spent_us) == len(cost.floor_us) == 40
