"""Switching servos off: torque off to all at once, then each one's own report.

The order goes to all servos on the line, listed or not: nothing else stops a servo that no one
watches.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers import protocol1
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.line import ServoLine
from tautwave_drivers.feetech.options import Servo

AGAIN_NS, PAUSE_NS = 500_000_000, 50_000_000
"""How long the second try may take, for all servos together, and the pause in between."""


def stop_packet(value: int) -> bytes:
    """Return the order to all servos of a line to switch torque off; none answers."""
    return protocol1.write_packet(protocol1.BROADCAST, tables.TORQUE.address, bytes((value,)))


def leave(line: ServoLine, goals: bytes, servos: Sequence[Servo], stop: int) -> dict[str, str]:
    """Send `goals` and torque off to all; return by axis who did not confirm it, and why."""
    names = [servo.axis.name for servo in servos]
    doubtful = {}
    try:
        line.tell(goals + stop_packet(stop) + stop_packet(stop))
        for name, servo in zip(list(names), servos, strict=True):
            why = _switched_off(line, servo.options.id, stop)
            if why:
                doubtful[name] = f"servo {servo.options.id} did not confirm torque off: {why}"
            names = names[1:]
    except DriverError as err:
        doubtful |= dict.fromkeys(names, str(err))
    return doubtful


def leave_again(
    clock: Clock,
    connect: Callable[[], ServoLine],
    servos: Sequence[Servo],
    stop: int,
    doubtful: Mapping[str, str],
) -> dict[str, str]:
    """Try again, on a line that `connect` opens anew where it is lost; return who is left."""
    left = dict(doubtful)
    until = clock.now_ns() + AGAIN_NS
    while True:
        asked = [servo for servo in servos if servo.axis.name in left]
        try:
            line = connect()
        except DriverError as err:
            left |= dict.fromkeys((servo.axis.name for servo in asked), str(err))
        else:
            left = leave(line, b"", asked, stop)
        now = clock.now_ns()
        if not left or now + PAUSE_NS >= until:
            return left
        clock.sleep_until(now + PAUSE_NS)


def _switched_off(line: ServoLine, device_id: int, stop: int) -> str:
    """Return why one servo is not known to be off, '' if it is."""
    response = line.read(device_id, tables.TORQUE)
    if response is not None and response.data[0] != stop:
        line.write(device_id, tables.TORQUE, stop)
        response = line.read(device_id, tables.TORQUE)
    if response is None:
        return "no answer"
    if response.data[0] != stop:
        return f"{tables.TORQUE} still reads {response.data[0]}"
    return ""
