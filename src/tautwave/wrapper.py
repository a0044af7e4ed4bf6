"""A driver in front of another one: it hands on all that it does not change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.contracts import Driver
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState


class DriverWrapper:
    """A driver in front of another one; what it does not define is the other one's own.

    Parameters
    ----------
    driver : Driver
        The driver behind it, `_driver` to those that derive from this.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.command_delay: CommandDelay = driver.command_delay
        # Called in every slot: not through one more method.
        self.enable_step = driver.enable_step
        self.request = driver.request
        self.disable = driver.disable
        self.close = driver.close

    def __getattr__(self, name: str) -> Any:
        """Return what else a driver may have: `poll`, `notes`, `columns`."""
        if hasattr(type(self), name):  # its own property came to an AttributeError: not hidden
            return object.__getattribute__(self, name)
        return getattr(self._driver, name)

    @property
    def watchdog_s(self) -> Mapping[str, float]:
        """Return the time-outs of the devices behind [s]."""
        return self._driver.watchdog_s

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Return what the devices behind do when the host stops."""
        return self._driver.unwatched

    @property
    def unconfirmed(self) -> Mapping[str, str]:
        """Return why devices behind may still be enabled."""
        return self._driver.unconfirmed

    def open(self) -> None:
        """Open the driver behind, at the start or for a reset."""
        self._driver.open()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the samples of the driver behind."""
        return self._driver.read(deadline_ns)

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Hand commands to the driver behind."""
        self._driver.write(commands)

    def faults(self) -> Sequence[Fault]:
        """Return the faults reported since the last call."""
        return self._driver.faults()


class SlotCount:
    """How many slots of a bus lie between two reads."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._deadline_ns: int | None = None

    def passed(self, deadline_ns: int) -> int:
        """Return the slots since the last deadline, 0 at the first."""
        last, self._deadline_ns = self._deadline_ns, deadline_ns
        return 0 if last is None else max(round((deadline_ns - last) / self._period_ns), 0)
