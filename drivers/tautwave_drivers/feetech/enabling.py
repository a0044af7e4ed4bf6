"""Switching torque on and verifying that it is, servo by servo, without waiting.

Torque goes on only in a servo that has just said that it is off, in its mode, limited and with no
goal: one that was switched off and on meanwhile is in another mode, with another goal.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers import protocol1
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.bringup import AGAIN
from tautwave_drivers.feetech.options import Servo
from tautwave_drivers.feetech.tables import STATE, status_text

AGAIN_NS = 30_000_000
FRESH_NS = 20_000_000
"""No servo starts faster: one that answered within this time has not been switched off since."""
TRIES = 20

_FIELDS = struct.Struct("<B6xBxHH2xH5xBH")
"""`STATE`: mode, torque, goals of position and effort, torque limit, lock, position."""
assert _FIELDS.size == STATE.size


class State(NamedTuple):
    """What a servo holds [counts, as its registers hold them]."""

    mode: int
    torque: int
    goal_position: int
    goal: int
    limit: int
    lock: int
    position: int


class Enabling:
    """Switches on one servo after the other, and reads whether its torque is on.

    Parameters
    ----------
    port : Unechoed
        The line.
    clock : Clock
        Its time.
    servos : sequence of Servo
        What is on it.
    limits : sequence of int
        The torque limit(48) that each was given.
    bus : BusSpec
        For messages.
    """

    def __init__(
        self,
        port: Unechoed,
        clock: Clock,
        servos: Sequence[Servo],
        limits: Sequence[int],
        bus: BusSpec,
    ) -> None:
        self._port = port
        self._clock = clock
        self._servos = servos
        self._limits = limits
        self._bus = bus
        self._buffer = bytearray()
        self._at = self._tries = 0
        self._sent_ns = clock.now_ns()
        self._pending = False
        port.read()

    def step(self) -> bool:
        """Do one step; return whether every servo has confirmed that it is on.

        Raises
        ------
        DeviceFault
            A servo reports an error, or is not as it was set.
        DriverError
            A servo does not answer, or stays off.
        """
        while self._at < len(self._servos):
            self._take_in()
            now = self._clock.now_ns()
            if self._at == len(self._servos):
                break
            if self._pending and now - self._sent_ns <= AGAIN_NS:
                return False
            if not self._pending:
                self._send(b"", now)
                if 2 * self._bus.period_ns > FRESH_NS:  # by the next step its answer is too old
                    self._await(now + FRESH_NS)
                return False
            self._pending = False
        return True

    def _await(self, until_ns: int) -> None:
        sent_ns = self._sent_ns
        while self._pending and self._sent_ns == sent_ns and self._clock.wait(self._port, until_ns):
            self._take_in()

    def _take_in(self) -> None:
        self._buffer += self._port.read()
        while (response := protocol1.take_packet(self._buffer)) is not None:
            if self._at == len(self._servos):
                return
            servo = self._servos[self._at]
            mine = self._pending and response.device_id == servo.options.id
            if mine and len(response.data) == STATE.size:
                self._pending = False
                self._judge(servo, State(*_FIELDS.unpack(response.data)), response.error)

    def _judge(self, servo: Servo, state: State, error: int) -> None:
        """See whether a servo is as it was set; switch it on if it is off."""
        if error:
            raise DeviceFault(f"{self._where(servo)}: {status_text(error)} (status {error:#04x})")
        expected = {
            "mode(33)": servo.mode,
            "torque limit(48)": self._limits[self._at],
            "lock(55)": 1,
        }
        if servo.impedance:
            expected["its goal(44)"] = 0
        settings = (state.mode, state.limit, state.lock, state.goal)
        for (name, wanted), held in zip(expected.items(), settings, strict=False):
            if held != wanted:
                raise DeviceFault(
                    f"{self._where(servo)}: {name} reads {held} instead of {wanted}: {AGAIN}"
                )
        if state.torque == tables.ON:
            self._at += 1
            self._tries = 0
            return
        now = self._clock.now_ns()
        if now - self._sent_ns > FRESH_NS:
            return  # it may have been switched off and on since: it is asked again
        orders = b""
        number = servo.options.id
        if not servo.impedance:  # it holds where it stands now
            place = tables.GOAL_POSITION.address
            data = state.position.to_bytes(2, "little")
            orders = protocol1.sync_write_packet(place, 2, [(number, data)])
        on = protocol1.sync_write_packet(tables.TORQUE.address, 1, [(number, b"\x01")])
        self._send(orders + on, now)

    def _send(self, orders: bytes, now_ns: int) -> None:
        servo = self._servos[self._at]
        self._tries += 1
        if self._tries > TRIES:
            raise DriverError(
                f"{self._where(servo)}: torque does not switch on, or it stopped answering; check "
                "its power and cable"
            )
        read = protocol1.read_packet(servo.options.id, STATE.address, STATE.size)
        self._port.write(orders + read)
        self._sent_ns = now_ns
        self._pending = True

    def _where(self, servo: Servo) -> str:
        return f"{servo.axis.name} (bus {self._bus.name}, servo {servo.options.id})"
