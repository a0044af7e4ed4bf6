"""A line on a pseudo-terminal: bytes and baud rates of another program, unplugging, the end."""

from __future__ import annotations

import fcntl
import os
import select
import termios
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tautwave.errors import DriverError
from tautwave_drivers.serial_port import SerialPort
from tautwave_sim.wire.pty import Pty, serve_line
from tautwave_sim.wire.serial import SerialLine, Transmission

IDLE_NS = 100_000_000
"""An idle line looks ten times a second whether it shall end."""


class StepClock:
    """Time passes by waiting only; what is waited for is written down."""

    def __init__(self) -> None:
        self.time_ns = 5_000_000_000
        self.waited: list[tuple[str, int]] = []

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_until(self, deadline_ns: int) -> None:
        self.waited.append(("sleep", deadline_ns - self.time_ns))
        self.time_ns = deadline_ns

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        self.waited.append(("wait", deadline_ns - self.time_ns))
        ready, _, _ = select.select([transport], [], [], 0.0)
        if not ready:
            self.time_ns = deadline_ns
        return bool(ready)


class Device:
    """Answers `ask` 3 ms after its last byte."""

    def __init__(self, line: SerialLine) -> None:
        self.line = line
        self.heard: list[tuple[bytes, int]] = []
        line.listener = self

    def hear(self, sent: Transmission) -> None:
        self.heard.append((bytes(sent.data), sent.baud))
        self.line.respond(b"answer", sent.end_ns + 3_000_000, sent.baud)


def serve(line: SerialLine, link: Path | None, *steps: Callable[[str], None]) -> StepClock:
    """Serve a line for as many turns as there are steps, each done before its turn."""
    clock, left = StepClock(), list(steps)
    told: list[str] = []

    def stopped() -> bool:
        if left:
            left.pop(0)(told[0])
            return False
        return True

    serve_line(line, told.append, stopped, link, clock)  # type: ignore[arg-type]
    assert len(told) == 1
    return clock


def nothing(_: str) -> None:
    """Let a turn pass."""


def test_another_program_asks_at_its_baud_rate_and_gets_its_answer() -> None:
    line = SerialLine(9600)
    device = Device(line)
    opened: list[SerialPort] = []

    def ask(path: str) -> None:
        opened.append(SerialPort(path, 50_000))
        opened[0].write(b"ask")

    def listen(_: str) -> None:
        assert opened[0].read() == b""

    def take(_: str) -> None:
        assert opened[0].read() == b"answer"

    clock = serve(line, None, ask, listen, listen, nothing, take)
    assert device.heard == [(b"ask", 50_000)]
    # At once; 3 characters of 0.2 ms and 3 ms; 6 characters; then nothing is to come.
    idle = ("wait", IDLE_NS)
    assert clock.waited == [idle, ("wait", 3_600_000), ("wait", 1_200_000), idle, idle]
    with pytest.raises(DriverError, match=r"disconnected|unplugged"):
        opened[0].read()
    opened[0].close()


def test_a_program_that_has_ended_leaves_the_line_to_the_next() -> None:
    """A terminal is exclusive until nobody has it open, and here one end always is."""
    found: list[int] = []

    def open_close(path: str) -> None:
        SerialPort(path, 57_600).close()

    def look(path: str) -> None:
        port = os.open(path, os.O_RDWR | os.O_NOCTTY)
        held = fcntl.ioctl(port, 0x80045440, bytes(4))  # TIOCGEXCL
        found.append(int.from_bytes(held, "little"))
        assert termios.tcgetattr(port)[3] & (termios.ECHO | termios.ICANON) == 0
        os.close(port)

    serve(SerialLine(57_600), None, look, open_close, look)
    assert found == [0, 0]


def test_a_line_that_is_plugged_in_again_is_found_by_its_link(tmp_path: Path) -> None:
    line, link = SerialLine(57_600), tmp_path / "line"
    paths: list[str] = []
    opened: list[SerialPort] = []

    def unplug(path: str) -> None:
        assert path == str(link)
        paths.append(os.readlink(link))
        opened.append(SerialPort(path, 57_600))
        line.unplug()

    def pulled(_: str) -> None:
        with pytest.raises(DriverError, match=r"disconnected|unplugged"):
            opened[0].read()
        assert os.readlink(link) == paths[0]

    def plug(_: str) -> None:
        line.plugged = True

    def again(path: str) -> None:
        opened.append(SerialPort(path, 57_600))
        assert opened[1].read() == b""
        paths.append(os.readlink(link))

    clock = serve(line, link, nothing, unplug, pulled, plug, again)
    assert [what for what, _ in clock.waited] == ["wait", "sleep", "sleep", "wait", "wait"]
    assert {span for _, span in clock.waited} == {IDLE_NS}
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(DriverError, match=r"disconnected|unplugged"):
        opened[1].read()  # it has ended
    for port in opened:
        port.close()


@pytest.mark.parametrize("plugged", [True, False])
def test_serving_ends_with_nothing_left_open(tmp_path: Path, plugged: bool) -> None:
    line, link = SerialLine(57_600), tmp_path / "line"

    def pull(_: str) -> None:
        if not plugged:
            line.unplug()

    before = len(os.listdir("/proc/self/fd"))
    serve(line, link, pull, nothing)
    assert len(os.listdir("/proc/self/fd")) == before
    assert list(tmp_path.iterdir()) == []


def test_no_more_pseudo_terminals_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> tuple[int, int]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "openpty", refuse)
    with pytest.raises(DriverError) as refused:
        Pty()
    reported = "no pseudo-terminal: No space left on device; close some programs"
    assert str(refused.value) == reported


def test_a_pseudo_terminal_never_blocks_and_loses_what_nobody_reads() -> None:
    pty = Pty()
    assert pty.read() == b""
    other = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    every = bytes(range(256))
    os.write(other, every)
    assert pty.read() == every
    pty.write(every)
    assert os.read(other, 1000) == every
    for _ in range(300):
        pty.write(every)
    pty.close()
    pty.close()
    assert pty.read() == b""
    os.close(other)
