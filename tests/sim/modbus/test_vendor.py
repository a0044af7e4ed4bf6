"""pymodbus' server in front of the simulated drives: what reaches them, and what it responds."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from tautwave_sim.modbus.wire.framing import tcp_frame
from tests.sim.modbus.masters import read, read_write, words, write_many, write_one
from tests.sim.modbus.served import beside

pytest.importorskip("pymodbus.server")

pytestmark = pytest.mark.realtime

FAILURE = 4


class Master:
    """A connection to the server; waits for each response."""

    def __init__(self, port: int) -> None:
        self.sock = socket.create_connection(("127.0.0.1", port), timeout=60.0)

    def ask(self, pdu: bytes, unit: int = 1) -> bytes:
        self.sock.sendall(tcp_frame(7, unit, pdu))
        got = self.sock.recv(4096)
        assert got == tcp_frame(7, unit, got[7:])
        return got[7:]


@contextlib.contextmanager
def served(**simulated: Any) -> Iterator[Master]:
    """Two drives behind the server, and a master."""
    devices = {"unit": 1}, {"unit": 2, "profile": "dsy-rs"}
    with beside(*devices, server="pymodbus", **simulated) as port:
        master = Master(port)
        with master.sock:
            yield master


def test_blocks_are_read_to_their_last_word_and_no_further() -> None:
    with served() as master:
        assert words(master.ask(read(0, 9))) == [0x5457, 1, 1, 0, 0, 0, 0, 0, 0]
        assert words(master.ask(read(43, 2))) == [0, 1000]  # the last value of the table
        for address, count in ((9, 1), (8, 2), (15, 2), (44, 2)):
            assert master.ask(read(address, count)) == bytes([0x83, 2]), (address, count)


def test_what_is_written_is_the_drive_s_to_refuse() -> None:
    with served() as master:
        assert master.ask(write_one(17, 2)) == write_one(17, 2)
        assert master.ask(write_many(34, 500, 0, 1000)) == bytes.fromhex("10 0022 0003")
        assert words(master.ask(read(34, 3))) == [500, 0, 1000]
        assert words(master.ask(read_write(16, 3, 18, 50))) == [0, 2, 50]
        assert master.ask(write_one(17, 9)) == bytes([0x86, 3])
        assert words(master.ask(read(17))) == [2]
        assert master.ask(read(0, 1, function=1)) == bytes([0x81, 1])
        assert master.ask(read(256, 1, function=4), unit=2) == bytes([0x84, 1])  # not this family's


def test_a_drive_that_does_not_respond_is_a_failure_behind_the_server() -> None:
    with served(faults={"request_lost": 1.0}) as master:
        assert master.ask(read(0)) == bytes([0x83, FAILURE])
        assert master.ask(read(0), unit=9) == bytes([0x83, FAILURE])  # nobody
