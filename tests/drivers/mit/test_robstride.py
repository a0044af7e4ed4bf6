"""RobStride motors: the suite of every driver over foreign ones, what is refused, and frames."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, DeviceFault, DriverError
from tautwave.testing import DriverBench, DriverContract
from tautwave.types import AxisCommand, JointState
from tautwave_drivers.mit import RobstrideDriver, make, robstride
from tautwave_drivers.mit.budget import budget
from tautwave_drivers.mit.options import facts
from tests.drivers.mit.benches import driver_options
from tests.drivers.mit.benches import robstride as stated
from tests.foreign.robstride_motors import LIMIT, MODE, SILENCE, RobstrideLine, RobstrideMotor

PERIOD_NS = 2_000_000


def block(*motors: dict[str, Any], **more: Any) -> dict[str, Any]:
    keys = {"interface": "virtual", "channel": "test", "family": "robstride"}
    return {**keys, "motors": list(motors), **more}


class Rig:
    """A driver in front of foreign motors."""

    def __init__(
        self, *motors: dict[str, Any], foreign: tuple[RobstrideMotor, ...] = (), **more: Any
    ) -> None:
        self.clock = FakeClock()
        self.motors = foreign or tuple(RobstrideMotor(one["id"]) for one in motors)
        self.line = RobstrideLine(self.clock, *self.motors)
        allow = more.pop("allow_unwatched", False)
        self.options = driver_options(block(*motors, **more))
        axes = tuple(
            AxisSpec(f"master.a{one['id']}", one["id"], "rotary", "impedance", effort_limit=1.0)
            for one in motors
        )
        self.bus = BusSpec("can", axes, 1e9 / PERIOD_NS, allow_unwatched=allow)
        self.driver = make(self.options, self.bus, self.clock, self.line)
        assert isinstance(self.driver, RobstrideDriver)

    def enable(self) -> None:
        self.driver.open()
        for _ in range(100):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + PERIOD_NS)
        raise AssertionError

    def cycle(self, effort: float) -> list[JointState]:
        until = self.clock.now_ns() + PERIOD_NS
        self.driver.request()
        states = list(self.driver.read(until))
        self.driver.write([AxisCommand(effort, 0.0)] * len(self.bus.axes))
        self.clock.sleep_until(until)
        return states

    def commanded(self, axis: int) -> float:
        one = self.motors[axis]
        one.pass_time(self.clock.now_ns())
        step = 2.0 * one.real[2] / 65535
        push = one.torque if one.state == 2 else 0.0
        return 0.0 if abs(push) <= 0.51 * step else push


class TestRobstride(DriverContract):
    @pytest.fixture(params=["two", "turned"])
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        turned = request.param == "turned"
        other = stated(2, direction=-1, zero=0.5) if turned else stated(2)
        rig = Rig(stated(1), other)
        sign, zero = (-1, 0.5) if turned else (1, 0.0)

        def twin() -> None:
            rig.line.motors.append(RobstrideMotor(1))

        return DriverBench(
            rig.driver,
            rig.clock,
            ("impedance", "impedance"),
            rig.commanded,
            lambda axis: sign * (rig.motors[1].x - zero) if axis else rig.motors[0].x,
            names=("master.a1", "master.a2"),
            cut=lambda: setattr(rig.line, "cut", True),
            forget=lambda axis, span_ns: rig.motors[axis].cut_power(rig.clock.now_ns(), span_ns),
            stick=lambda axis: setattr(rig.motors[axis], "stuck", True),
            spoil=lambda: setattr(rig.line, "spoiled", True),
            twin=twin,
            period_ns=PERIOD_NS,
            tolerance=2e-3,
        )


def test_all_is_set_in_ram_and_read_back() -> None:
    rig = Rig(stated(1), watchdog_s=0.05)
    rig.enable()
    table = rig.motors[0].table
    assert (table[MODE], table[SILENCE]) == (0, 1000)
    assert table[LIMIT] == pytest.approx(1.0)  # whatever the codes stand for
    assert rig.driver.watchdog_s == {"master.a1": 0.05}
    assert rig.driver.identities["master.a1"]["unique id"] == "0001020304050601"
    kinds = {can_id >> 24 & 0x1F for can_id, _ in rig.line.sent}
    assert 22 not in kinds  # nothing is saved
    rig.driver.close()


@pytest.mark.parametrize(
    ("real", "words"),
    [
        ((12.57, 33.0, 120.0), "t_max is 14, but its limit_torque.*is 120"),
        ((25.0, 33.0, 14.0), "mechPos.* reads 0.3 rad, its answers 0.15.* another model"),
    ],
)
def test_ranges_of_another_model_are_refused(real: tuple[float, float, float], words: str) -> None:
    one = RobstrideMotor(1, real=real)
    one.x = 0.3
    rig = Rig(stated(1), foreign=(one,))
    with pytest.raises(DriverError, match=words):
        rig.driver.open()
    rig.driver.close()


def test_a_timeout_that_is_not_taken_is_refused_or_named() -> None:
    for gone in (False, True):
        one = RobstrideMotor(1)
        (one.missing if gone else one.deaf).add(SILENCE)
        rig = Rig(stated(1), foreign=(one,))
        words = "does not answer" if gone else "stays at 0"
        with pytest.raises(DriverError, match=rf"CAN_timeout.*{words}.*--allow-unwatched"):
            rig.driver.open()
        rig = Rig(stated(1), foreign=(one,), allow_unwatched=True)
        rig.enable()
        assert "goes on when the host stops" in rig.driver.unwatched["master.a1"]
        assert rig.driver.watchdog_s == {}
        rig.driver.close()


def test_a_parameter_that_stays_is_refused() -> None:
    one = RobstrideMotor(1)
    one.deaf.add(MODE)
    with pytest.raises(DriverError, match=r"run_mode\(0x7005\) stays at 3 when 0 is written"):
        Rig(stated(1), foreign=(one,)).driver.open()


def test_faults_are_refused_or_cleared_and_stop_a_run_in_words() -> None:
    one = RobstrideMotor(1)
    one.faults = 0b100
    with pytest.raises(DeviceFault, match="too hot"):
        Rig(stated(1), foreign=(one,)).driver.open()
    rig = Rig(stated(1), foreign=(one,), clear_errors=True)
    rig.enable()
    rig.cycle(0.5)
    one.state, one.faults = 0, 0b1
    rig.cycle(0.5)
    (fault,) = rig.driver.faults()
    assert fault.fatal
    assert "motor 1: under-voltage: its torque is off" in fault.text
    assert not rig.cycle(0.5)[0].valid
    rig.driver.close()


def test_a_host_that_stalls_finds_the_motor_stopped() -> None:
    rig = Rig(stated(1), watchdog_s=0.05)
    rig.enable()
    rig.cycle(0.5)
    rig.cycle(0.5)
    assert rig.commanded(0) == pytest.approx(0.5, abs=1e-3)
    rig.clock.sleep_until(rig.clock.now_ns() + 60_000_000)
    assert rig.commanded(0) == 0.0
    rig.cycle(0.5)
    (fault,) = rig.driver.faults()
    assert "stopped: its CAN timeout has passed" in fault.text
    rig.driver.close()


@pytest.mark.parametrize("late_ms", [5, 16, 31, 75, 300])
def test_motors_are_known_to_be_off_however_late_their_answers_come(late_ms: int) -> None:
    """Meanwhile answers to older commands say that they run."""
    rig = Rig(stated(1), stated(2))
    rig.enable()
    rig.cycle(0.5)
    inject = rig.line.inject
    rig.line.inject = lambda at_ns, *frame: inject(at_ns + late_ms * 1_000_000, *frame)  # type: ignore[method-assign]
    for _ in range(late_ms // 2 + 2):
        rig.cycle(0.5)
    rig.driver.disable()
    rig.clock.sleep_until(rig.clock.now_ns() + 30_000_000)  # another bus is left as well
    rig.driver.close()
    assert [one.state for one in rig.motors] == [0, 0]
    assert not rig.driver.unconfirmed


def test_a_port_that_was_lost_is_opened_anew_to_stop_motors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(stated(1))
    opened: list[RobstrideLine] = []

    def port(*_: Any) -> RobstrideLine:
        opened.append(RobstrideLine(rig.clock, *rig.motors))
        return opened[-1]

    monkeypatch.setattr("tautwave_drivers.mit.robstride_driver.open_port", port)
    rig.driver = make(rig.options, rig.bus, rig.clock, None)
    rig.enable()
    rig.cycle(0.5)

    def gone(can_id: int, data: bytes) -> bool:
        raise DriverError("CAN interface can0 is down or gone")

    opened[0].send = gone  # type: ignore[method-assign]
    rig.cycle(0.5)
    rig.driver.close()
    assert len(opened) == 2
    assert rig.motors[0].state == 0
    assert not rig.driver.unconfirmed


def test_another_masters_polls_are_no_samples() -> None:
    rig = Rig(stated(1))
    rig.enable()
    rig.cycle(0.1)
    one = rig.motors[0]
    one.answers = False
    ((can_id, data),) = one.hear(rig.clock.now_ns(), (1 << 31) + 17 * 2**24 + 0xFD01, bytes(8))
    rig.driver.request()
    rig.line.inject(rig.clock.now_ns() + 1000, can_id, data)
    (state,) = rig.driver.read(rig.clock.now_ns() + PERIOD_NS)
    assert not state.valid
    assert "stop the other program that asks" in rig.driver.misses["master.a1"]
    other = (1 << 31) + 2 * 2**24 + 2 * 2**22 + 0x0100 + 0xAA  # feedback to another host
    assert robstride.answer(other, bytes(8), 0xFD) is None
    rig.driver.close()


@pytest.mark.parametrize("effort", [math.nan, math.inf, -math.inf, 9.0, 0.0])
def test_torque_is_within_its_limit_and_zero_on_average(effort: float) -> None:
    rig = Rig(stated(1))
    rig.enable()
    told = []
    for _ in range(6):
        rig.cycle(effort)
        told.append(rig.motors[0].torque)
    limit = 1.0 if effort == effort and effort else 0.0
    wanted = math.copysign(limit, effort) if limit else 0.0
    step = 28.0 / 65535
    assert sum(told[2:]) / 4 == pytest.approx(wanted, abs=0.51 * step)
    rig.driver.close()


def test_frames_are_those_of_the_manual() -> None:
    assert robstride.frame_id(robstride.ENABLE, 0x7F, 0xFD) == 0x8300FD7F
    bits, data = robstride.motion(0x8000)
    assert robstride.frame_id(robstride.MOTION, 1, bits) == 0x81800001
    assert data == bytes.fromhex("7fff7fff00000000")  # kp and kd are 0
    assert robstride.parameter_bytes(robstride.TIMEOUT, 20000) == bytes.fromhex("28700000204e0000")
    assert robstride.parameter_bytes(robstride.POSITION) == bytes.fromhex("1970000000000000")
    told = bytes.fromhex("197000000000803f")
    assert robstride.parameter_value(robstride.POSITION, told) == 1.0
    assert robstride.parameter_value(robstride.VOLTAGE, told) is None
    got = robstride.answer(0x80000000 | 2 << 24 | 2 << 22 | 5 << 16 | 3 << 8 | 0xFD, bytes(8), 0xFD)
    assert got == robstride.Answer(2, 3, robstride.RUNS, 5, bytes(8))
    assert robstride.faults_text(5) == "under-voltage, too hot"


@pytest.mark.parametrize(
    ("motors", "more", "words"),
    [
        ([stated(1, damping=0.1, velocity_filter_hz=100.0)], {}, "1.4167.*remove damping"),
        ([stated(1)], {"data_bitrate": 5_000_000}, "classic CAN only"),
        ([stated(1), {**stated(2), "feedback_id": 0x11}], {}, "one for all of them"),
        ([stated(200)], {}, "ids end at 127"),
        ([stated(1), stated(1)], {}, "listed twice"),
    ],
)
def test_options_say_what_is_wrong(
    motors: list[dict[str, Any]], more: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Rig(*motors, **more)


def test_bus_time_and_steps_are_those_of_its_frames() -> None:
    rig = Rig(*(stated(number) for number in range(1, 8)))
    found = budget(rig.options, rig.bus)
    assert found.time_s == pytest.approx(2.24e-3)
    assert found.greatest_rate_hz == pytest.approx(357.0, abs=1.0)
    assert "29-bit ids" in found.arithmetic
    assert facts(rig.options, rig.bus)[0].effort_quantum == pytest.approx(28.0 / 65535)
