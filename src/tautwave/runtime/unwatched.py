"""Sentences on devices without a watchdog and on those that may be left enabled, for any driver."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from tautwave.errors import DeviceFault

if TYPE_CHECKING:
    from tautwave.runtime.sensing import LoopBus


class MayBeEnabledError(DeviceFault):
    """A device did not confirm that it is off; nothing else may be tried."""


class LeftDevices(Protocol):
    """The devices of a bus after they were switched off: a driver, or what a summary has of it."""

    @property
    def watchdog_s(self) -> Mapping[str, float | None]:
        """After what silence [s] each stops by itself."""

    @property
    def unconfirmed(self) -> Mapping[str, str]:
        """Why it may still be enabled, by axis."""


def warning(buses: Sequence[LoopBus], warn: Callable[[str], None]) -> Callable[[], None]:
    """Return a function that warns of devices of open buses that no watchdog stops, each once."""
    warned: set[str] = set()

    def say() -> None:
        for bus in buses:
            for name, does in bus.driver.unwatched.items():
                sentence = (
                    f"UNWATCHED: {name} {does}; if this program stops, only the emergency "
                    "stop ends its torque: keep a hand on it"
                )
                if sentence not in warned:
                    warned.add(sentence)
                    warn(sentence)

    return say


def may_be_enabled(buses: Iterable[LeftDevices]) -> str:
    """Return a sentence about every device that did not confirm that it is off; '' if all did."""
    return "; ".join(
        f"{name} may still be enabled ({why}): {_own(bus, name)}"
        for bus in buses
        for name, why in bus.unconfirmed.items()
    )


def refuse_enabled(buses: Sequence[LoopBus], ended: BaseException | None) -> None:
    """Refuse the end of a procedure, by itself or by an error, at which a device may be enabled.

    Raises
    ------
    MayBeEnabledError
        One did not confirm that it is off.
    """
    sentence = may_be_enabled(bus.driver for bus in buses)
    if sentence:
        raise MayBeEnabledError(f"{ended}; {sentence}" if ended else sentence) from ended


def _own(bus: LeftDevices, name: str) -> str:
    """Return what switches off the torque of a device that cannot be reached."""
    seconds = bus.watchdog_s.get(name)
    if seconds is None:
        return "nothing stops it by itself; cut its power"
    return f"its own time-out of {seconds:g} s should have stopped it; check, or cut its power"
