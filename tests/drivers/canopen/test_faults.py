"""What goes wrong while running ends in its defined reaction; every case has a seed."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.errors import DriverError
from tautwave.types import AxisCommand, Fault
from tautwave_drivers.canopen.health import Health
from tests.drivers.canopen.benches import Rig, block, driver_options, make, node
from tests.drivers.canopen.faulty import AT_S, CYCLES, ENABLED, TORQUE, leave, started, with_faults


def until_fatal(rig: Rig, cycles: int = CYCLES) -> tuple[list[Fault], int]:
    """Run until a fatal fault; return all faults, and where in the log that cycle began."""
    reported: list[Fault] = []
    for _ in range(cycles):
        at = len(rig.sent)
        rig.cycle(TORQUE)
        reported += rig.driver.faults()
        if any(fault.fatal for fault in reported):
            return reported, at
    raise AssertionError(f"no fatal fault was reported: {reported}")


def zero_from_now_on(rig: Rig, axis: int, at: int) -> None:
    """The axis gets zero effort and is no longer enabled, from the cycle of the fault on."""
    rig.run(5, TORQUE)
    commands = rig.commands(axis, at)
    assert commands
    assert all(target == 0 and word & 0x0F != ENABLED for word, target in commands)


DRIVE_FAULTS = {
    "heartbeat lost": ({"heartbeat_lost_at_s": AT_S}, "heartbeat lost: none for"),
    "reset": ({"resets_at_s": AT_S}, "restarted during the run"),
    "fault": ({"fault_at_s": AT_S, "fault_code": 0x2310}, "continuous overcurrent on the motor"),
    "emergency": ({"emergency_at_s": AT_S, "fault_code": 0x4310}, "EMCY 0x4310: drive too hot"),
    "mode lost": (
        {"mode_lost_at_s": AT_S},
        "changed from CST cyclic synchronous torque to no mode",
    ),
    "voltage": ({"voltage_off_at_s": AT_S}, "left OPERATION ENABLED on its own"),
    "silent": ({"silent_at_s": AT_S}, "heartbeat lost"),
}


@pytest.mark.parametrize(("quirks", "words"), DRIVE_FAULTS.values(), ids=list(DRIVE_FAULTS))
def test_what_happens_to_a_drive_stops_that_axis_in_the_same_cycle(
    quirks: dict[str, Any], words: str
) -> None:
    rig = started(with_faults(quirks=quirks))
    rig.run(20, TORQUE)
    assert rig.commands(1)[-1][1] == 100  # 0.05 of 0.5 N m, per mille
    reported, at = until_fatal(rig)
    fatal = [fault for fault in reported if fault.fatal]
    assert words in fatal[0].text
    assert {fault.axis for fault in fatal} == {"master.a2"}
    zero_from_now_on(rig, 1, at)
    states = rig.cycle(TORQUE)
    assert states[0].valid  # the other axis lives on
    assert rig.commands(0)[-1] == (ENABLED, 100)
    leave(rig)


def test_a_mode_that_is_only_polled_is_missed_by_bit_12_at_once() -> None:
    options = with_faults(quirks={"mode_lost_at_s": AT_S})
    options["nodes"][1]["mapping"] = "lean"
    rig = started(options)
    reported: list[Fault] = []
    for _ in range(CYCLES):
        rig.cycle(TORQUE)
        reported += rig.driver.faults()
        if reported:
            break
    assert "no longer follows the command (bit 12)" in reported[0].text
    reported, at = until_fatal(rig)
    assert "changed from CST cyclic synchronous torque" in reported[-1].text
    zero_from_now_on(rig, 1, at)
    leave(rig)


def test_a_tolerated_emergency_is_reported_and_stops_nothing() -> None:
    quirks = {"emergency_at_s": AT_S, "fault_code": 0x4310}
    rig = started(with_faults(quirks=quirks, tolerated_emergencies=[0x4310]))
    rows, reported = rig.run(CYCLES, TORQUE)
    assert any("EMCY 0x4310" in fault.text for fault in reported)
    assert not any(fault.fatal for fault in reported)
    assert all(state.valid for state in rows[-1])
    leave(rig)


def test_a_queue_that_is_full_for_a_while_is_congested() -> None:
    rig = started(with_faults({"kind": "queue_full", "at_s": AT_S, "duration_s": 0.004}))
    rig.run(round(AT_S * 1e3) - 2, TORQUE)
    reported: list[Fault] = []
    at = len(rig.sent)
    for _ in range(20):
        rig.cycle(TORQUE)
        reported += rig.driver.faults()
    assert [fault.fatal for fault in reported] == [False]
    assert "congested" in reported[0].text
    # What was held back is not sent later: first zero for both, then SYNC, then the present.
    log = [(can_id, data) for _, can_id, data in rig.sent[at:]]
    syncs = [place for place, (can_id, _) in enumerate(log) if can_id == 0x80]
    first = [
        place for place in syncs if log[place - 1][0] == 0x202 and not any(log[place - 1][1][2:4])
    ]
    assert first, log
    rows, _ = rig.run(5, TORQUE)
    assert all(state.valid for state in rows[-1])
    assert rig.commands(0)[-1][1] == 100
    leave(rig)


def test_a_queue_that_drains_within_a_cycle_still_gets_no_command_in_it() -> None:
    rig = started(with_faults())
    rig.run(10, TORQUE)
    begin, at = rig.clock.now_ns(), len(rig.sent)
    rig.port.full = True
    rig.driver.request()
    rig.port.full = False
    assert not any(state.valid for state in rig.driver.read(begin + 700_000))
    rig.driver.write([AxisCommand(TORQUE, 0.0)] * 2)
    assert not rig.commands(0, at)
    rig.clock.sleep_until(begin + 1_000_000)
    rig.run(3, TORQUE)
    assert [target for _, target in rig.commands(0, at)][:2] == [0, 100]
    leave(rig)


def test_a_full_queue_and_silence_is_a_dead_bus() -> None:
    rig = started(with_faults({"kind": "queue_full", "at_s": AT_S}))
    rig.run(round(AT_S * 1e3), TORQUE)
    for device in rig.devices():
        device.beats = False
    reported, _ = until_fatal(rig)
    assert "dead bus: the transmit queue has been full for" in reported[0].text
    rows, _ = rig.run(3, TORQUE)
    assert not any(state.valid for row in rows for state in row)
    rig.driver.close()


@pytest.mark.parametrize(("kind", "words"), [("bus_off", "bus-off"), ("bus_down", "was removed")])
def test_a_bus_that_goes_away_stops_every_axis(kind: str, words: str) -> None:
    rig = started(with_faults({"kind": kind, "at_s": AT_S}))
    reported, _ = until_fatal(rig)
    assert words in next(fault for fault in reported if fault.fatal).text
    rows, _ = rig.run(5, TORQUE)
    assert not any(state.valid for row in rows for state in row)
    rig.driver.close()
    rig.driver.close()
    # the drives' own watchdog has taken the torque away
    rig.world.advance(rig.clock.now_ns() + 200_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


def test_samples_of_the_cycle_in_which_a_bus_is_lost_are_believed_no_more() -> None:
    rig = started(with_faults())
    rows, _ = rig.run(1, TORQUE)
    assert all(state.valid for row in rows for state in row)
    rig.driver._health.lose("gone")
    assert not any(state.valid for state in rig.driver.read(rig.clock.now_ns()))
    rig.driver.close()


def test_error_frames_in_words() -> None:
    rig = started(with_faults())
    rig.port.injected.append((0x20000004, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])))
    _, reported = rig.run(2, TORQUE)
    assert "error passive (transmitting)" in reported[0].text
    assert not reported[0].fatal
    rig.port.injected.append((0x20000040, bytes(8)))
    reported, _ = until_fatal(rig, 3)
    assert "bus-off: the controller has left the bus" in reported[0].text
    rig.driver.close()


def test_the_sync_of_another_master_is_reported_and_stops_nothing() -> None:
    rig = started(with_faults())
    reported = []
    for _ in range(20):
        rig.port.injected.append((0x80, b""))
        reported += rig.run(1, TORQUE)[1]
    texts = [fault.text for fault in reported]
    assert len(texts) == 2  # at the first one, and at the tenth
    assert all("another master is sending SYNC" in text for text in texts)
    assert not any(fault.fatal for fault in reported)
    rig.driver.close()


@pytest.mark.parametrize("interface", ["socketcan", "udp_multicast", "virtual"])
@pytest.mark.parametrize("sync", [True, False])
def test_sync_that_a_port_hears_is_never_its_own(interface: str, sync: bool) -> None:
    """A port drops the echo of what it sent, so what comes is another's on any interface."""
    options = driver_options(
        block(node(1), interface=interface, sync=sync, rpdo="sync" if sync else "event")
    )
    health = Health(options, [], 2_000_000)
    health.take(0x80, b"", 0)
    assert any("another master is sending SYNC" in fault.text for fault in health.faults) == sync


