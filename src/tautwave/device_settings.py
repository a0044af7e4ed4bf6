"""What devices have to hold: read, compared, written, read back, given back.

One ledger for all drivers, and with it one meaning of `--configure`: without it nothing is written
that a device still holds once its power was off, and what differs is listed, for all devices of
all buses at once; with it these settings are written, or stored, once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from enum import Enum
from typing import Any, NamedTuple

from tautwave.contracts import BusSpec
from tautwave.errors import DeviceFault, DriverError, SettingsDifferError


class Lasts(Enum):
    """How long a device holds what is written to it."""

    LOAN = "until the bus is closed: what was found is given back"
    POWER = "until its power is off: set at every start"
    STORED = "until its power is off, or for good once it is stored: with --configure"
    WRITTEN = "for good: written with --configure, else listed where it differs"


class DeviceSetting(NamedTuple):
    """A value that a device has to hold.

    Parameters
    ----------
    place : Hashable
        What the driver reads and writes it by: a register, an object.
    name : str
        What people call it: `operating mode(11)`.
    wanted : int
        The value, in units of the device.
    lasts : Lasts
        How long the device holds it.
    why : str
        What it is for, in a few words.
    mask : int
        Bits that are compared; the others stay as they are found.
    idle : int, optional
        Value given back of a loan that the device holds already, from a run that was killed.
    readable : bool
        Whether it can be read back.
    show : callable
        Returns a value as text.
    """

    place: Hashable
    name: str
    wanted: int
    lasts: Lasts = Lasts.POWER
    why: str = ""
    mask: int = -1
    idle: int | None = None
    readable: bool = True
    show: Callable[[int], str] = str


class Settled(NamedTuple):
    """What came of a setting: values in the device before and after; None: it has no such place.

    `refusal` is the device's, where it does not let it be read or written.
    """

    before: int | None
    after: int | None
    refusal: SettingRefusedError | None = None


class SettingRefusedError(DeviceFault):
    """A device responds, but lets a place not be read, or not be written."""


class DeviceSettings:
    """The settings of one device.

    Parameters
    ----------
    where : str
        The device, as it begins a sentence.
    read : callable
        Returns what is at a place; raises `SettingRefusedError` where the device has none, and
        another `DriverError` where it does not respond.
    write : callable
        Writes a value to a place; raises alike.
    configure : bool
        Whether lasting settings may be written.
    doubt : str
        Likely cause where something else is read back.
    notes : list of str, optional
        Takes what was written.
    loans : dict, optional
        Values found at the places of loans: kept by the driver where a device may come back.

    Attributes
    ----------
    differences : list of str
        Lasting settings that differ and were not written.
    changed : list of Hashable
        Places of lasting settings that were changed, also where the device was lost before one
        was read back.
    held : dict
        The settings made by `put` and `keep`, and those given to `hold`, that a device forgets
        when its power is off.
    """

    def __init__(
        self,
        where: str,
        read: Callable[[Any], int],
        write: Callable[[Any, int], None],
        *,
        configure: bool = False,
        doubt: str = "is another program on the line?",
        notes: list[str] | None = None,
        loans: dict[Any, int] | None = None,
    ) -> None:
        self.where = where
        self._read = read
        self._write = write
        self._configure = configure
        self._doubt = doubt
        self.loans: dict[Any, int] = {} if loans is None else loans
        self._lent: dict[Any, DeviceSetting] = {}
        self.held: dict[Any, DeviceSetting] = {}
        self.notes: list[str] = [] if notes is None else notes
        self.differences: list[str] = []
        self.changed: list[Any] = []

    def settle(self, setting: DeviceSetting) -> Settled:
        """Read, compare, write if that is allowed, read back; a refusal is returned.

        Raises
        ------
        DriverError
            The device does not respond.
        """
        place, lasts = setting.place, setting.lasts
        try:
            before = self._read(place)
        except SettingRefusedError as err:
            return Settled(None, None, err)
        wanted = before & ~setting.mask | setting.wanted & setting.mask
        if lasts is Lasts.LOAN:
            self._lent[place] = setting
            original = setting.idle if before == wanted else before
            if original is not None and original != wanted:
                # Before it is written: that may be the last act.
                self.loans.setdefault(place, original)
        if before == wanted:
            return Settled(before, before)
        if lasts is Lasts.WRITTEN and not self._configure:
            self.differences.append(f"{self.where}: {_change(setting, before, wanted)}")
            return Settled(before, before)
        counts = lasts in (Lasts.STORED, Lasts.WRITTEN)
        if counts:
            self.changed.append(place)
        after, refusal = before, None
        try:
            self._write(place, wanted)
        except SettingRefusedError as err:
            refusal = err
        else:
            after = self._read(place)
        if counts and after == before:
            self.changed.pop()
        return Settled(before, after, refusal)

    def keep(self, setting: DeviceSetting) -> None:
        """As `settle`, but what may be written has to be taken; a change is noted.

        Raises
        ------
        DriverError
            The device refuses, or holds something else afterwards.
        """
        listed, made = len(self.differences), len(self.changed)
        try:
            settled = self.settle(setting)
        except BaseException:
            if len(self.changed) > made:
                self.notes.append(f"{self.where}: {setting.name} was written, but not read back")
            raise
        if settled.refusal is not None:
            raise settled.refusal
        if settled.before is None or settled.after is None or len(self.differences) > listed:
            return
        wanted = settled.before & ~setting.mask | setting.wanted & setting.mask
        self._compare(setting, settled.after, wanted)
        if settled.before != wanted:
            self.hold(setting._replace(wanted=wanted))
            change = _change(setting, settled.before, wanted)
            self.notes.append(f"{self.where}: {change} written and read back")

    def put(self, setting: DeviceSetting) -> None:
        """Write a setting that the device forgets, whatever it holds, and read it back.

        Raises
        ------
        DriverError
            The device refuses, or holds something else afterwards.
        """
        self._write(setting.place, setting.wanted)
        if setting.readable:
            self._compare(setting, self._read(setting.place), setting.wanted)
            self.hold(setting)

    def hold(self, setting: DeviceSetting) -> None:
        """Register a setting for `forgotten` to read once more, if a power cycle resets it."""
        if setting.lasts is not Lasts.WRITTEN:
            self.held[setting.place] = setting

    def _compare(self, setting: DeviceSetting, found: int, wanted: int) -> None:
        if found != wanted:
            raise DriverError(
                f"{self.where}: {setting.name} reads {found} after {wanted} was written; "
                f"{self._doubt}"
            )

    def forgotten(self) -> list[tuple[DeviceSetting, int]]:
        """Read once more what the device forgets without power; return what it holds instead."""
        values = [(one, self._read(one.place)) for one in self.held.values()]
        return [(one, value) for one, value in values if value != one.wanted]

    def give_back(self) -> None:
        """Set every loan to what was found, as far as the device responds."""
        for place, value in list(self.loans.items()):
            try:
                settled = self.settle(DeviceSetting(place, "", value))
            except DriverError:
                return
            if settled.after == value:
                del self.loans[place]

    def without_loans(self, store: Callable[[], object]) -> None:
        """Give loans back while `store` stores what the device holds, then take them again.

        Raises
        ------
        DeviceFault
            One could not be set again.
        """
        again = [
            self._lent[place]._replace(wanted=self._read(place))
            for place in self.loans
            if place in self._lent
        ]
        self.give_back()
        store()
        for setting in again:
            settled = self.settle(setting)
            if settled.after != setting.wanted:
                shown = "nothing" if settled.after is None else setting.show(settled.after)
                raise DeviceFault(
                    f"{self.where}: {setting.name} is {shown} after "
                    f"{setting.show(setting.wanted)} was written; it was set before its settings "
                    "were stored"
                )


def _change(setting: DeviceSetting, before: int, wanted: int) -> str:
    """Return a change as text."""
    text = f"{setting.name} {setting.show(before)} -> {setting.show(wanted)}"
    return text + (f" ({setting.why})" if setting.why else "")


def refuse_differences(bus: BusSpec, devices: Iterable[DeviceSettings]) -> None:
    """Refuse a bus of which lasting settings differ, with what differs in all its devices.

    Raises
    ------
    SettingsDifferError
        Some do; the loop opens the other buses before it reports it.
    """
    differences = [one for device in devices for one in device.differences]
    if differences:
        raise SettingsDifferError((bus.name,), differences)
