"""Delay as measured, DCF files, the command line, and what a cycle costs being measured at all."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.clock import MonotonicClock
from tautwave.errors import ConfigError, DeviceFault, DriverError
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.canopen import plugin
from tautwave_drivers.canopen.measure import (
    SocketEnd,
    _driver,
    bare_cycle,
    enabled_cycle,
    measure,
)
from tautwave_sim.canopen.dictionary import Entry
from tests.commands import PATIENT, assert_ran_to_its_end
from tests.drivers.canopen.benches import block, make, node
from tests.drivers.canopen.foreign import foreign
from tests.rigs.running import books, run_rig
from tests.rigs.test_canopen_rows import can_tree

CONFIG = Path(__file__).parents[3] / "configs" / "bench-canopen-virtual.yaml"
MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"

EDS = """
[FileInfo]
FileName=test.dcf
[DeviceInfo]
VendorName=test
NodeID=1
[Comments]
Lines=0
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
[OptionalObjects]
SupportedObjects=2
1=0x6065
2=0x6071
[6065]
ParameterName=Following error window
ObjectType=0x7
DataType=0x0007
AccessType=rw
ParameterValue=777
[6071]
ParameterName=Target torque
ObjectType=0x7
DataType=0x0003
AccessType=rw
ParameterValue=500
"""


@pytest.mark.parametrize(("rpdo", "slots"), [("sync", 2), ("event", 1)])
def test_the_delay_of_a_command_is_the_declared_one(rpdo: str, slots: int) -> None:
    """A command written in cycle 0 acts one slot later by SYNC, at once by event."""
    rig = make(block(node(1, counts_per_revolution=10_000_000), rpdo=rpdo), ("impedance",))
    rig.open_and_enable()
    rows, _ = rig.run(6, 0.5)
    positions = [row[0].position for row in rows]
    moved = next(at for at, position in enumerate(positions) if position != 0.0)
    assert moved == slots
    assert rig.driver.command_delay.periods == slots - 1
    rig.driver.close()


@pytest.mark.slow
@pytest.mark.parametrize("rpdo", ["sync", "event"])
def test_the_wave_port_is_stable_with_either_delay(rpdo: str) -> None:
    run = run_rig(can_tree(rpdo=rpdo), duration_s=2.0)
    reported = books(run, "lever")
    assert reported.residual < 1e-9 * reported.gross_flow
    assert sum(reported.generated.values()) < 0.01 * reported.gross_flow
    assert np.abs(run["slave.lever.velocity"]).max() < 15.0


def test_parameter_values_of_a_dcf_are_written_and_commands_are_not(tmp_path: Path) -> None:
    path = tmp_path / "test.dcf"
    path.write_text(EDS)
    rig = make(block(node(1, eds=str(path))), ("impedance",))
    rig.driver.open()
    objects = rig.devices()[0].objects
    assert objects.number(0x6065) == 777
    assert objects.number(0x6071) == 0
    assert any(
        "test.dcf: 1 written and read back, 0 already in the drive" in note
        for note in rig.driver.notes
    )
    assert any("6071:00 Target torque (commands and" in note for note in rig.driver.notes)
    rig.driver.close()


def test_a_value_of_a_dcf_that_the_drive_refuses_is_named(tmp_path: Path) -> None:
    path = tmp_path / "test.dcf"
    path.write_text(EDS.replace("0x6065", "0x6999").replace("[6065]", "[6999]"))
    rig = foreign(first={"eds": str(path)})
    said = rig.refused()
    assert "6999:00" in said
    assert "object does not exist" in said


@pytest.mark.parametrize(("index", "taken"), [("2100", True), ("1017", False)])
def test_what_a_maker_adds_is_written_from_a_dcf_and_communication_is_not(
    tmp_path: Path, index: str, taken: bool
) -> None:
    path = tmp_path / "test.dcf"
    path.write_text(EDS.replace("=0x6065", f"=0x{index}").replace("[6065]", f"[{index}]"))
    rig = make(block(node(1, eds=str(path))), ("impedance",))
    objects = rig.devices()[0].objects
    if taken:
        objects.add(int(index, 16), 0, Entry("U32", "rw", 0))
    rig.driver.open()
    assert (objects.number(int(index, 16)) == 777) == taken
    said = f"{int(taken)} parameter values of"
    assert any(said in note for note in rig.driver.notes), rig.driver.notes
    rig.driver.close()


def test_a_value_of_a_dcf_that_the_drive_does_not_keep_is_named(tmp_path: Path) -> None:
    path = tmp_path / "test.dcf"
    path.write_text(EDS)
    rig = make(block(node(1, eds=str(path))), ("impedance",))
    rig.devices()[0].objects.readers[0x6065, 0] = lambda: 5
    kept = r"reads 0x00000005 at 6065:00 Following error window after 0x00000309 of line 26 of its"
    with pytest.raises(DeviceFault, match=kept):
        rig.driver.open()
    rig.driver.close()


def test_an_eds_that_is_none_is_named_with_its_drive(tmp_path: Path) -> None:
    path = tmp_path / "test.dcf"
    path.write_text("name: bench\n")
    with pytest.raises(ConfigError, match=r"^master\.a1: .*test\.dcf: not an EDS or DCF"):
        make(block(node(1, eds=str(path))), ("impedance",))
    path.write_text(EDS)
    rig = make(block(node(1, eds=str(path))), ("impedance",))
    path.write_text("name: bench\n")  # after the rig was read
    with pytest.raises(DriverError, match=r"bus can: master\.a1: .*test\.dcf: not an"):
        rig.driver.open()
    rig.driver.close()


def test_an_eds_that_is_not_there_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^master\.a1: .*/no\.eds: no such file$"):
        make(block(node(1, eds=str(tmp_path / "no.eds"))), ("impedance",))


@pytest.mark.slow
def test_what_a_cycle_costs_is_measured_on_both_backends() -> None:
    raw, virtual = measure(50)
    assert len(raw.spent_us) == len(raw.floor_us or ()) == 50
    assert len(virtual.spent_us) == len(virtual.floor_us or ()) == 50
    assert (raw.goal_us, virtual.goal_us) == (25.0, 60.0)


class Heard(SocketEnd):
    """An end that remembers which frames have come, and of how many bytes, and what it sent."""

    def __init__(self, end: socket.socket) -> None:
        super().__init__(end)
        self.frames: list[tuple[int, int]] = []
        self.sent: list[int] = []

    def take(self) -> tuple[int, bytes] | None:
        frame = super().take()
        if frame is not None:
            self.frames.append((frame[0], len(frame[1])))
        return frame

    def put(self, can_id: int, data: bytes) -> None:
        self.sent.append(can_id)
        super().put(can_id, data)


def test_a_measured_cycle_and_its_floor_exchange_the_same_five_frames() -> None:
    clock = MonotonicClock()
    with ExitStack() as stack:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2)]
        for end in (end for both in pairs for end in both):
            stack.callback(end.close)
        (ours, theirs), (bare_ours, bare_theirs) = pairs
        driven, bare = Heard(theirs), Heard(bare_theirs)
        cycles = (
            enabled_cycle(_driver(clock, RawPort(ours, clock, "bench")), clock, driven),
            bare_cycle(SocketEnd(bare_ours), bare),
        )
        for cycle, heard in zip(cycles, (driven, bare), strict=True):
            cycle()  # enabling may have sent its SYNC already
            heard.frames.clear()
            heard.sent.clear()
            assert cycle() > 0
            cycle()
            assert heard.frames[0] == (0x80, 0)
            assert [can_id for can_id, _ in heard.frames] == [0x80, 0x201, 0x202] * 2
            assert heard.frames[3:] == heard.frames[:3]
            assert heard.sent == [0x181, 0x182] * 2


def test_the_plugin_imports_no_vendor_library() -> None:
    code = (
        "import sys; from tautwave_drivers.canopen import plugin; "
        "print([name for name in ('can', 'canopen') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert plugin.needs == ("can", "canopen")


def test_columns_tell_how_long_after_sync_an_answer_came() -> None:
    rig = make(block(node(1)), ("impedance",))
    assert rig.driver.columns == ["master.a1.answer_us"]
    rig.open_and_enable()
    rig.run(3)
    row = [0.0, 0.0]
    rig.driver.fill(row, 1)
    assert 100.0 < row[1] < 300.0
    rig.driver.close()


def command(*words: str) -> Any:
    return subprocess.run(
        [sys.executable, "-c", MAIN, *words], capture_output=True, text=True, timeout=100
    )


@pytest.mark.slow
def test_check_shows_the_arithmetic_and_a_rig_that_is_too_fast_exits_4() -> None:
    done = command("check", str(CONFIG), "--json")
    assert done.returncode == 0, done.stderr
    budget = json.loads(done.stdout)["budget"]["can"]
    assert "process data of one cycle: 515 us" in budget["arithmetic"]
    assert "mapping: lean (1979 Hz)" in budget["remedy"]
    done = command("run", str(CONFIG), "--clock", "fake", "--set", "rate_hz=4000")
    assert done.returncode == 4
    assert "the greatest rate that fits is 1826 Hz; more axes or a higher rate, " in done.stderr
    assert "mapping: lean (1979 Hz), two buses (3299 Hz)" in done.stderr


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("clock", ["fake", "real"])
def test_the_shipped_rig_runs_as_a_new_user_would_run_it(tmp_path: Path, clock: str) -> None:
    out = tmp_path / "out"
    # A machine busy with other tests stops for a while now and then; that is not asked here.
    patient = ("--set", "buses.can.options.heartbeat_timeout_ms=5000", *PATIENT)
    words = ["run", str(CONFIG), "--clock", clock, "--duration", "1", "--out", str(out)]
    done = command(*words, *patient)
    summary = assert_ran_to_its_end(done.returncode, out, done.stdout + done.stderr)
    assert done.returncode == 0 or clock == "real"
    assert "not properly shut down" not in done.stderr
    assert summary["energy_j"]["residual"] < 1e-9 * summary["energy_j"]["gross_flow"]
    assert any("read back" in note for note in summary["buses"]["can"]["notes"])