@pytest.mark.parametrize("can_id", [0x181, 0x081, 0x701, 0x581, 0x000, 0x7FF, 0x20000000, 0x1])
def test_no_bytes_raise(can_id: int) -> None:
    rig = started(block(node(1, mapping="lean"), node(2)))
    for size in range(9):
        for value in (0x00, 0xFF, 0x61):
            rig.port.injected.append((can_id, bytes([value] * size)))
            rig.run(2, TORQUE)
    rig.driver.close()


def test_a_node_that_another_master_stops_is_reported() -> None:
    rig = started(with_faults())
    rig.run(5, TORQUE)
    rig.world.transport.send(0, bytes((0x02, 2)))
    reported, at = until_fatal(rig)
    assert "went from NMT operational to stopped" in reported[0].text
    zero_from_now_on(rig, 1, at)
    rig.driver.close()


def test_a_drive_that_no_command_reaches_is_switched_off_before_its_watchdog_is() -> None:
    gone = {"kind": "lost", "can_id": 0x202, "times": 10**6, "at_s": AT_S}
    rig = started(with_faults(gone, quirks={"rpdo_timer": "no_object"}))
    rig.run(CYCLES, TORQUE)
    motor = rig.devices()[1].drive.motor
    assert motor.torque_counts == 100  # the last command that arrived; heartbeats still do
    disarming = bytes.fromhex("2316100100000000")
    seen: list[int] = []
    send = rig.port.send

    def spy(can_id: int, data: bytes) -> bool:
        if (can_id, data) == (0x602, disarming):
            seen.append(motor.torque_counts)
        return send(can_id, data)

    rig.driver._exchange.port.send = spy  # type: ignore[union-attr,method-assign]
    leave(rig)
    assert seen == [0]


