"""What no watchdog guards, and what may still be enabled: said the same way for every driver."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave.errors import DeviceFault
from tautwave.runtime.sensing import LoopBus


def warning(buses: Sequence[LoopBus], warn: Callable[[str], None]) -> Callable[[], None]:
    """Return a function that warns of devices of open buses that no watchdog stops, each once."""
    said: set[str] = set()

    def say() -> None:
        for bus in buses:
            for name, does in bus.driver.unwatched.items():
                sentence = (
                    f"UNWATCHED: {name} {does}; if this program stops, only the emergency "
                    "stop ends its torque: keep a hand on it"
                )
                if sentence not in said:
                    said.add(sentence)
                    warn(sentence)

    return say


def may_be_enabled(buses: Sequence[LoopBus]) -> str:
    """Return a sentence about every device that did not confirm that it is off; '' if all did."""
    return "; ".join(
        f"{name} may still be enabled ({why}): {_own(bus, name)}"
        for bus in buses
        for name, why in bus.driver.unconfirmed.items()
    )


def refuse_enabled(buses: Sequence[LoopBus], ended: BaseException | None) -> None:
    """Refuse the end of a procedure, by itself or by an error, at which a device may be enabled.

    Raises
    ------
    DeviceFault
        One did not confirm that it is off.
    """
    sentence = may_be_enabled(buses)
    if sentence:
        raise DeviceFault(f"{sentence}; before that: {ended}" if ended else sentence) from ended


def _own(bus: LoopBus, name: str) -> str:
    """Return what ends the torque of a device that is not reached."""
    seconds = bus.driver.watchdog_s.get(name)
    if seconds is None:
        return "nothing stops it by itself; cut its power"
    return f"its own time-out of {seconds:g} s should have stopped it; check, or cut its power"
