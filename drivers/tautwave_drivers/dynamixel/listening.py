"""Another master on the line, noticed before anything is sent to a servo that it may be moving."""

from __future__ import annotations

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.dynamixel.protocol import packet

LISTEN_NS = 100_000_000
"""A master that moves servos speaks ten times a second at least."""


def refuse_another_master(port: BytePort, clock: Clock, bus: str) -> None:
    """Listen for instructions, which only a master sends; nothing is sent meanwhile.

    Parameters
    ----------
    port : BytePort
        Just opened.
    clock : Clock
        What waits.
    bus : str
        Its name.

    Raises
    ------
    DriverError
        One came.
    """
    port.read()  # bytes from before
    buffer = bytearray()
    until = clock.now_ns() + LISTEN_NS
    while clock.wait(port, until):
        buffer += port.read()
        while (one := packet.take_packet(buffer)) is not None:
            if one.instruction != packet.STATUS:
                raise DriverError(
                    f"bus {bus}: another master sends instructions on this line (to id "
                    f"{one.device_id}), so a servo may be moving; nothing was sent. Stop it, or "
                    "give each master its own line"
                )
