"""What shows that a servo has forgotten what was set in it: torque enable, errors, watchdog.

A servo whose supply dips comes back with its torque off and its watchdog off, and answers as if
nothing had happened. The registers that show it lie in RAM.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text

INDIRECT = reg.Register("indirect addresses", reg.INDIRECT_ADDRESS, 2 * reg.STATUS_BYTES)

TORQUE = reg.Register(
    "torque enable and hardware error status",
    reg.TORQUE_ENABLE.address,
    reg.HARDWARE_ERROR.address - reg.TORQUE_ENABLE.address + 1,
)
"""The block whose first byte is the one, and the last the other."""

STATE = TORQUE._replace(size=reg.BUS_WATCHDOG.address - reg.TORQUE_ENABLE.address + 1)
"""The same up to the bus watchdog."""


class Errors(NamedTuple):
    """What a servo does about hardware errors: those tolerated, and its Shutdown(63)."""

    tolerated: int = 0
    shutdown: int | None = None


Remembered = Mapping[reg.Register, bytes]
"""What a servo held when it was enabled, by blocks that one read takes."""

FORGETS_NS = 20_000_000
"""No servo starts faster: one that answered within this time has not been switched off."""

AGAIN = (
    "it was switched off and on, or another program wrote to it; check its supply, then enable it"
)


def remembered_blocks(*, mapped: bool) -> Iterator[reg.Register]:
    """Yield the blocks of what a run relies on; `mapped`: with the indirect addresses."""
    for group in reg.KEPT:
        names = ", ".join(register.name for register in group)
        yield reg.Register(
            names, group[0].address, group[-1].address + group[-1].size - group[0].address
        )
    if mapped:
        yield INDIRECT


def memory_fault(block: reg.Register, found: bytes, held: bytes) -> str:
    """Return which register of a block differs from what it held, as text; '' if none does."""
    group = next((one for one in reg.KEPT if one[0].address == block.address), ())
    for register in group:
        at = register.address - block.address
        now, before = register.decode(found[at:]), register.decode(held[at:])
        if register == reg.BUS_WATCHDOG and now == reg.WATCHDOG_TRIPPED != before:
            return watchdog_fault(now, before)
        if now != before:
            return f"{register.name}({register.address}) reads {now} instead of {before}: {AGAIN}"
    return "" if found == held or group else f"its {block.name} are not as they were set: {AGAIN}"


def state_register(armed: int | None) -> reg.Register:
    """Return all of a servo's state, `armed` its bus watchdog or None without one."""
    return TORQUE if armed is None else STATE


def state_fault(data: bytes, armed: int | None, errors: Errors) -> str:
    """Return what is not as it was set in the state of a servo, as text; '' if nothing."""
    text = torque_fault(data[0], data[TORQUE.size - 1], errors)
    if not text and armed is not None:
        text = watchdog_fault(reg.BUS_WATCHDOG.decode(data[STATE.size - 1 :]), armed)
    return text


def torque_fault(torque: int, error: int, errors: Errors) -> str:
    """Return what torque enable and hardware error say, as text; '' if torque is on."""
    if error & ~errors.tolerated:
        text = hardware_text(error, errors.shutdown)
        return f"{text} (hardware error status {error:#04x})"
    return "" if torque == 1 else f"torque enable(64) reads {torque} instead of 1: {AGAIN}"


def marker_fault(data: bytes) -> str:
    """Return what the LED in a servo's state means where it was switched on as a marker."""
    led = data[reg.LED.address - TORQUE.address]
    return "" if led == 1 else f"led(65) reads {led} instead of 1: {AGAIN}"


def watchdog_fault(found: int, armed: int, silence: str = "") -> str:
    """Return what a bus watchdog other than `armed` means, as text; '' if it is armed."""
    if found == armed:
        return ""
    if found == reg.WATCHDOG_TRIPPED:
        return (
            f"its bus watchdog tripped{silence}: it has stopped, and ignores goals until it is "
            "enabled again"
        )
    return f"bus watchdog(98) reads {found} instead of {armed}: {AGAIN}"
