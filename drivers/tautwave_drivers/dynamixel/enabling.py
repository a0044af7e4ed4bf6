"""Switching torque on and verifying that it is and stays on, servo by servo.

A step waits only for an answer that would be too old by the next one, as on a slow bus.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence

from tautwave.contracts import BusSpec, BytePort, Clock
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text
from tautwave_drivers.dynamixel.state import (
    FORGETS_NS,
    TORQUE,
    Errors,
    marker_fault,
    state_fault,
    state_register,
    watchdog_fault,
)

AGAIN_NS = 30_000_000
TRIES = 20
MIN_PERIODS = 2
"""Between two reads of servos that are on: other buses have to find this one ready in between."""


class Enabling:
    """Switches on one servo after the other, and reads whether its torque is on.

    `torque_on` goes out only to one that has just said that it is off and its bus watchdog armed:
    one that was switched off and on would come on unwatched. It is repeated only after another such
    answer, and never to one that has confirmed. While other buses are enabled it goes on reading,
    so that none forgets unseen. Nothing is pending when `step` returns True: the loop's first
    request collides with no response.

    Parameters
    ----------
    port, clock, servos, bus
        The line and what is on it.
    torque_on : callable
        Returns the packet that switches on the servos with these ids.
    feed : bytes
        Packet to all servos that keeps their watchdogs from tripping.
    feed_ns : int
        Longest time between two of them [ns].
    armed, errors
        Each servo's bus watchdog, and what it does about hardware errors.
    marked : container of int
        Ids of those without one whose LED is off once they were switched off and on.
    """

    def __init__(
        self,
        port: BytePort,
        clock: Clock,
        servos: Sequence[Servo],
        bus: BusSpec,
        torque_on: Callable[[Sequence[int]], bytes],
        feed: bytes,
        feed_ns: int,
        armed: Sequence[int | None],
        errors: Sequence[Errors],
        marked: Container[int] = (),
    ) -> None:
        self._port = port
        self._clock = clock
        self._servos = servos
        self._bus = bus
        self._torque_on = torque_on
        self._feed = feed
        self._feed_ns = feed_ns
        self._armed = armed
        self._errors = errors
        self._marked = marked
        self._buffer = bytearray()
        self._at = 0
        self._sent_ns = self._fed_ns = clock.now_ns()
        self._pending = False
        self._tries = 0
        self._on = [False] * len(servos)
        self._armed_off_ns = 0
        """When the servo at `_at` was asked for the answer that it is off and armed; 0: not."""
        self.verified_ns = [0] * len(servos)
        """When each servo was last asked for what it then confirmed."""
        least_ns = MIN_PERIODS * bus.period_ns
        self._interval_ns = max(FORGETS_NS // max(len(servos), 1), least_ns)
        port.write(feed)

    def step(self) -> bool:
        """Do one step; return whether every servo has confirmed that it is on.

        Raises
        ------
        DeviceFault
            A servo reports a hardware error, or is not as it was set.
        DriverError
            A servo does not respond, or stays off.
        """
        was_pending = self._pending
        self._take_in()
        now = self._clock.now_ns()
        if self._pending and now - self._sent_ns <= AGAIN_NS:
            return False
        settled = all(self._on) and not self._pending
        if not settled or (not was_pending and now - self._sent_ns > self._interval_ns):
            late = self._armed_off_ns and now - self._armed_off_ns > FORGETS_NS
            self._send(now)
            if late:  # the next step would be, too
                self._await(now + FORGETS_NS)
            return False
        if now - self._fed_ns > self._feed_ns:
            self._port.write(self._feed)
            self._fed_ns = now
        return True

    def _await(self, until_ns: int) -> None:
        """Wait for the answer; switch on the one that says that it is off and armed."""
        while self._pending and self._clock.wait(self._port, until_ns):
            self._take_in()
        if self._armed_off_ns:
            self._send(self._clock.now_ns())

    def _take_in(self) -> None:
        self._buffer += self._port.read()
        while (response := packet.take_packet(self._buffer)) is not None:
            self._receive(response)

    def _receive(self, found: packet.Packet) -> None:
        servo, armed = self._servos[self._at], self._armed[self._at]
        if not self._pending or found.device_id != servo.options.id:
            return
        if found.instruction != packet.STATUS or len(found.data) != state_register(armed).size:
            return  # late, and the response to another request
        self._pending = False
        marker = marker_fault(found.data) if servo.options.id in self._marked else ""
        if not self._on[self._at]:
            error = found.data[TORQUE.size - 1]
            errors = self._errors[self._at]
            if error & ~errors.tolerated:
                text = hardware_text(error, errors.shutdown)
                raise DeviceFault(f"{self._where(servo)}: {text}")
            if not found.data[0]:
                watchdog = reg.BUS_WATCHDOG.decode(found.data[-1:])
                text = marker if armed is None else watchdog_fault(watchdog, armed)
                if text:
                    raise DeviceFault(f"{self._where(servo)}: {text}")
                self._armed_off_ns = self._sent_ns
                return  # switched on, and asked again
        text = state_fault(found.data, armed, self._errors[self._at]) or marker
        if text:
            raise DeviceFault(f"{self._where(servo)}: {text}")
        self._on[self._at] = True
        self.verified_ns[self._at] = self._sent_ns
        self._at = (self._at + 1) % len(self._servos)
        self._tries = 0

    def _send(self, now_ns: int) -> None:
        servo = self._servos[self._at]
        self._tries += 1
        if self._tries > TRIES:
            raise DriverError(
                f"{self._where(servo)}: torque does not switch on, or it stopped answering; check "
                "its power and cable"
            )
        orders = self._feed
        if self._armed_off_ns and now_ns - self._armed_off_ns <= FORGETS_NS:
            orders += self._torque_on([servo.options.id])
        self._armed_off_ns = 0
        state = state_register(self._armed[self._at])
        read = packet.read_packet(servo.options.id, state.address, state.size)
        self._port.write(orders + read)
        self._sent_ns = self._fed_ns = now_ns
        self._pending = True

    def _where(self, servo: Servo) -> str:
        return f"{servo.axis.name} (bus {self._bus.name}, servo {servo.options.id})"
