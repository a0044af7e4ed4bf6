"""Instructions to one servo alone; those to many at once are the bus' business."""

from __future__ import annotations

from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.dynamixel.servo import Reply, Servo

CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
"""Required by Clear (0x10), so that noise clears nothing."""

RESET_ALL = b"\xff"
RESETS: dict[bytes, tuple[str, ...]] = {
    RESET_ALL: (),
    b"\x01": ("ID",),
    b"\x02": ("ID", "Baud Rate"),
}
"""What Factory Reset (0x06) leaves as it is, by its parameter (protocol 1.0 has none: nothing)."""


def execute(servo: Servo, instruction: int, params: bytes, now_ns: int) -> Reply | None:
    """Execute an instruction and return the servo's reply; None: it stays silent."""
    if instruction == p2.PING:
        return servo.ping()
    if instruction == p2.READ:
        return _read(servo, params, now_ns)
    if instruction in (p2.WRITE, p2.REG_WRITE):
        return _write(servo, instruction, params, now_ns)
    if instruction == p2.ACTION:
        return _action(servo, now_ns)
    if instruction == p2.FACTORY_RESET:
        return _factory_reset(servo, params, now_ns)
    if servo.protocol >= 2.0 and instruction == p2.REBOOT:
        servo.reboot(now_ns)
        return Reply(0)
    if servo.protocol >= 2.0 and instruction == p2.CLEAR:
        return _clear(servo, params)
    return Reply(p2.INSTRUCTION_ERROR)


def _factory_reset(servo: Servo, params: bytes, now_ns: int) -> Reply:
    if servo.protocol < 2.0:
        kept = RESETS[RESET_ALL] if not params else None
    else:
        kept = RESETS.get(params)
    if kept is None:
        return Reply(p2.RANGE_ERROR if len(params) == 1 else p2.LENGTH_ERROR)
    if servo.torque_on:
        return Reply(p2.RESULT_FAIL)
    servo.factory_reset(kept, now_ns)
    return Reply(0)


def _width(servo: Servo) -> int:
    """Return how many bytes an address or a length has."""
    return 2 if servo.protocol >= 2.0 else 1


def _read(servo: Servo, params: bytes, now_ns: int) -> Reply | None:
    wide = _width(servo)
    if len(params) != 2 * wide:
        return Reply(p2.LENGTH_ERROR)
    address = int.from_bytes(params[:wide], "little")
    return servo.read(address, int.from_bytes(params[wide:], "little"), now_ns)


def _write(servo: Servo, instruction: int, params: bytes, now_ns: int) -> Reply:
    wide = _width(servo)
    if len(params) <= wide:
        return Reply(p2.LENGTH_ERROR)
    address = int.from_bytes(params[:wide], "little")
    if instruction == p2.WRITE:
        return servo.write(address, params[wide:], now_ns)
    error, _ = servo.memory.items_of(address, params[wide:])
    if not error:
        servo.memory.registered = (address, params[wide:])
        servo.memory.poke("Registered Instruction", 1)
    return Reply(error)


def _action(servo: Servo, now_ns: int) -> Reply:
    if servo.memory.registered is None:
        return Reply(p2.INSTRUCTION_ERROR)
    address, data = servo.memory.registered
    servo.memory.registered = None
    servo.memory.poke("Registered Instruction", 0)
    return servo.write(address, data, now_ns)


def _clear(servo: Servo, params: bytes) -> Reply:
    if params != CLEAR_TURNS:
        return Reply(p2.RANGE_ERROR)
    return Reply(0 if servo.clear_turns() else p2.RESULT_FAIL)
