"""The driver with a foreign drive behind it, on the fake clock."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import DriverError
from tautwave.types import AxisCommand, JointState
from tautwave_drivers.canopen.driver import CanopenDriver
from tests.drivers.canopen.benches import block, driver_options, node
from tests.foreign.can_bus import ForeignBus
from tests.foreign.cia402 import PRODUCT, VENDOR, ForeignDrive, Key

EFFORT_LIMIT, VELOCITY_LIMIT = 0.4, 15.0
RATE_HZ = 500.0


class Foreign(NamedTuple):
    """A driver, the bus to its foreign drives, and the clock of both."""

    driver: CanopenDriver
    bus: ForeignBus
    clock: FakeClock
    rate_hz: float

    @property
    def drive(self) -> ForeignDrive:
        return self.bus.drives[0]

    def enable(self, most: int = 500) -> None:
        self.driver.open()
        for _ in range(most):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + round(1e9 / self.rate_hz))
        raise AssertionError("never enabled")

    def cycle(self, effort: float = 0.0, velocity: float = 0.0) -> list[JointState]:
        begun, period = self.clock.now_ns(), round(1e9 / self.rate_hz)
        self.driver.request()
        states = list(self.driver.read(begun + period * 7 // 10))
        self.driver.write([AxisCommand(effort, velocity)] * len(self.bus.drives))
        self.clock.sleep_until(begun + period)
        return states

    def refused(self) -> str:
        """What it is refused with; no drive got torque."""
        with pytest.raises(DriverError) as said:
            self.driver.open()
        for drive in self.bus.drives:
            assert drive.state == "disabled"
            assert (drive.angle, drive.torque) == (0.0, 0.0)
        self.driver.close()
        return str(said.value)


def foreign(
    objects: dict[Key, int] | None = None,
    *,
    causality: str = "impedance",
    first: dict[str, Any] | None = None,
    options: dict[str, Any] | None = None,
    numbers: tuple[int, ...] = (1,),
    configure: bool = False,
    rate_hz: float = RATE_HZ,
    **more: Any,
) -> Foreign:
    given = node(1, identity={"vendor": VENDOR, "product": PRODUCT}) | (first or {})
    nodes = [given, *(node(number) for number in numbers[1:])]
    axes = tuple(
        AxisSpec(f"master.a{at}", at, "rotary", causality, EFFORT_LIMIT, VELOCITY_LIMIT)
        for at in numbers
    )
    bus = BusSpec("can", axes, rate_hz, configure=configure)
    clock = FakeClock()
    port = ForeignBus(clock, numbers, objects, **more)
    whole = driver_options(block(*nodes, **(options or {})))
    return Foreign(CanopenDriver(whole, bus, clock, port), port, clock, rate_hz)


def remedies(sentence: str) -> list[str]:
    """The keys that a sentence tells to state in the rig: `counts_per_revolution: 3600`."""
    return re.findall(r"state (\w+: -?[\d.]+)", sentence)
