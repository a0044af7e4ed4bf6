"""The buses that `.ci/vcan` makes are real: other sockets, other programs, netem, going down."""

from __future__ import annotations

import errno
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from tests.vcan.links import down, netem, tool

pytestmark = pytest.mark.vcan

FRAME = struct.Struct("<IB3x8s")  # struct can_frame: identifier, length, padding, data
SENT = FRAME.pack(0x123, 8, bytes.fromhex("1122334455667788"))

Open = Callable[[str], socket.socket]


@pytest.fixture
def raw() -> Iterator[Open]:
    with ExitStack() as stack:

        def opened(interface: str) -> socket.socket:
            bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            stack.enter_context(bus)
            bus.bind((interface,))
            bus.settimeout(2.0)
            return bus

        yield opened


def test_a_frame_goes_from_socket_to_socket_and_stays_on_its_bus(raw: Open) -> None:
    sender, receiver, elsewhere = raw("vcan0"), raw("vcan0"), raw("vcan1")
    sender.send(SENT)
    assert receiver.recv(FRAME.size) == SENT
    for nothing in (sender, elsewhere):  # neither to oneself nor to the other bus
        nothing.setblocking(False)
        with pytest.raises(BlockingIOError):
            nothing.recv(FRAME.size)


def test_python_can_and_a_raw_socket_understand_each_other(raw: Open) -> None:
    can = pytest.importorskip("can")
    other = raw("vcan0")
    with can.Bus("vcan0", interface="socketcan") as bus:
        bus.send(can.Message(arbitration_id=0x123, data=SENT[8:], is_extended_id=False))
        # python-can also fills len8_dlc, which is padding to us
        assert FRAME.unpack(other.recv(FRAME.size)) == FRAME.unpack(SENT)
        other.send(FRAME.pack(0x7FF, 3, b"abc"))
        message = bus.recv(2.0)
    assert (message.arbitration_id, bytes(message.data)) == (0x7FF, b"abc")
    assert not message.is_extended_id


def test_candump_reads_what_is_sent(raw: Open) -> None:
    bus = raw("vcan0")
    command = [tool("candump"), "-L", "-n", "1", "vcan0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as candump:
        while candump.poll() is None:  # nobody tells when it has begun to listen
            bus.send(SENT)
            time.sleep(0.02)
        assert candump.stdout is not None
        assert candump.stdout.read().split()[1:] == ["vcan0", "123#1122334455667788"]


def test_what_cangen_sends_is_read(raw: Open) -> None:
    bus = raw("vcan1")
    frame = ["-I", "123", "-L", "8", "-D", "1122334455667788"]
    subprocess.run([tool("cangen"), "vcan1", "-n", "1", *frame], check=True, timeout=10)
    assert bus.recv(FRAME.size) == SENT


def test_a_bus_that_goes_down_refuses_frames_and_comes_back(raw: Open) -> None:
    sender, receiver = raw("vcan1"), raw("vcan1")
    with down("vcan1"):
        for end in (sender, receiver):
            with pytest.raises(OSError, match="down") as refused:
                end.send(SENT)
            assert refused.value.errno == errno.ENETDOWN
    sender.send(SENT)
    assert receiver.recv(FRAME.size) == SENT


def test_netem_delays_what_local_sockets_receive(raw: Open) -> None:
    sender, receiver = raw("vcan1"), raw("vcan1")
    with netem("vcan1", "delay", "30ms"):
        begun = time.monotonic_ns()
        sender.send(SENT)
        assert receiver.recv(FRAME.size) == SENT
        assert time.monotonic_ns() - begun >= 30_000_000


def test_netem_loses_what_it_is_asked_to(raw: Open) -> None:
    sender, receiver = raw("vcan1"), raw("vcan1")
    with netem("vcan1", "loss", "100%"):
        sender.send(SENT)
    sender.send(
        FRAME.pack(0x124, 0, b"")
    )  # buses keep the order: had the first come, it came first
    assert FRAME.unpack(receiver.recv(FRAME.size))[0] == 0x124
