"""Somebody else commands a drive: said before anything is written; nothing else is taken for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tautwave_sim.modbus.registers import Refusal
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, spec

PROFILES = ["generic", "cia402", "dsy-rs"]


def disturb(made: Bench, act: Callable[[], None]) -> None:
    """Let somebody else act once, in the first long wait of this master."""
    clock: Any = made.clock
    sleep_until, acted = clock.sleep_until, []

    def asleep(at_ns: int) -> None:
        if at_ns - clock.now_ns() > 50_000_000 and not acted:
            acted.append(at_ns)
            act()
        sleep_until(at_ns)

    clock.sleep_until = asleep


def opened(made: Bench) -> list[str]:
    made.driver.open()
    faults = made.faults()
    assert not any(fault.fatal for fault in faults)
    assert made.driver.warnings == [fault.text for fault in faults]
    return made.driver.warnings


@pytest.mark.parametrize("line", [{}, FAST_RTU], ids=["tcp", "rtu"])
@pytest.mark.parametrize("role", ["command_effort", "command_velocity", "mode", "control"])
def test_what_only_a_master_writes_and_changed_by_itself_is_a_warning(
    role: str, line: dict[str, Any]
) -> None:
    made = bench(spec(1), spec(2), **line)
    bank = made.world.bus.drives[2].bank
    name = made.driver.make_stations()[0].device.profile.roles[role]
    at_first = bank.values[name]
    disturb(made, lambda: bank.store(name, at_first + 3))
    [said] = opened(made)
    assert f"{name} {at_first} -> {at_first + 3} within 0.1 s, before anything" in said
    assert "another master or the panel writes to it" in said
    assert said.startswith(made.driver.stations[1].label)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_drive_that_nobody_else_commands_gives_no_warning(profile: str) -> None:
    made = bench(profile=profile)
    assert opened(made) == []


def test_what_a_drive_reports_may_change() -> None:
    made = bench()
    bank = made.world.bus.drives[1].bank

    def turn() -> None:
        for name in ("position", "velocity", "torque"):
            bank.store(name, 77)

    disturb(made, turn)
    assert opened(made) == []


def test_what_a_drive_does_not_let_us_read_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    made = bench()
    drive = made.world.bus.drives[1]
    read, refused = drive.read, []

    def reads(address: int, count: int, table: str = "holding") -> list[int]:
        if len(refused) < 2:
            refused.append(address)
            raise Refusal(2)
        found: list[int] = read(address, count, table)
        return found

    monkeypatch.setattr(drive, "read", reads)
    assert opened(made) == []
    assert refused == [16, 16]  # control, mode and the commands, in one block
