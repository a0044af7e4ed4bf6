"""Trouble that cannot be looked into: a servo's alert unread, a line lost in the last moment."""

from __future__ import annotations

import pytest

from tautwave.errors import DriverError
from tautwave.types import Fault
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, status_text
from tests.drivers.dynamixel.parts import Bench, bench, spec

TORQUE_ENABLE = 64


def enabled() -> Bench:
    made = bench(spec(1), spec(2))
    made.enable()
    made.cycle(0.1, 0.1)
    return made


def test_an_alert_whose_reason_cannot_be_read_ends_the_run_all_the_same() -> None:
    made = enabled()
    servo = made.world.servos[1]
    read = servo.memory.read
    servo.memory.read = lambda at, size: None if at == TORQUE_ENABLE else read(at, size)
    servo.fail(2)
    faults: list[Fault] = []
    for _ in range(8):
        made.cycle(0.1, 0.1)
        faults += made.driver.faults()
    [fault] = faults
    assert (fault.axis, fault.fatal) == ("master.a2", True)
    unread = "servo 2: torque enable and hardware error status cannot be read: "
    assert fault.text.startswith(unread), fault.text
    made.driver.close()


def test_torque_that_may_still_be_on_is_said_on_leaving(monkeypatch: pytest.MonkeyPatch) -> None:
    made = enabled()

    def broken(data: bytes) -> None:
        raise DriverError("/dev/ttyUSB0: the adapter was disconnected")

    monkeypatch.setattr(made.world.transport, "write", broken)
    made.driver.close()
    assert made.driver.unconfirmed == dict.fromkeys(
        (axis.name for axis in made.bus.axes), "/dev/ttyUSB0: the adapter was disconnected"
    )


def test_errors_in_words_are_those_of_the_e_manual_or_numbers() -> None:
    """E-manual: Hardware Error Status (70); in protocol 2.0 bit 7 of an error is the alert."""
    assert hardware_text(0) == "no hardware error"
    assert hardware_text(0x24) == "overheated and overloaded for too long"
    assert hardware_text(0x80) == "hardware error bit 7"
    assert hardware_text(0x20, shutdown=0x34).endswith("its torque is off until it is rebooted")
    assert "its torque stays on (Shutdown(63) does not" in hardware_text(0x01, shutdown=0x34)
    assert status_text(0) == status_text(0x80) == "no error"
    assert status_text(0x84) == status_text(4) != status_text(5)
    assert status_text(0x7F) == "error number 127"
