"""`bench buses` measures on one processor, and leaves the process where it was."""

from __future__ import annotations

import os
import socket
from types import SimpleNamespace

import pytest

from tautwave import registry
from tautwave.bench.buses import buses, one_processor
from tautwave.clock import FakeClock
from tautwave.contracts import CycleCost
from tautwave.errors import DriverError
from tautwave_drivers import cost
from tautwave_drivers.serial_ports import port_names


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinity")
def test_what_is_measured_shares_a_processor_and_lets_go_of_it() -> None:
    before = os.sched_getaffinity(0)
    with one_processor():
        assert len(os.sched_getaffinity(0)) == 1
        assert os.sched_getaffinity(0) <= before
    assert os.sched_getaffinity(0) == before


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinity")
def test_a_measurement_that_fails_lets_go_of_it_as_well() -> None:
    before = os.sched_getaffinity(0)
    with pytest.raises(ValueError, match="in the middle"), one_processor():
        raise ValueError("in the middle")
    assert os.sched_getaffinity(0) == before


def test_each_driver_is_measured_and_named_as_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    spent = [float(n) for n in range(1, 101)]  # n-th of 100 values: the n-th percentile
    costs = {
        "fast": [
            CycleCost("one", spent[::-1], [10.0], goal_us=60.0),
            CycleCost("two", spent, [10.0], goal_ratio=5.0),
        ],
        "mute": [],
        "torn": [CycleCost("three", why_not="no line")],
    }
    asked = []

    def load(name: str) -> SimpleNamespace:
        def measure(cycles: int) -> list[CycleCost]:
            asked.append((name, cycles))
            return costs[name]

        return SimpleNamespace(needs=("no_such",) if name == "bare" else (), measure=measure)

    monkeypatch.setattr(registry, "driver_names", lambda: ["bare", *costs])
    monkeypatch.setattr(registry, "load_driver", load)
    monkeypatch.setattr(registry, "missing_modules", list)
    reported: list[str] = []
    made = buses(cycles=7, tell=reported.append)
    assert reported == ["fast, 7 exchanges", "mute, 7 exchanges", "torn, 7 exchanges"]
    assert asked == [(name, 7) for name in costs]
    assert [table.title for table in made.tables] == ["Bus bare", "Bus fast", "Bus torn"]
    bare, fast, torn = (table.rows for table in made.tables)
    assert bare[0][0] == "bare exchange: no_such is not installed"
    assert fast == [("one", 1.0, 51.0, 100.0, 10.0, 5.1), ("two", 1.0, 51.0, 100.0, 10.0, 5.1)]
    assert torn[0][0] == "three: no line"
    assert [(goal.met, goal.measured) for goal in made.goals] == [(True, 51.0), (False, 5.1)]


@pytest.mark.parametrize("cycles", [1, 4, 5])
def test_two_kinds_of_exchange_are_measured_in_turn(cycles: int) -> None:
    calls: list[str] = []

    def exchange(name: str, time_ns: int) -> int:
        calls.append(name)
        return time_ns

    ours, floor = cost.in_turn(cycles, lambda: exchange("a", 3000), lambda: exchange("b", 2000), 2)
    assert (ours, floor) == ([3.0] * cycles, [2.0] * cycles)
    rounds = 1 + -(-cycles // 2)  # one to warm up
    assert "".join(calls) == rounds * "aabb"


def test_a_bare_exchange_waits_for_the_whole_response_but_not_forever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cost, "LIMIT_NS", 1_000_000)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(bytes(8))
        cost.bare_exchange(ours.fileno(), b"request", 5000)  # no more comes: it ends
        assert theirs.recv(100) == b"request"
        theirs.sendall(bytes(5000))
        cost.bare_exchange(ours.fileno(), b"", 5000)  # read in two pieces
        ours.setblocking(False)
        with pytest.raises(BlockingIOError):
            ours.recv(1)


@pytest.mark.parametrize("tcp", [False, True])
def test_a_responder_answers_a_driver_and_its_floor_alike(tcp: bool) -> None:
    """Over TCP what numbers a request begins its response."""
    made: list[str] = []
    exchange = cost.Exchange(b"\1\2ask", b"reply", tcp)
    whole = b"\1\2reply" if tcp else b"reply"
    heard: list[bytes] = []

    def make(path: str) -> cost.Made:
        if tcp:
            host, port = path.removeprefix("tcp://").split(":")
            link = socket.create_connection((host, int(port)))
            end = link.detach()
        else:
            end = os.open(path, os.O_RDWR | os.O_NOCTTY)

        def ask() -> None:
            os.write(end, exchange.request)
            answer = b""
            while len(answer) < len(whole):
                answer += os.read(end, 100)
            heard.append(answer)

        made.append(path)
        return cost.timed(ask), lambda: os.close(end)

    spent, floor = cost.measured(exchange, make, 3)
    assert len(made) == 1
    assert len(spent) == len(floor) == 3
    assert set(heard) == {whole}
    assert max(floor) < cost.LIMIT_NS * 1e-3  # answered, not timed out


def test_stand_ins_that_miss_a_sample_are_an_error_and_their_work_is_not_timed() -> None:
    log: list[str] = []

    class Driver:
        valid = True

        def request(self) -> None:
            log.append("request")

        def read(self, deadline_ns: int) -> list[SimpleNamespace]:
            log.append("read")
            return [SimpleNamespace(valid=self.valid)]

        def write(self, commands: list[str]) -> None:
            log.append(*commands)

        def faults(self) -> tuple[()]:
            return ()

    driver = Driver()
    cycle = cost.driver_cycle(driver, FakeClock(), ["write"], lambda: log.append("work"))  # type: ignore[arg-type,list-item]
    assert cycle() > 0
    assert log == ["request", "work", "read", "write", "work"]
    driver.valid = False
    with pytest.raises(DriverError, match="a sample is missing"):
        cycle()
    cost.driver_cycle(driver, FakeClock(), ["write"])()  # type: ignore[arg-type,list-item]  # a late process: a long cycle


def test_stand_in_drives_answer_the_canopen_driver() -> None:
    costs = registry.load_driver("canopen").measure(3)  # type: ignore[misc]
    assert [len(cost.spent_us) for cost in costs] == [3, 3]
    assert all(cost.goal_us is not None and not cost.why_not for cost in costs)


def test_serial_ports_are_the_ones_on_usb(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [
        SimpleNamespace(device=device, vid=vid)
        for device, vid in (("/dev/ttyUSB1", 0x0403), ("/dev/ttyS0", None), ("/dev/ttyACM0", 0))
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    assert port_names() == ["/dev/ttyACM0", "/dev/ttyUSB1"]
