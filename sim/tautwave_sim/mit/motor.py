"""A simulated Damiao motor: frames in and out, its state, its watchdog, its heat.

It speaks only when it is spoken to. Codes are truncated, as its makers' clients do it; they wrap
where a position is beyond its range. After power-up it knows its angle, not its turn. It was
written from the manual and shares nothing with the driver.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.mit import registers as r
from tautwave_sim.mit.options import MotorKeys, Quirks
from tautwave_sim.mit.registers import Registers
from tautwave_sim.physics import NO_LAW, MotorLaw

PARAMETER_ID = 0x7FF
OFF, ON, TIMED_OUT, ROTOR_HOT = 0, 1, 0xD, 0xC
MIT = 1
COUNT_NS = 50_000
"""One count of TIMEOUT."""
KP_TOP, KD_TOP = 500.0, 5.0
AMBIENT = 25.0
HEAT_S, HOTTER = 60.0, 120.0
"""Time constant of the rotor's heat [s], and how much hotter it gets at its greatest torque [K]."""


class Motor:
    """One motor.

    Parameters
    ----------
    keys : MotorKeys
        Its ids and ranges.
    quirks : Quirks
        How it differs.
    name : str
        Of its axis.
    truth : AxisModel
        The axis; its codes are its steps.
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
        self.keys = keys
        self.quirks = quirks
        self.axis = SimulatedAxis(name, truth._replace(effort_quantum=0.0, encoder_quantum=0.0))
        self.registers = Registers(keys, fd, quirks.registers)
        self._send = send
        self._period = truth.period
        self._answers = 0
        self._measured: tuple[float, bool] | None = None
        self.rotor_c = AMBIENT
        self.state = quirks.starts_with
        self.turns = quirks.turns
        self.present = True
        self.free = False
        self.torque = 0.0
        """[N m] Torque of the motor, as commanded."""
        self._order = (0.0, 0.0, 0.0, 0.0, 0.0)
        self.derated = math.inf
        """[N m] Torque beyond which it gives none, whatever its range is."""
        self.heard_ns: int | None = None

    # -- power --------------------------------------------------------------------------------

    def power_on(self, state: int = OFF) -> None:
        """Start: off, with what was saved, and within half a turn of the stored zero."""
        self.registers.power_on()
        self.state = state
        self.heard_ns = None
        self._stop()
        at_motor = self._at_motor(self.axis.physics.x)
        self.turns = -math.floor(at_motor / math.tau + 0.5)

    def fail(self, state: int) -> None:
        """Enter an error state: torque off until it is cleared."""
        self.state = state
        self._stop()

    def _stop(self) -> None:
        self._order = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._act()

    # -- time ---------------------------------------------------------------------------------

    def next_event_ns(self) -> int | None:
        """Return when its watchdog trips, None while nothing will."""
        counts = self.registers.whole(r.TIMEOUT)
        if self.state != ON or not counts or self.heard_ns is None or not self.present:
            return None
        return self.heard_ns + counts * COUNT_NS

    def run(self, now_ns: int) -> None:
        """Trip the watchdog where it is due."""
        due = self.next_event_ns()
        if due is not None and due <= now_ns:
            self.fail(TIMED_OUT)

    def pass_slot(self) -> None:
        """Move by one slot, unless it is held; `settle` follows, when all joints have moved."""
        self._measured = None
        if self.free:
            self.axis.pass_slot()

    def settle(self) -> None:
        """Heat up by a slot, and act where the axis has come to."""
        if not self.free:
            return
        share = self.torque / self.registers[r.T_MAX]
        goal = AMBIENT + HOTTER * self.quirks.heat * share * share
        self.rotor_c += (goal - self.rotor_c) * min(1.0, self._period / HEAT_S)
        if self.rotor_c > self.registers[2] and self.state == ON:
            self.fail(ROTOR_HOT)
        else:
            self._act()  # spring and damper follow where it is now

    # -- frames -------------------------------------------------------------------------------

    def hears(self, can_id: int) -> bool:
        """Return whether a frame may be for it."""
        return self.present and can_id in (PARAMETER_ID, self.registers.whole(r.ESC_ID))

    def receive(self, now_ns: int, can_id: int, data: bytes) -> bool:
        """Take a frame; whether it was a command of its law."""
        if can_id == PARAMETER_ID:
            self._parameter(now_ns, data)
            return False
        if len(data) != 8:
            return False
        self.heard_ns = now_ns
        if data[:7] == bytes((0xFF,) * 7):
            self._special(data[7])
            self._feedback()
            return False
        follows = self.state == ON and self.registers.whole(r.CTRL_MODE) == MIT
        self._feedback()
        if follows:
            self._order = self.decode_order(data)
            self._act()
        return follows

    def _special(self, what: int) -> None:
        if what == 0xFC and self.state == OFF:
            self.state = ON
        elif (what == 0xFD and self.state == ON) or (what == 0xFB and self.state not in (OFF, ON)):
            self.state = OFF
            self._stop()

    def decode_order(self, data: bytes) -> tuple[float, float, float, float, float]:
        """Return position, velocity, kp, kd and torque of a frame, at the motor."""
        bits = int.from_bytes(data, "big")
        p, v = bits >> 48, bits >> 36 & 0xFFF
        kp, kd, t = bits >> 24 & 0xFFF, bits >> 12 & 0xFFF, bits & 0xFFF
        p_max, v_max, t_max = (self.registers[n] for n in (r.P_MAX, r.V_MAX, r.T_MAX))
        return (
            2.0 * p_max * p / 65535.0 - p_max,
            2.0 * v_max * v / 4095.0 - v_max,
            KP_TOP * kp / 4095.0,
            KD_TOP * kd / 4095.0,
            2.0 * t_max * t / 4095.0 - t_max,
        )

    def _act(self) -> None:
        """Give the axis the law, which it follows between slots too.

        Beyond its greatest torque, where the motor is now, it gives that torque for the slot.
        """
        law = NO_LAW
        effort = self.torque = 0.0
        if self.state == ON and self.present:
            p, v, kp, kd, t = self._order
            x = self._at_motor(self.axis.physics.x) + self.turns * math.tau
            speed = self.keys.direction * self.axis.physics.v
            asked = kp * (p - x) + kd * (v - speed) + t if kp or kd else t
            most = min(self.registers[r.T_MAX], self.derated)
            effort = self.torque = min(max(asked, -most), most)
            if (kp or kd) and self.torque == asked:
                place = self.keys.direction * (p - self.keys.zero - self.turns * math.tau)
                law = MotorLaw(kp, place, kd)
                effort = t + kd * v
        self.axis.command(self.keys.direction * effort, law)

    def _feedback(self) -> None:
        """Answer with state, position, velocity, torque and temperatures."""
        position, valid = self.measure()
        if not valid:
            return
        p_max, v_max, t_max = (self.registers[n] for n in (r.P_MAX, r.V_MAX, r.T_MAX))
        x = self._at_motor(position) + self.turns * math.tau
        p = math.floor((x + p_max) / (2.0 * p_max) * 65535.0) & 0xFFFF
        speed = self.keys.direction * self.axis.physics.v if self.free else 0.0
        v = _code(speed, v_max)
        t = _code(self.torque, t_max)
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

    # -- its axis -----------------------------------------------------------------------------

    def _at_motor(self, position: float) -> float:
        """Return the motor's position [rad] of one of the axis, turns apart."""
        return self.keys.direction * position + self.keys.zero

    def measure(self) -> tuple[float, bool]:
        """Sample the encoder, once per slot; whether the sample is there to be sent."""
        if not self.free:
            return self.axis.physics.x, True  # not sampled yet: no random number is used
        if self._measured is None:
            state = self.axis.measure()
            self._measured = state.position, state.valid
        return self._measured


def _code(value: float, top: float) -> int:
    """Return the code of 12 bits of a value, truncated."""
    clipped = min(max(value, -top), top)
    # What is a code already stays that code, whatever its last bit is.
    return math.floor((clipped + top) / (2.0 * top) * 4095.0 + 1e-9)
