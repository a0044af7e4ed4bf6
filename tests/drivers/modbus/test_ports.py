"""Real sockets and pseudo-terminals: what fails there is a sentence, and nothing waits."""

from __future__ import annotations

import fcntl
import os
import socket
import struct
import termios
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave_drivers.modbus.line.ports import EpollGroup, TcpPort
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.protocol.frames import read
from tautwave_drivers.modbus.protocol.transaction import Transaction
from tautwave_drivers.serial_port import Parity, SerialPort

CLOCK = MonotonicClock()
RESET = struct.pack("ii", 1, 0)


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as made:
        yield made


def endpoint(listener: socket.socket) -> str:
    return f"tcp://127.0.0.1:{listener.getsockname()[1]}"


def connect(port: TcpPort) -> None:
    until = CLOCK.now_ns() + 5_000_000_000
    while not port.connected() and CLOCK.now_ns() < until:
        CLOCK.sleep_until(CLOCK.now_ns() + 1_000_000)


def test_a_connection_carries_bytes_both_ways(listener: socket.socket) -> None:
    port = TcpPort(endpoint(listener))
    connect(port)
    other, _ = listener.accept()
    with other:
        assert port.read() == b""
        port.write(b"abc")
        assert other.recv(10) == b"abc"
        other.sendall(b"de")
        assert CLOCK.wait(port, CLOCK.now_ns() + 5_000_000_000)
        assert port.read() == b"de"
    port.close()
    port.close()


def test_nobody_listens(listener: socket.socket) -> None:
    where = endpoint(listener)
    listener.close()
    port = TcpPort(where)
    with pytest.raises(DriverError, match=r"connection refused"):
        connect(port)
    port.close()


@pytest.mark.parametrize("abrupt", [True, False])
def test_the_other_end_goes(listener: socket.socket, abrupt: bool) -> None:
    port = TcpPort(endpoint(listener))
    connect(port)
    other, _ = listener.accept()
    if abrupt:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    other.close()
    assert CLOCK.wait(port, CLOCK.now_ns() + 5_000_000_000)
    with pytest.raises(DriverError, match=r"reset by the drive" if abrupt else "closed by"):
        port.read()
    port.close()


def test_a_peer_that_takes_nothing_is_reported(listener: socket.socket) -> None:
    port = TcpPort(endpoint(listener))
    connect(port)
    other, _ = listener.accept()
    reported = ""
    with other:
        for _ in range(1000):
            try:
                port.write(bytes(65536))
            except DriverError as err:
                reported = str(err)
                break
    assert "accepts no more bytes" in reported
    port.close()


def test_a_host_without_name() -> None:
    with pytest.raises(DriverError, match=r"tcp://no.such.host.invalid:502: .*correct endpoint"):
        TcpPort("tcp://no.such.host.invalid:502")


def test_a_link_tells_late_answers_by_their_number_and_comes_back(
    listener: socket.socket,
) -> None:
    where = endpoint(listener)
    link = TcpLink(lambda: TcpPort(where), CLOCK, 1.0)
    until = CLOCK.now_ns() + 5_000_000_000
    while not link.connect() and CLOCK.now_ns() < until:
        CLOCK.sleep_until(CLOCK.now_ns() + 1_000_000)
    other, _ = listener.accept()
    first, second = Transaction(1), Transaction(1)
    first.begin((read(3, 0, 1),))
    link.start((first,))
    asked = other.recv(64)
    link.abandon()
    second.begin((read(3, 0, 1),))
    link.start((second,))
    asked_again = other.recv(64)
    assert asked[:2] != asked_again[:2]
    body = b"\0\0\0\x05\x01\x03\x02"
    other.sendall(asked[:2] + body + b"\0\x07" + asked_again[:2] + body + b"\0\x08")
    while second.pending and CLOCK.now_ns() < until:
        assert link.port is not None
        CLOCK.wait(link.port, until)
        link.pump()
    assert first.responses == []
    assert second.responses == [b"\x03\x02\0\x08"]
    assert link.late == 1
    other.close()
    assert link.port is not None
    CLOCK.wait(link.port, until)
    link.pump()
    assert "closed by the drive" in link.lost
    assert not link.retry()  # not yet
    while not link.retry() and CLOCK.now_ns() < until:
        CLOCK.sleep_until(CLOCK.now_ns() + 10_000_000)
    listener.accept()[0].close()
    assert link.lost == ""
    link.close()