def test_a_drive_not_confirmed_off_keeps_its_watchdog() -> None:
    gone = [{"kind": "lost", "can_id": at, "times": 10**6, "at_s": AT_S} for at in (0x202, 0x602)]
    rig = started(with_faults(*gone, quirks={"rpdo_timer": "no_object"}))
    rig.run(CYCLES, TORQUE)
    at = len(rig.sent)
    rig.driver.close()
    assert list(rig.driver.unconfirmed) == ["master.a2"]
    assert "does not respond" in rig.driver.unconfirmed["master.a2"]
    reported = [data for _, can_id, data in rig.sent[at:] if can_id == 0]
    assert reported == [bytes((0x80, 1))]  # node 2 is not taken to where it may watch nobody
    rig.world.advance(rig.clock.now_ns() + 200_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


def test_a_drive_watches_its_master_from_the_moment_it_is_enabled() -> None:
    beats = {"heartbeat_ms": 200, "heartbeat_timeout_ms": 400}
    options = with_faults({"kind": "bus_off", "at_s": 0.01}, quirks={"rpdo_timer": "no_object"})
    rig = started(options | beats)
    rig.run(20, TORQUE)
    assert rig.devices()[1].drive.motor.torque_counts == 100  # no command reaches it any more
    rig.driver.close()
    rig.world.advance(rig.clock.now_ns() + 500_000_000)
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_what_is_no_finite_command_is_zero(value: float, causality: str) -> None:
    rig = make(causality=(causality, causality))
    rig.open_and_enable()
    rig.cycle(TORQUE, TORQUE)
    assert rig.commands(0)[-1][1] != 0
    rig.cycle(value, value)
    assert rig.commands(0)[-1][1] == 0
    leave(rig)


@pytest.mark.parametrize("calls", [0, 1, 2])
def test_an_interface_that_fails_stops_every_axis_and_is_said_once(calls: int) -> None:
    """Whether frames of the last cycle are taken in, or those of this one."""
    rig = started(with_faults())
    rig.run(20, TORQUE)
    receive, left = rig.port.receive, [calls]

    def fail() -> tuple[int, bytes, int] | None:
        left[0] -= 1
        if left[0] < 0:
            raise DriverError("can0 is down")
        return receive()

    rig.port.receive = fail  # type: ignore[method-assign]
    reported, _ = until_fatal(rig)
    assert reported == [Fault("", "can0 is down", fatal=True)]
    rows, reported = rig.run(3, TORQUE)
    assert not any(state.valid for row in rows for state in row)
    assert not reported
    rig.driver.close()
