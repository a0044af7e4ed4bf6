"""The CANopen driver on a kernel interface, its simulated drives in another process."""

from __future__ import annotations

import json
import os
import select
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tautwave.clock import MonotonicClock
from tautwave.contracts import BusSpec
from tautwave.errors import BusTimeout, DriverError
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.canopen import plugin
from tests.commands import AT_200_HZ, assert_ran_to_its_end
from tests.drivers.canopen import golden
from tests.drivers.canopen.benches import block, bus_of, driver_options, node
from tests.vcan.links import down, netem, tool

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]

MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"
CONFIG = Path(__file__).parents[2] / "configs" / "bench-canopen-vcan.yaml"
RATE_HZ = 50.0  # of the tests that step by hand: a guest kernel is slow
TIMEOUT_MS = 5000
OTHER_PDOS = ("0114", "0214", "0314", "0118", "0218", "0318")


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry)}


@pytest.fixture
def drives() -> Iterator[None]:
    """Two simulated drives on vcan0, in a process of their own."""
    words = ["sim", "canopen", "--nodes", "1,2", "--channel", "vcan0", "--rated-torque", "0.5"]
    command = [sys.executable, "-c", MAIN, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment()) as child:
        try:
            assert child.stdout is not None
            assert json.loads(child.stdout.readline())["endpoint"] == "socketcan:vcan0"
            yield
        finally:
            child.terminate()
            child.wait(20.0)


