"""What shows that a servo has forgotten what was set in it: torque enable, errors, watchdog.

A servo whose supply dips comes back with its torque off and its watchdog off, and answers as if
nothing had happened. The registers that show it lie in RAM.
"""

from __future__ import annotations

from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text

TORQUE = reg.Register(
    "torque enable and hardware error status",
    reg.TORQUE_ENABLE.address,
    reg.HARDWARE_ERROR.address - reg.TORQUE_ENABLE.address + 1,
)
"""The block whose first byte is the one, and the last the other."""

STATE = TORQUE._replace(size=reg.BUS_WATCHDOG.address - reg.TORQUE_ENABLE.address + 1)
"""The same up to the bus watchdog."""

FORGETS_NS = 20_000_000
"""No servo starts faster: one that answered within this time has not been switched off."""

AGAIN = "it was switched off and on, or another program wrote to it; check its supply; run again"


def state_register(armed: int | None) -> reg.Register:
    """Return all of a servo's state, `armed` its bus watchdog or None without one."""
    return TORQUE if armed is None else STATE


def state_fault(data: bytes, armed: int | None) -> str:
    """Return what is not as it was set in the state of a servo, as text; '' if nothing."""
    text = torque_fault(data[0], data[TORQUE.size - 1])
    if not text and armed is not None:
        text = watchdog_fault(reg.BUS_WATCHDOG.decode(data[STATE.size - 1 :]), armed)
    return text


def torque_fault(torque: int, error: int) -> str:
    """Return what torque enable and hardware error say, as text; '' if torque is on."""
    if error:
        return (
            f"{hardware_text(error)} (hardware error status {error:#04x}); the run stops; its "
            "torque may stay off until it is power-cycled"
        )
    return "" if torque == 1 else f"torque enable(64) reads {torque} instead of 1: {AGAIN}"


def watchdog_fault(found: int, armed: int, silence: str = "") -> str:
    """Return what a bus watchdog other than `armed` means, as text; '' if it is armed."""
    if found == armed:
        return ""
    if found == reg.WATCHDOG_TRIPPED:
        return (
            f"its bus watchdog tripped{silence}: it has stopped and ignores goals; the run stops; "
            "the next run rearms it"
        )
    return f"bus watchdog(98) reads {found} instead of {armed}: {AGAIN}"
