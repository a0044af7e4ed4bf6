"""Error frames as text, and the error for an interface that is down or gone.

Source: <linux/can/error.h>.
"""

from __future__ import annotations

import os

from tautwave.errors import DriverError

_ERROR_MASK = 0x1FFFFFFF


def gone(where: str, err: OSError | None = None) -> DriverError:
    """Return the error for an interface that is down or gone."""
    why = "" if err is None else f" ({os.strerror(err.errno) if err.errno else err})"
    return DriverError(
        f"CAN interface {where} is down or gone{why}; check its cable and `ip link show`, then "
        f"bring it up again (ip link set {where} up type can bitrate ...)"
    )


_ERRORS = (
    (0x00000001, "transmit timeout"),
    (0x00000002, "arbitration lost"),
    (0x00000008, "protocol violation"),
    (0x00000010, "transceiver error"),
    (0x00000020, "no acknowledge: no other node on the bus, or a wrong bit rate"),
    (0x00000080, "bus error"),
)
_CONTROLLER = (
    (0x01, "receive overflow: frames lost"),
    (0x02, "transmit overflow"),
    (0x04, "receive warning level"),
    (0x08, "transmit warning level"),
    (0x10, "error passive (receiving)"),
    (0x20, "error passive (transmitting)"),
    (0x40, "error active again"),
)
_BUS_OFF, _CONTROLLER_BIT, _RESTARTED = 0x40, 0x04, 0x100
_PASSIVE = 0x30


def error_text(can_id: int, data: bytes) -> tuple[str, bool]:
    """Return an error frame as text, and whether the bus is lost."""
    if can_id & _BUS_OFF:
        return (
            "bus-off: the controller has left the bus after too many errors; check wiring, "
            "termination and bit rate, then restart the interface (ip link set ... restart-ms)",
            True,
        )
    words = [text for bit, text in _ERRORS if can_id & bit]
    if can_id & _CONTROLLER_BIT:
        status = data[1] if len(data) > 1 else 0
        words += [text for bit, text in _CONTROLLER if status & bit]
        if status & _PASSIVE:
            words.append("check wiring and termination before it goes bus-off")
    if can_id & _RESTARTED:
        words.append("controller restarted")
    return "; ".join(words) or f"error frame 0x{can_id & _ERROR_MASK:08X}", False
