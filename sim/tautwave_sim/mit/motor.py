"""A simulated Damiao motor: frames in and out, its state, its registers.

It speaks only when it is spoken to. Codes are truncated, as its makers' clients do it; they wrap
where a position is beyond its range. After power-up it knows its angle, not its turn. It was
written from the manual and shares nothing with the driver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

from tautwave.truth import AxisModel
from tautwave_sim.mit import registers as r
from tautwave_sim.mit.body import KD_TOP, KP_TOP, Body, Order, code, of_code
from tautwave_sim.mit.options import MotorKeys, Quirks
from tautwave_sim.mit.registers import Registers

PARAMETER_ID = 0x7FF
OFF, ON, TIMED_OUT, ROTOR_HOT = 0, 1, 0xD, 0xC
MIT = 1
COUNT_NS = 50_000
"""One count of TIMEOUT."""
POSITIONS, OTHERS = 65535, 4095
"""Codes beyond 0: of a position, of anything else."""
SPECIAL = bytes((0xFF,) * 7)


class Motor(Body):
    """One motor; parameters as of `Body`, and its place on the bus.

    Parameters
    ----------
    fd : bool
        The bus is one of CAN FD.
    send : callable
        Sends a frame: identifier, data, and whether it is an FD frame.
    """

    def __init__(
        self,
        keys: MotorKeys,
        quirks: Quirks,
        name: str,
        truth: AxisModel,
        fd: bool,
        send: Callable[[int, bytes, bool], object],
    ) -> None:
        self.registers = Registers(keys, fd, quirks.registers)
        self.state = quirks.starts_with
        super().__init__(keys, quirks, name, truth)
        self._send = send
        self._answers = 0

    # -- power and time -----------------------------------------------------------------------

    @property
    def on(self) -> bool:
        """Whether it follows commands."""
        return self.state == ON

    def power_on(self) -> None:
        """Start: off, with what was saved, and within half a turn of the stored zero."""
        self.registers.power_on()
        self.state = OFF
        self._restart()

    def fail(self, state: int) -> None:
        """Enter an error state: torque off until it is cleared."""
        self.state = state
        self._halt()

    def _silence_ns(self) -> int:
        return self.registers.whole(r.TIMEOUT) * COUNT_NS

    def _time_out(self) -> None:
        self.fail(TIMED_OUT)

    def _overheat(self) -> bool:
        hot = self.rotor_c > self.registers[2] and self.state == ON
        if hot:
            self.fail(ROTOR_HOT)
        return hot

    def _most(self) -> float:
        return self.registers[r.T_MAX]

    # -- frames -------------------------------------------------------------------------------

    def ids(self) -> Collection[int]:
        """Return the identifiers of what it hears."""
        return PARAMETER_ID, self.registers.whole(r.ESC_ID)

    def hears(self, can_id: int) -> bool:
        """Return whether a frame may be for it."""
        return self.present and can_id in self.ids()

    def commands(self, can_id: int, data: bytes) -> bool:
        """Return whether a frame that it hears is a command of its law."""
        return can_id == self.keys.id and data[:7] != SPECIAL

    def receive(self, now_ns: int, can_id: int, data: bytes) -> None:
        """Take a frame, and answer it."""
        if can_id == PARAMETER_ID:
            self._parameter(now_ns, data)
            return
        if len(data) != 8:
            return
        self.heard_ns = now_ns
        if data[:7] == SPECIAL:
            self._special(data[7])
            self._feedback()
            return
        follows = self.state == ON and self.registers.whole(r.CTRL_MODE) == MIT
        self._feedback()
        if follows:
            self._order = self.decode_order(data)
            self._act()

    def _special(self, what: int) -> None:
        if what == 0xFC and self.state == OFF:
            self.state = ON
        elif (what == 0xFD and self.state == ON) or (what == 0xFB and self.state not in (OFF, ON)):
            self.state = OFF
            self._halt()

    def decode_order(self, data: bytes) -> Order:
        """Return what a frame orders."""
        bits = int.from_bytes(data, "big")
        p_max, v_max, t_max = (self.registers[n] for n in (r.P_MAX, r.V_MAX, r.T_MAX))
        return Order(
            of_code(bits >> 48, p_max, POSITIONS),
            of_code(bits >> 36 & 0xFFF, v_max, OTHERS),
            KP_TOP * (bits >> 24 & 0xFFF) / OTHERS,
            KD_TOP * (bits >> 12 & 0xFFF) / OTHERS,
            of_code(bits & 0xFFF, t_max, OTHERS),
        )

    def _feedback(self) -> None:
        """Answer with state, position, velocity, torque and temperatures."""
        position, speed, valid = self._read()
        if not valid:
            return
        p_max, v_max, t_max = (self.registers[n] for n in (r.P_MAX, r.V_MAX, r.T_MAX))
        p = math.floor((position + p_max) / (2.0 * p_max) * POSITIONS) & 0xFFFF
        v = code(speed, v_max, OTHERS)
        t = code(self.torque, t_max, OTHERS)
        own = self.registers.whole(r.ESC_ID) & 0xF
        head = bytes((self.state << 4 | own, p >> 8, p & 0xFF, v >> 4))
        tail = bytes((30, min(255, math.floor(self.rotor_c))))
        self._answer(head + bytes(((v & 0xF) << 4 | t >> 8, t & 0xFF)) + tail)

    def _parameter(self, now_ns: int, data: bytes) -> None:
        if len(data) < 4 or int.from_bytes(data[:2], "little") != self.registers.whole(r.ESC_ID):
            return
        self.heard_ns = now_ns
        kind, number = data[2], data[3]
        if kind == 0xCC:
            self._feedback()
            return
        if kind == 0xAA:
            self.registers.save()
            self._answer(data[:2] + bytes((0xAA, number, 0, 0, 0, 0)))
            return
        if kind not in (0x33, 0x55):
            return
        deaf = number == r.TIMEOUT and self.quirks.ignores_timeout
        if kind == 0x55 and len(data) == 8 and not deaf:
            self.registers.write(number, data[4:])
        value = self.registers.read(number)
        if value is None:
            return
        self._answers += 1
        every = self.quirks.drops_register_answers
        if every and self._answers % every == 0:
            return
        # A write is answered with what was written, whether it took or not.
        self._answer(data[:4] + (data[4:8] if kind == 0x55 else value))

    def _answer(self, data: bytes) -> None:
        fd = self.registers.whole(r.CAN_BR) >= 5
        self._send(self.registers.whole(r.MST_ID), data, fd)