class Stepped:
    """A driver on vcan0, stepped by hand on the real clock."""

    def __init__(self, *numbers: int, rate_hz: float = RATE_HZ, **more: Any) -> None:
        keys = {"heartbeat_timeout_ms": TIMEOUT_MS, "sdo_timeout_s": 2.0, **more}
        nodes = [node(number, mapping="lean") for number in numbers]
        options = block(*nodes, **keys) | {"interface": "socketcan", "channel": "vcan0"}
        self.bus: BusSpec = bus_of(options, ("impedance",) * len(numbers), rate_hz)
        self.clock = MonotonicClock()
        self.driver: Any = plugin.make(driver_options(options), self.bus, self.clock, None)

    def enable(self) -> None:
        for _ in range(400):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.bus.period_ns)
        raise AssertionError("never enabled")

    def run(self, cycles: int, effort: float = 0.0) -> tuple[list[list[JointState]], list[Fault]]:
        rows, faults = [], []
        for _ in range(cycles):
            begin = self.clock.now_ns()
            self.driver.request()
            rows.append(list(self.driver.read(begin + self.bus.period_ns * 7 // 10)))
            faults += self.driver.faults()
            self.driver.write([AxisCommand(effort, 0.0)] * len(self.bus.axes))
            self.clock.sleep_until(begin + self.bus.period_ns)
        return rows, faults


@contextmanager
def running(*numbers: int, **more: Any) -> Iterator[Stepped]:
    stepped = Stepped(*numbers, **more)
    try:
        stepped.driver.open()
        stepped.enable()
        yield stepped
    finally:
        stepped.driver.close()


MARK = struct.Struct("<IB3x8s")  # struct can_frame
BEGIN, END = "7FF#01", "7FF#02"
"""Frames that mean nothing to anybody."""


@contextmanager
def candump() -> Iterator[list[str]]:
    """Collect the frames on vcan0 as `ID#DATA`; complete when the block has ended.

    Nobody tells when it has begun to listen, or has printed all: frames of the test's own do.
    """
    lines: list[str] = []
    command = [tool("candump"), "-L", "vcan0"]
    with (
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child,
    ):
        assert child.stdout is not None
        bus.bind(("vcan0",))
        begin, end = (MARK.pack(0x7FF, 1, bytes([number])) for number in (1, 2))
        while not select.select([child.stdout], [], [], 0.05)[0]:
            bus.send(begin)
        try:
            yield lines
            bus.send(end)
            for text in child.stdout:
                lines.append(text.split()[2])
                if lines[-1] == END:
                    break
            lines[:] = [frame for frame in lines if frame not in (BEGIN, END)]
        finally:
            child.terminate()


@pytest.mark.parametrize("backend", ["raw", "python-can"])
def test_two_drives_in_another_process_are_brought_up_and_moved(drives: None, backend: str) -> None:
    with running(1, 2, backend=backend) as stepped:
        rows, faults = stepped.run(50, 0.02)
    assert not [fault for fault in faults if fault.fatal]
    valid = [row for row in rows if all(state.valid for state in row)]
    assert len(valid) > 25
    for axis in (0, 1):
        assert valid[-1][axis].position > valid[0][axis].position


def test_candump_sees_the_golden_frames(drives: None) -> None:
    with candump() as lines, running(1) as stepped:
        stepped.run(3)
        stepped.run(3, 0.05)
        stepped.run(3, -0.05)
    reported = [text for text in lines if text.startswith("601#2") and text[6:10] not in OTHER_PDOS]
    expected = golden.set_up(TIMEOUT_MS, round(1e3 / RATE_HZ))
    assert tuple(reported[: len(expected)]) == expected
    assert golden.PRE_OPERATIONAL in lines
    assert golden.START in lines
    rpdos = [text for text in lines if text.startswith("201#")]
    assert tuple(dict.fromkeys(rpdos))[:4] == golden.ENABLING
    cycle = [text for text in lines if text[:3] in ("080", "201")]
    for frames in (golden.CYCLE, golden.CYCLE_BACK):
        assert any(tuple(cycle[at : at + 2]) == frames for at in range(len(cycle))), frames
    assert golden.BEAT in lines
    assert lines[-1].startswith(("000#80", "701#", "702#"))


def test_scan_lists_the_drives_of_another_process(drives: None) -> None:
    words = ["scan", "canopen", "--channel", "vcan0", "--timeout-s", "1.0", "--json"]
    done = subprocess.run(
        [sys.executable, "-c", MAIN, *words], env=environment(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert [(row["node"], row["state"]) for row in rows] == [
        (1, "SWITCH ON DISABLED"),
        (2, "SWITCH ON DISABLED"),
    ]


def test_a_wave_rig_runs_10_s(tmp_path: Path) -> None:
    words = ["run", str(CONFIG), "--out", str(tmp_path / "out"), *AT_200_HZ]
    done = subprocess.run(
        [sys.executable, "-c", MAIN, *words], env=environment(), capture_output=True, text=True
    )
    summary = assert_ran_to_its_end(done.returncode, tmp_path / "out", done.stdout + done.stderr)
    print({key: summary[key] for key in ("cycles", "missed_cycles", "axes", "energy_j")})
    assert summary["cycles"] + summary["missed_cycles"] > 1950  # some slots may pass at the end
    assert summary["cycles"] > 200
    energy = summary["energy_j"]
    assert energy["gross_flow"] > 1e-3
    assert energy["residual"] < 1e-9 * energy["gross_flow"]
    assert not any(axis["faults"] for axis in summary["axes"].values())


def test_frames_that_netem_loses_cost_samples_and_nothing_else(drives: None) -> None:
    with running(1, 2) as stepped:
        stepped.run(10, 0.0)
        with netem("vcan0", "loss", "10%"):
            rows, faults = stepped.run(200, 0.0)
        after, more = stepped.run(30, 0.0)
    lost = sum(not state.valid for row in rows for state in row)
    print(f"{lost} of {2 * len(rows)} samples lost")
    assert 20 < lost < 380  # 76 by the loss alone; a guest's own delays add to them
    assert not [fault for fault in faults + more if fault.fatal]
    assert any(all(state.valid for state in row) for row in after)


def test_a_bus_that_netem_makes_too_slow_is_refused_with_its_time(drives: None) -> None:
    stepped = Stepped(1, 2)
    try:
        with (
            netem("vcan0", "delay", "15ms"),
            pytest.raises(BusTimeout, match=r"responds to SYNC after .* us at best.*lower rate_hz"),
        ):
            stepped.driver.open()
    finally:
        stepped.driver.close()


def test_a_delay_that_sets_in_later_makes_no_old_sample_new(drives: None) -> None:
    """One and a half periods, which a guest that stops for some 20 ms makes no whole number of."""
    with running(1, 2, rate_hz=RATE_HZ / 5.0) as stepped:
        before, _ = stepped.run(10, 0.0)
        with netem("vcan0", "delay", "75ms"):  # and as much back
            rows, _ = stepped.run(20, 0.0)
    assert any(all(state.valid for state in row) for row in before)
    assert sum(state.valid for row in rows[2:] for state in row) <= 4


def test_a_queue_that_nothing_drains_is_a_dead_bus(drives: None) -> None:
    with running(1, 2) as stepped:
        stepped.run(10, 0.0)
        with netem("vcan0", "delay", "100s", "limit", "3"):
            rows, faults = stepped.run(20, 0.0)
        assert "dead bus: the transmit queue has been full" in faults[0].text
        assert faults[0].fatal
        assert not any(state.valid for row in rows[1:] for state in row)


def test_an_interface_torn_down_ends_the_run_with_a_sentence(drives: None) -> None:
    with running(1, 2) as stepped:
        stepped.run(10, 0.0)
        with down("vcan0"):
            rows, faults = stepped.run(5, 0.0)
            assert not any(state.valid for state in rows[-1])
            fatal = [fault for fault in faults if fault.fatal]
            assert "vcan0 is down or gone" in fatal[0].text
            assert len(fatal) == 1
            stepped.driver.close()
            with pytest.raises(DriverError, match="vcan0 is down or gone"):
                stepped.driver.open()
