"""Software of others drives the simulated servos on a pseudo-terminal and takes them for real.

dynamixel-sdk (ROBOTIS) and rustypot (Pollen Robotics), neither of which shares a line with us. It
runs in real time: nothing here asserts how fast, only that the wire is not too fast.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import rustypot
from dynamixel_sdk import (
    COMM_RX_CORRUPT,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    GroupBulkRead,
    GroupBulkWrite,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

pytestmark = pytest.mark.realtime

TIOCGEXCL = 0x80045440  # asm-generic/ioctls.h
COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main()", "sim", "dynamixel"]


@contextmanager
def served(*options: str) -> Iterator[dict[str, Any]]:
    """Run `tautwave sim dynamixel`; give what it announces."""
    child = subprocess.Popen([*COMMAND, *options], stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None
        yield json.loads(child.stdout.readline())
    finally:
        child.terminate()
        rest, _ = child.communicate(timeout=60)
    assert rest == b""
    assert child.returncode == 0


@pytest.fixture(scope="module")
def device() -> Iterator[str]:
    with served("--model", "XL330-M288", "--ids", "1,2") as found:
        assert found["driver"] == "dynamixel"
        assert found["models"] == {"1": "XL330-M288", "2": "XL330-M288"}
        assert found["options"] == {"port": found["endpoint"]}
        yield str(found["endpoint"])


@contextmanager
def sdk(device: str, protocol: float = 2.0, baud: int = 1_000_000) -> Iterator[Any]:
    port = PortHandler(device)
    assert port.openPort()
    assert port.setBaudRate(baud)
    try:
        yield port, PacketHandler(protocol)
    finally:
        port.closePort()


def until(what: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def patient(ask: Callable[[], Any]) -> Any:
    """Ask again after a timeout: this machine may be busy, and the SDK waits 34 ms at most."""
    for _ in range(20):
        response = ask()
        if (response[-2] if isinstance(response, tuple) else response) == COMM_SUCCESS:
            return response
    return response


def test_sdk_ping_and_broadcast_ping(device: str) -> None:
    with sdk(device) as (port, packets):
        assert patient(lambda: packets.ping(port, 1)) == (1200, COMM_SUCCESS, 0)
        assert packets.ping(port, 9)[1] == COMM_RX_TIMEOUT
        found, result = packets.broadcastPing(port)
        assert (found, result) == ({1: [1200, 53], 2: [1200, 53]}, COMM_SUCCESS)


def test_sdk_moves_a_servo_and_reads_it_in_every_way(device: str) -> None:
    with sdk(device) as (port, packets):
        for one in (1, 2):
            patient(partial(packets.write1ByteTxRx, port, one, 64, 0))
            for at, value in ((11, 3), (64, 1)):
                written = patient(partial(packets.write1ByteTxRx, port, one, at, value))
                assert written == (COMM_SUCCESS, 0)
        goals = GroupSyncWrite(port, packets, 116, 4)
        for one, goal in ((1, 2500), (2, 1500)):
            assert goals.addParam(one, list(goal.to_bytes(4, "little")))
        assert goals.txPacket() == COMM_SUCCESS
        group = GroupSyncRead(port, packets, 132, 4)
        assert group.addParam(1)
        assert group.addParam(2)

        def there() -> bool:
            if group.txRxPacket() != COMM_SUCCESS:
                return False
            here = [group.getData(one, 132, 4) for one in (1, 2)]
            return abs(here[0] - 2500) <= 2 and abs(here[1] - 1500) <= 2

        until(there)
        assert patient(group.fastSyncRead) == COMM_SUCCESS
        assert group.getData(1, 132, 4) == pytest.approx(2500, abs=2)
        bulk = GroupBulkRead(port, packets)
        assert bulk.addParam(1, 132, 4)
        assert bulk.addParam(2, 144, 2)
        assert patient(bulk.txRxPacket) == COMM_SUCCESS
        assert bulk.getData(2, 144, 2) == 50
        assert patient(bulk.fastBulkRead) == COMM_SUCCESS
        assert bulk.getData(1, 132, 4) == pytest.approx(2500, abs=2)
        lamps = GroupBulkWrite(port, packets)
        assert lamps.addParam(1, 65, 1, [1])
        assert lamps.addParam(2, 65, 1, [1])
        assert lamps.txPacket() == COMM_SUCCESS
        assert patient(lambda: packets.read1ByteTxRx(port, 2, 65))[0] == 1


def test_sdk_sees_errors_and_reboots(device: str) -> None:
    with sdk(device) as (port, packets):
        patient(partial(packets.write1ByteTxRx, port, 1, 64, 1))
        result, error = patient(partial(packets.write1ByteTxRx, port, 1, 11, 1))
        assert (result, packets.getRxPacketError(error)) == (
            COMM_SUCCESS,
            packets.getRxPacketError(7),
        )
        assert patient(partial(packets.regWriteTxRx, port, 1, 65, 1, [0])) == (COMM_SUCCESS, 0)
        assert packets.action(port, 0xFE) == COMM_SUCCESS
        assert patient(lambda: packets.read1ByteTxRx(port, 1, 65))[0] == 0
        assert packets.reboot(port, 1) == (COMM_SUCCESS, 0)
        until(lambda: packets.ping(port, 1)[1] == COMM_SUCCESS)
        assert patient(lambda: packets.read1ByteTxRx(port, 1, 64))[0] == 0


def test_sdk_resets_a_servo_to_factory_settings(device: str) -> None:
    with sdk(device) as (port, packets):
        patient(lambda: packets.write1ByteTxRx(port, 2, 64, 0))
        patient(lambda: packets.write1ByteTxRx(port, 2, 9, 10))
        assert patient(lambda: packets.read1ByteTxRx(port, 2, 9))[0] == 10
        result, error = packets.factoryReset(port, 2, 0x02)
        assert result in (COMM_SUCCESS, COMM_RX_TIMEOUT)  # late on a busy machine
        assert error == 0
        until(lambda: packets.ping(port, 2)[1] == COMM_SUCCESS)
        assert patient(lambda: packets.read1ByteTxRx(port, 2, 9))[0] == 250


def test_the_baud_rate_is_heard(device: str) -> None:
    with sdk(device, baud=57_600) as (port, packets):
        assert packets.ping(port, 1)[1] == COMM_RX_TIMEOUT
    with sdk(device) as (port, packets):
        assert patient(lambda: packets.ping(port, 1))[1] == COMM_SUCCESS


def test_an_exclusive_client_locks_nobody_out_for_ever(device: str) -> None:
    """The simulator holds the device open too, so that closing it would not undo TIOCEXCL."""
    fd = os.open(device, os.O_RDWR | os.O_NOCTTY)
    try:
        fcntl.ioctl(fd, termios.TIOCEXCL)
        until(lambda: fcntl.ioctl(fd, TIOCGEXCL, bytes(4)) == bytes(4))
    finally:
        os.close(fd)


@pytest.mark.slow
def test_the_wire_is_not_faster_than_its_baud_rate() -> None:
    """57 600 baud, 10 + 14 bytes and 0.5 ms: no ping takes less than 4.6 ms."""
    with (
        served("--ids", "1", "--baud", "57600") as found,
        sdk(found["endpoint"], baud=57_600) as (port, packets),
    ):
        results = []
        for _ in range(20):
            begin = time.monotonic()
            results.append(packets.ping(port, 1)[1])
            took = time.monotonic() - begin
            assert took >= 24 * 10 / 57_600 + 0.5e-3
            if len(results) >= 5 and COMM_SUCCESS in results:
                break
        # A host that stalls: the SDK calls a timeout in the middle of a response corrupt.
        assert set(results) <= {COMM_SUCCESS, COMM_RX_TIMEOUT, COMM_RX_CORRUPT}
        assert COMM_SUCCESS in results


@pytest.mark.slow
def test_rustypot_reads_and_moves(device: str) -> None:
    servos = rustypot.Xl330PyController(device, 1_000_000, 5.0)
    try:
        assert servos.ping(1)
        assert servos.scan([1, 2]) == {1: 1200, 2: 1200}
        servos.write_torque_enable(1, False)
        servos.write_operating_mode(1, 3)
        servos.write_torque_enable(1, True)
        servos.sync_write_goal_position([1], [0.5])
        until(lambda: abs(servos.sync_read_present_position([1])[0] - 0.5) < 0.005)
        values, error = servos.read_raw_data_with_error(1, 144, 2)
        assert (list(values), error) == ([50, 0], 0)
        assert len(servos.sync_read_raw_data_with_error([1, 2], 126, 10)) == 2
        assert servos.reboot(1)
        time.sleep(0.3)
        until(lambda: servos.ping(1))
    finally:
        servos.close()
    hasty = rustypot.Xl330PyController(device, 1_000_000, 0.2)
    try:
        assert not hasty.ping(77)
    finally:
        hasty.close()


def test_rustypot_gets_negative_values_that_need_stuffing(device: str) -> None:
    """-131073 is FF FF FD FF on the wire, and -1 beside FD makes the same pattern."""
    servos = rustypot.Xl330PyController(device, 1_000_000, 5.0)
    try:
        servos.write_torque_enable(2, False)
        servos.write_operating_mode(2, 4)
        for counts in (-131073, -513, -1, -196609):
            raw = list((counts & 0xFFFFFFFF).to_bytes(4, "little"))
            servos.write_raw_data(2, 116, raw)
            assert list(servos.read_raw_data(2, 116, 4)) == raw
    finally:
        servos.close()


@pytest.mark.slow
def test_protocol_1_by_sdk_and_rustypot() -> None:
    with served("--model", "AX-12A", "--ids", "3") as found:
        with sdk(found["endpoint"], 1.0) as (port, packets):
            assert patient(lambda: packets.ping(port, 3))[1:] == (COMM_SUCCESS, 0)
            assert patient(partial(packets.write1ByteTxRx, port, 3, 24, 1)) == (COMM_SUCCESS, 0)
            assert patient(partial(packets.write2ByteTxRx, port, 3, 30, 600)) == (COMM_SUCCESS, 0)
            until(lambda: abs(packets.read2ByteTxRx(port, 3, 36)[0] - 600) <= 1)
        old = rustypot.AxPyController(found["endpoint"], 1_000_000, 5.0)
        try:
            assert old.ping(3)
            until(lambda: abs(old.read_raw_present_position(3)[0] - 600) <= 1)
            old.write_goal_position(3, 0.0)
            until(lambda: abs(old.read_present_position(3)[0]) < math.radians(1.0))
        finally:
            old.close()


@pytest.mark.slow
def test_a_link_survives_an_unplugged_adapter(tmp_path: Path) -> None:
    link = tmp_path / "servos"
    seen = (seen_unplugged(link, at_s) for at_s in (1.5, 5.0, 20.0))  # a host may be held up
    assert next(filter(None, seen), False)


def seen_unplugged(link: Path, at_s: float) -> bool:
    """Return whether the adapter was seen there, then gone; it has to be back after that."""
    events = [{"kind": "unplug", "at_s": at_s}, {"kind": "replug", "at_s": at_s + 0.5}]
    faults = json.dumps({"events": events})

    def pinged() -> int | None:
        try:
            with sdk(str(link)) as (port, packets):
                return int(packets.ping(port, 1)[1])
        except (OSError, termios.error):  # as from a real adapter
            return None

    opened = gone = False
    with served("--link", str(link), "--faults", faults) as found:
        assert found["endpoint"] == str(link)
        end = time.monotonic() + at_s + 5.0
        try:
            with sdk(str(link)) as (port, packets):
                opened = True
                while not gone and time.monotonic() < end:
                    gone = packets.ping(port, 1)[1] not in (COMM_SUCCESS, COMM_RX_TIMEOUT)
        except (OSError, termios.error):  # which is no OSError
            gone = opened
        until(lambda: pinged() == COMM_SUCCESS)
    assert not link.exists()
    return gone
