"""What drivers do alike: nothing is taken while off, all ways out release, nothing is lost."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.driver_base import DriverBase
from tautwave.errors import DriverError
from tautwave.types import SAFE_COMMAND, AxisCommand, Fault

AXES = tuple(AxisSpec(f"master.{name}", 1, "rotary", "impedance", 1.0) for name in "ab")
STEPS = ("_bring_up", "_enable", "_take", "disable", "_end")
CALLS = ("open", "enable_step", "write", "faults", "disable", "close", "detach")


class Driver(DriverBase):
    """Notes what is called; `fails` says where, and with what."""

    def __init__(self) -> None:
        super().__init__(BusSpec("line", AXES, 1000.0))
        self.fails: dict[str, BaseException] = {}
        self.log: list[str] = []
        self.there = False

    def _note(self, what: str) -> None:
        self.log.append(what)
        if what in self.fails:
            raise self.fails[what]

    def _bring_up(self) -> None:
        self.there = True
        self._note("_bring_up")

    def _enable(self) -> bool:
        self._note("_enable")
        self._on = True
        return True

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        assert self.there
        assert self._on
        self._note("_take")

    def disable(self) -> None:
        if self._on:
            self._on = False
            self.unconfirmed = {"master.a": "silent"}
            self._note("disable")

    def _end(self) -> None:
        self._note("_end")

    def _release(self) -> None:
        self.there = False


@given(
    calls=st.lists(st.sampled_from(CALLS), min_size=1, max_size=12),
    fails=st.sets(st.sampled_from(STEPS)),
)
def test_any_order_of_calls_ends_released(calls: list[str], fails: set[str]) -> None:
    driver = Driver()
    driver.fails = {one: RuntimeError(one) for one in fails}
    opened = False
    for call in calls:
        unconfirmed = dict(driver.unconfirmed)
        driver.log.clear()
        try:
            getattr(driver, call)(*([[SAFE_COMMAND] * 2] if call == "write" else []))
            raised = ""
        except (RuntimeError, DriverError) as err:
            raised = str(err)
        if call == "open":
            opened = "_bring_up" not in fails
            assert driver.there == opened == (not raised)
            assert opened or not unconfirmed or driver.unconfirmed
            assert not (opened and driver.unconfirmed)
        elif call == "enable_step":
            assert raised == (
                "" if opened and "_enable" not in fails
                else "_enable" if opened
                else "bus line: enable_step before open"
            )  # fmt: skip
        elif call in ("close", "detach"):
            opened = False
            assert not driver.there
            assert raised == ""
            assert call == "close" or driver.log == []
    driver.close()
    assert not driver.there
    driver.write([SAFE_COMMAND] * 2)
    assert "_take" not in driver.log[driver.log.index("_end") :]


def test_an_interrupted_start_is_closed_and_raised() -> None:
    driver = Driver()
    driver.fails = {"_bring_up": KeyboardInterrupt()}
    with pytest.raises(KeyboardInterrupt):
        driver.open()
    assert not driver.there
    assert driver.log == ["_end", "_bring_up", "_end"]


def test_what_fails_while_closing_is_a_note() -> None:
    driver = Driver()
    driver.open()
    driver.fails = {"_end": RuntimeError("no port")}
    driver.close()
    assert driver.notes == ["bus line: closing: no port"]


@pytest.mark.parametrize("count", [0, 1, 3])
def test_commands_are_one_per_axis(count: int) -> None:
    driver = Driver()
    with pytest.raises(DriverError, match=f"bus line: {count} commands for 2 axes; write one per"):
        driver.write([SAFE_COMMAND] * count)


def test_faults_are_told_once_and_forgotten_by_a_new_start() -> None:
    driver = Driver()
    fault = Fault("master.a", "hot", True)
    driver._faults.append(fault)
    assert (driver.faults(), driver.faults()) == ([fault], ())
    driver._faults.append(fault)
    driver.open()
    assert driver.faults() == ()
