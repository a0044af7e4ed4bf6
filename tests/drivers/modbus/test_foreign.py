"""The driver before a drive that was written apart from it: echoes, and drives that stay on."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave.errors import ConfigError, DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.modbus import plugin
from tests.drivers.modbus.parts import bus_of, device, options_of, spec
from tests.foreign import modbus_drive
from tests.foreign.modbus_drive import Drive, DriveLine


class Lost(DriverError):
    """What a port raises once its connection is gone."""


class Rig(NamedTuple):
    driver: Any
    line: DriveLine
    clock: FakeClock
    period_ns: int

    def enable(self) -> None:
        self.driver.open()
        for _ in range(500):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.period_ns)
        raise AssertionError("never enabled")

    def run(self, cycles: int = 20) -> None:
        for _ in range(cycles):
            began = self.clock.now_ns()
            self.driver.request()
            self.driver.read(began + self.period_ns * 8 // 10)
            assert not any(fault.fatal for fault in self.driver.faults())
            self.driver.write([AxisCommand(0.2, 0.0)] * len(self.line.drives))
            self.clock.sleep_until(began + self.period_ns)


def rig(
    monkeypatch: pytest.MonkeyPatch,
    *drives: Drive,
    tcp: bool = True,
    echo: bool = False,
    functions: tuple[int, ...] = (3, 16),
    first: int = 1,
    profile: str = "generic",
    rate_hz: float = 50.0,
    **more: Any,
) -> Rig:
    monkeypatch.setattr(modbus_drive.Port, "lost", Lost)
    clock = FakeClock(1_000_000_000)
    units = range(first, first + len(drives))
    line = DriveLine(clock, dict(zip(units, drives, strict=True)), tcp=tcp, echo=echo)
    axes = [spec(unit) for unit in units or (1,)]
    more |= {"echo": more.pop("options_echo")} if "options_echo" in more else {}
    block = options_of(axes, "generic", link="tcp" if tcp else "rtu", comm_timeout_s=0.3, **more)
    own = {"function_codes": list(functions), "profile": profile}
    block["devices"] = [device(axis.device_id) | own for axis in axes]
    bus = bus_of(axes, rate_hz, allow_unwatched=False)
    driver = plugin.make(plugin.options.model_validate(block), bus, clock, line)
    return Rig(driver, line, clock, bus.period_ns)


def assert_off(made: Rig) -> None:
    for drive in made.line.drives.values():
        assert not drive.on
        assert not drive.unguarded


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("functions", [(3, 6), (3, 16), (3, 6, 16, 23)])
def test_it_runs_it(monkeypatch: pytest.MonkeyPatch, tcp: bool, functions: tuple[int, ...]) -> None:
    made = rig(monkeypatch, Drive(), Drive(), tcp=tcp, functions=functions)
    made.enable()
    made.run()
    made.driver.close()
    assert made.line.drives[1].position > 0.1
    assert made.driver.unconfirmed == {}
    assert_off(made)


# -- a line that echoes -------------------------------------------------------------


@pytest.mark.parametrize("functions", [(3, 6, 16), (3, 16), (3, 6, 16, 23), (4, 6, 16)])
@pytest.mark.parametrize("drives", [0, 1, 2])
def test_a_line_that_returns_what_is_sent_is_refused_before_a_write(
    monkeypatch: pytest.MonkeyPatch, drives: int, functions: tuple[int, ...]
) -> None:
    made = rig(
        monkeypatch, *(Drive() for _ in range(drives)), tcp=False, echo=True, functions=functions
    )
    before = [dict(drive.words) for drive in made.line.drives.values()]
    with pytest.raises(DriverError, match=r"the line echoes what is sent.*set echo: true"):
        made.driver.open()
    assert [dict(drive.words) for drive in made.line.drives.values()] == before


def test_the_echo_is_taken_off_where_the_options_tell_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = rig(monkeypatch, Drive(), Drive(), tcp=False, echo=True, options_echo=True)
    made.enable()
    made.run()
    made.driver.close()
    assert made.line.drives[2].position > 0.1
    assert_off(made)


def test_an_echo_without_a_drive_is_no_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    """A write of one register is answered by itself."""
    made = rig(monkeypatch, tcp=False, echo=True, options_echo=True, functions=(3, 6, 16))
    with pytest.raises(DriverError, match="no answer"):
        made.driver.open()


def test_an_option_for_an_echo_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = rig(monkeypatch, Drive(), tcp=False, options_echo=True)
    with pytest.raises(DriverError, match="nothing that is sent comes back; remove it"):
        made.driver.open()


def test_an_echo_is_of_serial_lines_only(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="echo is for serial lines"):
        rig(monkeypatch, Drive(), tcp=True, options_echo=True)


# -- a drive that stays on ------------------------------------------------------------------


@pytest.mark.parametrize("tcp", [True, False])
def test_a_drive_that_missed_it_is_told_again(monkeypatch: pytest.MonkeyPatch, tcp: bool) -> None:
    made = rig(monkeypatch, Drive(), Drive(), tcp=tcp)
    made.enable()
    made.run()
    made.line.drives[1].stubborn = 1
    made.driver.disable()
    assert "did not confirm that it is off" in made.driver.unconfirmed["slave.a1"]
    assert not made.line.drives[2].on
    made.driver.close()
    assert made.driver.unconfirmed == {}
    assert_off(made)


@pytest.mark.parametrize("tcp", [True, False])
def test_a_drive_that_never_obeys_is_named_and_its_time_out_stays_armed(
    monkeypatch: pytest.MonkeyPatch, tcp: bool
) -> None:
    made = rig(monkeypatch, Drive(), Drive(), tcp=tcp)
    made.enable()
    made.run()
    made.line.drives[1].stubborn = 10**6
    made.driver.disable()
    began = made.clock.now_ns()
    made.driver.close()
    assert made.clock.now_ns() - began < 1_000_000_000
    assert list(made.driver.unconfirmed) == ["slave.a1"]
    assert made.line.drives[1].on
    assert made.line.drives[1].words[modbus_drive.TORQUE] == 0
    assert made.driver.watchdog_s["slave.a1"] == 0.3
    made.line.drives[1].advance(made.clock.now_ns() + 301_000_000)
    assert not made.line.drives[1].on


def test_a_connection_that_breaks_while_leaving_is_made_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = rig(monkeypatch, Drive())
    made.enable()
    made.run()
    made.line.resets = 1
    made.driver.disable()
    assert list(made.driver.unconfirmed) == ["slave.a1"]
    assert made.line.connections == 1, "other buses are to be told first"
    made.driver.close()
    assert made.line.connections == 2
    assert made.driver.unconfirmed == {}
    assert_off(made)


def test_what_was_not_confirmed_is_forgotten_once_a_drive_was_found_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = rig(monkeypatch, Drive())
    made.enable()
    made.run()
    made.line.cut = True
    made.driver.close()
    assert list(made.driver.unconfirmed) == ["slave.a1"]
    made.line.cut = False
    made.enable()
    assert made.driver.unconfirmed == {}
    made.driver.close()


# -- a drive that forgets -------------------------------------------------------------------


def cut_power_at(made: Rig, number: int, dip_ms: int) -> None:
    """Cut the first drive's power before the host's request with this number."""

    def hit(count: int) -> None:
        if count == number:
            made.line.drives[1].cut_power(made.clock.now_ns(), dip_ms * 1_000_000)

    made.line.on_request = hit


def whole_run(made: Rig, cycles: int) -> str:
    """Bring up, run, leave; return why it ended early, '' if it did not."""
    try:
        made.enable()
        for _ in range(cycles):
            began = made.clock.now_ns()
            made.driver.request()
            made.driver.read(began + made.period_ns * 8 // 10)
            fatal = [fault.text for fault in made.driver.faults() if fault.fatal]
            if fatal:
                return fatal[0]
            made.driver.write([AxisCommand(0.2, 0.0)] * len(made.line.drives))
            made.clock.sleep_until(began + made.period_ns)
    except DriverError as err:
        return str(err)
    finally:
        made.driver.close()
    return ""


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize(
    "functions", [(3, 16), pytest.param((3, 6, 16, 23), marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "dip_ms", [50, *(pytest.param(each, marks=pytest.mark.slow) for each in (500, 5000))]
)
def test_a_power_cycle_at_any_request_is_told_or_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, dip_ms: int, tcp: bool, functions: tuple[int, ...]
) -> None:
    whole = rig(monkeypatch, Drive(), tcp=tcp, functions=functions)
    whole.enable()
    bring_up = whole.line.requests
    moments = [*range(bring_up + 8), *range(bring_up + 8, bring_up + 80, 9)]
    told = 0
    for number in moments:
        made = rig(monkeypatch, Drive(), tcp=tcp, functions=functions)
        cut_power_at(made, number, dip_ms)
        ended = whole_run(made, 100 + dip_ms // 20)
        assert not made.line.drives[1].unguarded, (number, ended)
        assert not made.line.drives[1].on, (number, ended)
        told += bool(ended)
        if not ended:
            assert made.line.drives[1].position > 0.1, (number, "it was driven to the end")
    assert told >= len(moments) - bring_up
