"""Verifying that torque is on, servo by servo, without ever waiting."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BusSpec, BytePort, Clock
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text

FIRST = reg.TORQUE_ENABLE.address
SIZE = reg.HARDWARE_ERROR.address - FIRST + 1
AGAIN_NS = 30_000_000
TRIES = 20


class Enabling:
    """Reads from one servo after the other whether its torque, just switched on, is on.

    `torque_on`, to all of them, goes out before each read: one servo's command may have been lost,
    and the others' watchdogs run while it is asked. Nothing is pending when `step` returns True, so
    that the loop's first request collides with no response.
    """

    def __init__(
        self,
        port: BytePort,
        clock: Clock,
        servos: Sequence[Servo],
        bus: BusSpec,
        torque_on: bytes,
    ) -> None:
        self._port = port
        self._torque_on = torque_on
        self._clock = clock
        self._servos = servos
        self._bus = bus
        self._buffer = bytearray()
        self._at = 0
        self._sent_ns: int | None = None
        self._tries = 0

    def step(self) -> bool:
        """Do one step; return True when every servo has confirmed that it is on.

        Raises
        ------
        DeviceFault
            A servo reports a hardware error.
        DriverError
            A servo does not respond, or stays off.
        """
        self._buffer += self._port.read()
        while (found := packet.take_packet(self._buffer)) is not None:
            self._receive(found)
        if self._at == len(self._servos):
            return True
        now = self._clock.now_ns()
        if self._sent_ns is None or now - self._sent_ns > AGAIN_NS:
            self._send(now)
        return False

    def _receive(self, found: packet.Packet) -> None:
        if self._at == len(self._servos) or self._sent_ns is None:
            return
        servo = self._servos[self._at]
        if found.device_id != servo.options.id or found.instruction != packet.STATUS:
            return
        if len(found.data) != SIZE:
            return  # late, and the response to another request
        self._sent_ns = None
        error = found.data[SIZE - 1]
        if error:
            raise DeviceFault(f"{self._where(servo)}: {hardware_text(error)}; torque stays off")
        if found.data[0]:
            self._at += 1
            self._tries = 0

    def _send(self, now_ns: int) -> None:
        servo = self._servos[self._at]
        self._tries += 1
        if self._tries > TRIES:
            raise DriverError(
                f"{self._where(servo)}: torque does not switch on, or it stopped answering; check "
                "its power and cable"
            )
        self._port.write(self._torque_on + packet.read_packet(servo.options.id, FIRST, SIZE))
        self._sent_ns = now_ns

    def _where(self, servo: Servo) -> str:
        return f"{servo.axis.name} (bus {self._bus.name}, servo {servo.options.id})"