def test_several_connections_are_waited_for_at_once(listener: socket.socket) -> None:
    ports = [TcpPort(endpoint(listener)) for _ in range(2)]
    others = [listener.accept()[0] for _ in range(2)]
    for port in ports:
        connect(port)
    watched = EpollGroup(ports)
    assert not CLOCK.wait(watched, CLOCK.now_ns() + 1_000_000)
    others[1].sendall(b"x")
    assert CLOCK.wait(watched, CLOCK.now_ns() + 5_000_000_000)
    watched.close()
    for one in (*ports, *others):
        one.close()


def test_a_serial_device_carries_bytes_until_it_is_unplugged() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), 115_200, "E")
    os.close(slave)
    assert port.read() == b""
    port.write(b"\x01\x03")
    assert os.read(master, 10) == b"\x01\x03"
    os.write(master, b"\x01\x83")
    assert CLOCK.wait(port, CLOCK.now_ns() + 5_000_000_000)
    assert port.waiting()
    assert port.read() == b"\x01\x83"
    assert not port.waiting()
    os.close(master)
    with pytest.raises(DriverError, match=r"adapter was disconnected|unplugged"):
        port.read()
    port.close()
    assert port.fileno() == -1
    assert port.waiting()  # `read` would raise
    port.close()


def test_a_port_that_is_closed_has_no_descriptor_of_somebody_else() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    port = SerialPort(path, 115_200, "E")
    port.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(port.fileno())
    gone = f"{path}: the adapter was disconnected (Bad file descriptor); plug it in and run again"
    for use in (port.read, lambda: port.write(b"x")):
        with pytest.raises(DriverError) as refused:
            use()
        assert str(refused.value) == gone
    os.close(slave)
    os.close(master)


def test_another_program_that_reads_the_line_is_reported() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), 115_200, "E")
    keys = termios.tcgetattr(slave)
    keys[6][termios.VMIN] = 0  # as pyserial sets it: from then on an empty line reads as closed
    termios.tcsetattr(slave, termios.TCSANOW, keys)
    with pytest.raises(DriverError, match=r"unplugged, .* or another program reads the same line"):
        port.read()
    port.close()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize(("parity", "bits"), [("N", 0), ("E", 0x100), ("O", 0x300)])
@pytest.mark.parametrize(("stop_bits", "second"), [(1, 0), (2, 0x40)])
def test_the_kernel_is_asked_for_a_raw_line_of_these_characters(
    monkeypatch: pytest.MonkeyPatch, parity: Parity, bits: int, stop_bits: int, second: int
) -> None:
    """asm-generic/termbits.h: CS8 0x30, CREAD 0x80, CLOCAL 0x800, BOTHER 0x1000."""
    asked: list[bytes] = []
    ioctl = fcntl.ioctl

    def spy(fd: int, request: int, *argument: Any) -> Any:
        if request == 0x402C542B:  # TCSETS2
            asked.append(argument[0])
        return ioctl(fd, request, *argument)

    master, slave = os.openpty()
    os.write(master, b"of a run before\n")
    monkeypatch.setattr(fcntl, "ioctl", spy)
    port = SerialPort(os.ttyname(slave), 4_500_000, parity, stop_bits)
    assert not port.waiting()  # dropped
    port.set_baud(57_600)
    for packed, baud in zip(asked, (4_500_000, 57_600), strict=True):
        cflag = 0x18B0 | bits | second
        assert struct.unpack_from("=4I", packed) == (0, 0, cflag, 0)
        assert struct.unpack_from("=2I", packed, 36) == (baud, baud)
        assert (packed[17 + termios.VMIN], packed[17 + termios.VTIME]) == (1, 0)
    given = termios.tcgetattr(port.fileno())[2]
    assert given & (termios.CLOCAL | termios.CREAD) == 0x880
    assert given & termios.CSTOPB == second
    port.close()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize("parity", ["E", "O"])
def test_a_pseudo_terminal_is_opened_whatever_the_parity_of_the_line(parity: Parity) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), 115_200, parity, 2)
    port.write(b"\x01")
    assert os.read(master, 10) == b"\x01"
    port.close()
    os.close(slave)
    os.close(master)


def test_a_device_in_use_or_none_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match=r"no such device"):
        SerialPort("/dev/nothing-here", 115_200, "E")
    plain = tmp_path / "file"
    plain.write_text("no device")
    with pytest.raises(DriverError, match=r"is not a serial device"):
        SerialPort(str(plain), 115_200, "E")
    master, slave = os.openpty()
    first = SerialPort(os.ttyname(slave), 115_200, "E")
    with pytest.raises(DriverError, match=r"another program has it open"):
        SerialPort(os.ttyname(slave), 115_200, "E")
    first.close()
    os.close(master)
    os.close(slave)
