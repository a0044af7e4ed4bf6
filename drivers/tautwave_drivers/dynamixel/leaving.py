"""Switching servos off: whether one is off is judged by its own report, not by what was sent.

Nothing here goes through the ledger of settings: it ends at the first servo that does not answer,
and here all the others have to be switched off as well. Torque off is read back here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Mapping, Sequence

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.dynamixel.line.transactions import Line
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import status_text

AGAIN_NS, PAUSE_NS = 500_000_000, 50_000_000
"""How long the second try may take, for all servos together, and the pause in between."""


def torque_packet(on: int, ids: Sequence[int]) -> bytes:
    """Return the sync write that switches torque of these servos on or off."""
    pairs = [(device_id, bytes((on,))) for device_id in ids]
    return packet.sync_write_packet(reg.TORQUE_ENABLE.address, 1, pairs)


def leave(
    port: BytePort,
    line: Line,
    goals: bytes,
    servos: Sequence[Servo],
    watched: Collection[str],
    marked: Container[int],
) -> dict[str, str]:
    """Send `goals` and torque off to all at once; return by axis who did not confirm it, and why.

    The bus watchdog of a servo that is off is disarmed, if it is `watched`; else it stops it. The
    LED of a `marked` one goes off.
    """
    names = [servo.axis.name for servo in servos]
    doubtful = {}
    try:
        port.write(goals + torque_packet(0, [servo.options.id for servo in servos]))
        for name, servo in zip(names, servos, strict=True):
            why = _switch_off(line, servo.options.id, watched=name in watched)
            if why:
                text = f"servo {servo.options.id} did not confirm torque off: {why}"
                doubtful[name] = text
            elif servo.options.id in marked:
                line.write(servo.options.id, reg.LED.address, b"\x00")
            names = names[1:]
    except DriverError as err:
        doubtful |= dict.fromkeys(names, str(err))
    return doubtful


def leave_again(
    clock: Clock,
    connect: Callable[[], tuple[BytePort, Line]],
    servos: Sequence[Servo],
    watched: Collection[str],
    marked: Container[int],
    doubtful: Mapping[str, str],
) -> dict[str, str]:
    """Try again, on a line that `connect` opens anew where it is lost; return who is left."""
    left = dict(doubtful)
    until = clock.now_ns() + AGAIN_NS
    while True:
        asked = [servo for servo in servos if servo.axis.name in left]
        try:
            port, line = connect()
        except DriverError as err:
            left |= dict.fromkeys((servo.axis.name for servo in asked), str(err))
        else:
            still_on = leave(port, line, b"", asked, watched, marked)
            left = {name: why for name, why in left.items() if name in still_on} | still_on
        now = clock.now_ns()
        if not left or now + PAUSE_NS >= until:
            return left
        clock.sleep_until(now + PAUSE_NS)


def _switch_off(line: Line, device_id: int, *, watched: bool) -> str:
    """Switch one servo off; return why it is not known to be, '' if it is."""
    register = reg.TORQUE_ENABLE
    response = line.write(device_id, register.address, b"\x00")
    if response is None or response.number:
        return "no answer" if response is None else status_text(response.error)
    still = line.read(device_id, register.address, register.size)
    if still is None or still.number or not still.data:
        return "no answer" if still is None else status_text(still.error)
    if still.data[0]:
        return f"{register.name}({register.address}) still reads {still.data[0]}"
    if watched:
        line.write(device_id, reg.BUS_WATCHDOG.address, b"\x00")
    return ""
