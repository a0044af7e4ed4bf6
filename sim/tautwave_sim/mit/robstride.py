"""A simulated RobStride motor in its private protocol: 29-bit ids, parameters in numbers.

It speaks when it is spoken to, and once when it fails. Bytes of motion are big-endian, parameters
little-endian. It knows who asks: answers go to the host of the last frame that named one. It was
written from the manuals and shares nothing with the driver.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from tautwave.truth import AxisModel
from tautwave_sim.mit.body import KD_TOP, KP_TOP, Body, Order, code, of_code
from tautwave_sim.mit.options import MotorKeys, Quirks
from tautwave_sim.wire.can import EXTENDED

GET_ID, MOTION, FEEDBACK, ENABLE, STOP, ZERO, SET_ID = 0, 1, 2, 3, 4, 6, 7
READ, WRITE, FAULTS, SAVE = 17, 18, 21, 22
RESET, RUN = 0, 2
HOT = 4
"""The bit of the fault "too hot"."""
HOT_C = 145.0
BROADCAST = 0xFE
CODES = 0xFFFF
COUNT_NS = 50_000
"""One count of the CAN timeout."""
RUN_MODE, TORQUE_LIMIT, POSITION, VELOCITY, VOLTAGE, SILENCE = (
    0x7005, 0x700B, 0x7019, 0x701B, 0x701C, 0x7028,
)  # fmt: skip
MEASURED = frozenset((POSITION, VELOCITY, VOLTAGE))
"""Parameters that cannot be written."""
FORMS = {RUN_MODE: "<Bxxx", SILENCE: "<I"}
"""How parameters are packed that are no float32."""
FROM_THE_MAKER = {
    RUN_MODE: 0, 0x7006: 0.0, 0x700A: 0.0, 0x7010: 0.05, 0x7011: 0.05, 0x7014: 0.06,
    0x7016: 0.0, 0x7017: 10.0, 0x7018: 16.0, 0x701A: 0.0, VOLTAGE: 24.0, 0x701E: 40.0,
    0x701F: 6.0, 0x7020: 0.02, 0x7021: 0.1, SILENCE: 0,
}  # fmt: skip
"""What a new motor holds beside its torque limit; its CAN timeout is off."""


class RobstrideMotor(Body):
    """One motor; parameters as of `Body`, and its place on the bus.

    Parameters
    ----------
    send : callable
        Sends a frame: identifier, data, and whether it is an FD frame.
    """

    def __init__(
        self,
        keys: MotorKeys,
        quirks: Quirks,
        name: str,
        truth: AxisModel,
        send: Callable[[int, bytes, bool], object],
    ) -> None:
        saved = {**FROM_THE_MAKER, TORQUE_LIMIT: keys.t_max, **quirks.registers}
        self._saved: dict[int, float] = saved
        self._now = dict(saved)
        self.mode = RESET
        self.faults = quirks.starts_with
        super().__init__(keys, quirks, name, truth)
        self._send = send
        self._answers = 0
        self.id = keys.id
        self._host = keys.feedback_id
        self._zero = 0.0

    # -- power and time -----------------------------------------------------------------------

    @property
    def on(self) -> bool:
        """Whether it follows commands."""
        return self.mode == RUN

    def power_on(self) -> None:
        """Start: off, with what was saved, and within half a turn of the stored zero."""
        self._now = dict(self._saved)
        self.mode, self.faults = RESET, 0
        self._restart()

    def fail(self, state: int) -> None:
        """Have faults, as bits: torque off until they are cleared; it says so by itself."""
        self.mode, self.faults = RESET, state
        self._halt()
        self._answer(FAULTS, struct.pack("<II", state, 0))

    def _silence_ns(self) -> int:
        return int(self._now[SILENCE]) * COUNT_NS

    def _time_out(self) -> None:
        self.mode = RESET
        self._halt()

    def _overheat(self) -> bool:
        hot = self.rotor_c > HOT_C and self.on
        if hot:
            self.fail(HOT)
        return hot

    def _most(self) -> float:
        return min(self.keys.t_max, abs(self._now[TORQUE_LIMIT]))

    # -- frames -------------------------------------------------------------------------------

    def hears(self, can_id: int) -> bool:
        """Return whether a frame may be for it."""
        return self.present and bool(can_id & EXTENDED) and can_id & 0xFF == self.id

    def commands(self, can_id: int, data: bytes) -> bool:
        """Return whether a frame that it hears is a command of its law."""
        return can_id >> 24 & 0x1F == MOTION

    def receive(self, now_ns: int, can_id: int, data: bytes) -> None:
        """Take a frame, and answer it."""
        kind, field = can_id >> 24 & 0x1F, can_id >> 8 & 0xFFFF
        if len(data) != 8:
            return
        self.heard_ns = now_ns
        if kind == MOTION:
            self._feedback()
            if self.on and self._now[RUN_MODE] == 0:
                self._order = self.decode_order(field, data)
                self._act()
            return
        self._host = field & 0xFF
        if kind == GET_ID:
            self._tell_id()
        elif kind == SET_ID:
            self.id = field >> 8
            self._tell_id()
        elif kind == READ:
            self._tell(int.from_bytes(data[:2], "little"))
        elif kind in (ENABLE, STOP, ZERO, WRITE, SAVE):
            self._obey(kind, data)
            self._feedback()

    def _obey(self, kind: int, data: bytes) -> None:
        if kind == ENABLE and not self.faults:
            self.mode = RUN
        elif kind == STOP:
            self.mode = RESET
            self.faults = 0 if data[0] else self.faults
            self._halt()
        elif kind == ZERO and data[0] == 1:
            self._zero = self._at_motor(self.axis.physics.x)
            self.turns = 0
        elif kind == WRITE:
            number = int.from_bytes(data[:2], "little")
            deaf = number == SILENCE and self.quirks.ignores_timeout
            if number in self._now and number not in MEASURED and not deaf:
                (self._now[number],) = struct.unpack(FORMS.get(number, "<f"), data[4:])
        elif kind == SAVE:
            self._saved = dict(self._now)

    def decode_order(self, torque: int, data: bytes) -> Order:
        """Return what a command orders."""
        p, v, kp, kd = struct.unpack(">HHHH", data)
        keys = self.keys
        return Order(
            of_code(p, keys.p_max, CODES) + self._zero,
            of_code(v, keys.v_max, CODES),
            KP_TOP * kp / CODES,
            KD_TOP * kd / CODES,
            of_code(torque, keys.t_max, CODES),
        )

    def _feedback(self) -> None:
        """Answer with position, velocity, torque and temperature; mode and faults in its id."""
        position, speed, valid = self._read()
        if not valid:
            return
        keys = self.keys
        said = struct.pack(
            ">HHHH",
            code(position - self._zero, keys.p_max, CODES),
            code(speed, keys.v_max, CODES),
            code(self.torque, keys.t_max, CODES),
            int(10.0 * self.rotor_c),
        )
        self._answer(FEEDBACK, said, self.mode << 6 | self.faults)

    def _tell(self, number: int) -> None:
        """Answer with a parameter, where there is one."""
        self._answers += 1
        every = self.quirks.drops_register_answers
        if every and self._answers % every == 0:
            return
        position, speed, _ = self._read()
        here = {POSITION: position - self._zero, VELOCITY: speed}
        value = here.get(number, self._now.get(number))
        if value is None:
            return
        form = FORMS.get(number, "<f")
        packed = struct.pack(form, value if form == "<f" else int(value))
        self._answer(READ, struct.pack("<HH", number, 0) + packed)

    def _tell_id(self) -> None:
        unique = struct.pack("<II", 0x52530000 | self.keys.id, self.keys.id)
        self._send(EXTENDED | GET_ID << 24 | self.id << 8 | BROADCAST, unique, False)

    def _answer(self, kind: int, data: bytes, said: int = 0) -> None:
        self._send(EXTENDED | kind << 24 | said << 16 | self.id << 8 | self._host, data, False)
