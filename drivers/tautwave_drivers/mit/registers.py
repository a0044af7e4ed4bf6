"""Reading and setting registers of motors, before torque: each answer awaited, then compared."""

from __future__ import annotations

import math
from collections.abc import Callable

from tautwave.contracts import Clock, FramePort
from tautwave.errors import BusTimeout, DriverError
from tautwave_drivers.can.errors import error_text
from tautwave_drivers.can.framing import ERROR_FRAME
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damiao import Feedback, Register

TRIES = 5
"""Answers are lost in bursts (enactic/openarm_can); a motor is silent after as many."""
BATCH = 256
"""Frames taken in a row between looks at the clock."""


class Registers:
    """Transactions with the motors of one bus, one at a time.

    Parameters
    ----------
    port : FramePort
        The bus.
    clock : Clock
        What waits.
    timeout_s : float
        [s] How long an answer is waited for, each time.
    """

    def __init__(self, port: FramePort, clock: Clock, timeout_s: float = 0.01) -> None:
        self._port = port
        self._clock = clock
        self._timeout_ns = round(timeout_s * 1e9)
        self.quickest_ns: int | None = None
        """Shortest time from a request to its answer."""

    def read(self, motor_id: int, answer_id: int, register: Register) -> float | None:
        """Return the value of a register, None if the motor does not answer."""
        for _ in range(TRIES):
            answers = self.answers(motor_id, answer_id, register, first=True)
            if answers:
                return answers[0][1]
        return None

    def answers(
        self, motor_id: int, answer_id: int | None, register: Register, *, first: bool = False
    ) -> list[tuple[int, float]]:
        """Return ids and values that answer a read: of all motors that respond, or on one id."""
        heard: list[tuple[int, float]] = []

        def take(can_id: int, data: bytes) -> bool:
            value = None
            if can_id == answer_id or (answer_id is None and can_id != damiao.PARAMETERS):
                value = damiao.register_value(data, motor_id, register)
            if value is not None:
                heard.append((can_id, value))
            return first and value is not None

        self.ask(damiao.PARAMETERS, damiao.read_register(motor_id, register), take)
        return heard

    def need(self, motor_id: int, answer_id: int, register: Register) -> float:
        """Return the value of a register.

        Raises
        ------
        BusTimeout
            The motor does not answer any more.
        DriverError
            It is NaN or infinite.
        """
        value = self.read(motor_id, answer_id, register)
        if value is None:
            raise BusTimeout(
                f"motor {motor_id} stopped answering: {register} cannot be read; check its power "
                "and cable"
            )
        if not math.isfinite(value):
            raise DriverError(
                f"motor {motor_id}: {register} reads {value}, which is not a finite number; set it "
                "again in the maker's tool"
            )
        return value

    def set(self, motor_id: int, answer_id: int, register: Register, value: float) -> float:
        """Set a register until the power is switched off; return what it reads then."""
        value_read = math.nan
        for _ in range(TRIES):
            self._send(damiao.PARAMETERS, damiao.write_register(motor_id, register, value))
            value_read = self.need(motor_id, answer_id, register)
            if value_read == value:
                break
        return value_read

    def told(self, motor_id: int, answer_id: int, order: bytes) -> Feedback | None:
        """Send an order such as disable; return its feedback, None without an answer."""
        for _ in range(TRIES):
            feedbacks: list[Feedback] = []

            def take(can_id: int, data: bytes, heard: list[Feedback] = feedbacks) -> bool:
                feedback = damiao.feedback(data, motor_id) if can_id == answer_id else None
                if feedback is not None:
                    heard.append(feedback)
                return feedback is not None

            self.ask(motor_id, order, take)
            if feedbacks:
                return feedbacks[0]
        return None

    def ask(self, can_id: int, data: bytes, take: Callable[[int, bytes], bool]) -> None:
        """Send a frame and hand over what comes, until `take` has it or the time is up."""
        self._take_in()
        began = self._clock.now_ns()
        self._send(can_id, data)
        until = began + self._timeout_ns
        while self._clock.wait(self._port, until):
            for _ in range(BATCH):
                frame = self._receive()
                if frame is None:
                    break
                if take(*frame):
                    spent = self._clock.now_ns() - began
                    self.quickest_ns = min(spent, self.quickest_ns or spent)
                    return
            if self._clock.now_ns() >= until:
                return

    def _take_in(self) -> None:
        """Discard frames that were received before: they answer no later request."""
        self._clock.wait(self._port, self._clock.now_ns())
        for _ in range(BATCH):
            if self._receive() is None:
                return

    def _receive(self) -> tuple[int, bytes] | None:
        frame = self._port.receive()
        if frame is None:
            return None
        can_id, data, _ = frame
        if can_id & ERROR_FRAME:
            text, lost = error_text(can_id, data)
            if lost:
                raise DriverError(f"CAN: {text}")
        return can_id, data

    def _send(self, can_id: int, data: bytes) -> None:
        for _ in range(20):
            if self._port.send(can_id, data):
                return
            self._clock.sleep_until(self._clock.now_ns() + 1_000_000)
        raise DriverError(
            "CAN: the transmit queue stays full: no node acknowledges; check cable, termination, "
            "power and bit rate"
        )
