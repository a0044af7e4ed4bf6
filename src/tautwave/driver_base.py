"""What drivers of real buses do alike beside their bytes: open, count, report, end, release."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from tautwave.columns import Column
from tautwave.contracts import BusSpec, Row
from tautwave.errors import DriverError
from tautwave.types import AxisCommand, Fault


def _nothing(owner: Any) -> float:
    return math.nan


class DriverBase(ABC):
    """A `Driver` without its bytes: they are in `request`, `read`, `disable` and what is abstract.

    Parameters
    ----------
    bus : BusSpec
        Its name and axes.

    Attributes
    ----------
    notes : list of str
        What `open` found and set.
    columns : list of str
        Of the recording, as `record` adds them; a driver with a `fill` of its own sets them.
    watchdog_s, unwatched, unconfirmed, identities : mapping
        By axis, as in `Driver`.
    """

    def __init__(self, bus: BusSpec) -> None:
        self._bus = bus
        self._count = len(bus.axes)
        self._opened = False
        self._on = False
        self._faults: list[Fault] = []
        self.notes: list[str] = []
        self.columns: list[str] = []
        self._recorded: list[tuple[Callable[[Any], float], Any]] = []
        self.watchdog_s: Mapping[str, float] = {}
        self.unwatched: Mapping[str, str] = {}
        self.unconfirmed: dict[str, str] = {}
        self.identities: dict[str, Mapping[str, str]] = {}

    def record(self, prefix: str, owner: Any, kinds: Iterable[Column]) -> None:
        """Add columns `PREFIX.name`, each filled by its `value(owner)`.

        Parameters
        ----------
        prefix : str
            Such as an axis' full name, `master.lever`.
        owner : object
            What the driver keeps of that axis.
        kinds : iterable of Column
            Also among the `columns` of its plugin, where their units and meanings are read.
        """
        for kind in kinds:
            self.columns.append(f"{prefix}.{kind.name}")
            self._recorded.append((kind.value or _nothing, owner))

    def fill(self, row: Row, at: int) -> None:
        """Write the values of the columns given to `record` into `row` from index `at` on."""
        for place, (value, owner) in enumerate(self._recorded, at):
            row[place] = value(owner)

    # -- what a bus adds ----------------------------------------------------------------------

    @abstractmethod
    def _bring_up(self) -> None:
        """Open the bus; torque off, everything checked and set; raises what `open` does."""

    @abstractmethod
    def _enable(self) -> bool:
        """Advance one step of enabling; `_on` once commands are taken."""

    @abstractmethod
    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Take one command per axis, enabled."""

    @abstractmethod
    def disable(self) -> None:
        """Safe command, then torque off; idempotent."""

    def _end(self) -> None:  # noqa: B027  not every bus can
        """After `disable`, before the release: try again who did not confirm it."""

    @abstractmethod
    def _release(self) -> None:
        """Close what was opened, with nothing sent to the devices; idempotent."""

    def _not_closed(self, err: Exception) -> None:
        self.notes.append(f"bus {self._bus.name}: closing: {err}")

    # -- what the loop calls --------------------------------------------------------------------

    def open(self) -> None:
        """Close, then bring the bus up; where that fails or is interrupted, close again."""
        self.close()
        self._faults.clear()
        self.notes = []
        try:
            self._bring_up()
        except BaseException:
            self.close()
            raise
        self.unconfirmed = {}
        self._opened = True

    def enable_step(self) -> bool:
        """Advance one step of enabling; True once all axes take commands."""
        if not self._opened:
            raise DriverError(f"bus {self._bus.name}: enable_step before open")
        return self._enable()

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Take one command per axis; ignored while not enabled."""
        if len(commands) != self._count:
            raise DriverError(
                f"bus {self._bus.name}: {len(commands)} commands for {self._count} axes; "
                "write one per axis, in the order of the rig file"
            )
        if self._on:
            self._take(commands)

    def faults(self) -> Sequence[Fault]:
        """Return what was reported since the last call."""
        if not self._faults:
            return ()
        reported, self._faults = self._faults, []
        return reported

    def close(self) -> None:
        """Disable and release the bus; idempotent, never raises."""
        try:
            self.disable()
            self._end()
        except Exception as err:  # noqa: BLE001  everything has to be released
            self._not_closed(err)
        self.detach()

    def detach(self) -> None:
        """Release the bus and leave its devices as they are."""
        self._on = self._opened = False
        self._release()
