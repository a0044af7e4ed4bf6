"""The master's end of a simulated bus: in memory, or through a real virtual bus of python-can."""

from __future__ import annotations

from collections import deque
from typing import Any

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave.multicast import ERROR, EXTENDED, REMOTE
from tautwave_sim.wire.can_medium import Frame
from tautwave_sim.wire.can_world import CanWorld

INBOX = 10_000
"""Frames that wait for a master that does not read; the oldest are dropped then."""

ERROR_FRAME = 0x20000000
CONTROLLER, BUS_OFF = 0x04, 0x40
"""Classes of error frames, in their identifier (CAN_ERR_CRTL, CAN_ERR_BUSOFF)."""
TX_PASSIVE, ACTIVE = 0x20, 0x40
"""Byte 1: state of the controller; byte 6: its transmit errors (<linux/can/error.h>)."""

Received = tuple[int, bytes, int]


class MasterPort:
    """The master's end of a simulated bus: a `FramePort` that is `InMemory`.

    A change of its controller's state makes an error frame, as on Linux.

    Parameters
    ----------
    world : CanWorld
        The bus.
    clock : Clock
        Time of the master.
    depth : int
        Frames its queue holds.

    Attributes
    ----------
    classic_ids : set of int
        Identifiers of classic frames that came to a port of FD frames.
    """

    def __init__(self, world: CanWorld, clock: Clock, depth: int) -> None:
        self.classic_ids: set[int] = set()
        self._world = world
        self._clock = clock
        self._depth = depth
        self._inbox: deque[Received] = deque(maxlen=INBOX)
        self._port = world.medium.port(self._take, depth, recovers=False)
        self._reported = "active"

    def _take(self, now_ns: int, can_id: int, data: bytes) -> None:
        medium = self._world.medium
        if medium.timing.fd and not medium.fd:
            self.classic_ids.add(can_id)
        self._inbox.append((can_id, data, now_ns))

    @property
    def error_state(self) -> str:
        """`active`, `passive` or `off`, as the controller's error counter has it."""
        self._world.port_fault(self._port)
        return self._port.error_state

    def _send_error_frames(self) -> None:
        state = self._port.error_state
        if state == self._reported:
            return
        self._reported = state
        kind = BUS_OFF if state == "off" else CONTROLLER
        status = {"off": 0, "passive": TX_PASSIVE, "active": ACTIVE}[state]
        count = min(self._port.errors, 0xFF)
        data = bytes([0, status, 0, 0, 0, 0, count, 0])
        self._inbox.append((ERROR_FRAME | kind, data, self._world.medium.now_ns))

    def send(self, can_id: int, data: bytes) -> bool:
        """Queue a frame; return False when the queue is full.

        Raises
        ------
        DriverError
            The bus is gone, or off.
        """
        world = self._world
        world.advance(self._clock.now_ns())
        fault = world.port_fault(self._port)
        if fault == "bus_down":
            raise DriverError(
                "the CAN interface is down or was removed; check the cable and `ip link`"
            )
        if fault == "bus_off":
            raise DriverError(
                "the CAN controller is bus-off: its frames were destroyed again and again; check "
                "bitrate, termination and cable"
            )
        if world.plan.refuses(world.elapsed_ns(world.medium.now_ns)):
            return False
        return self._transmit(can_id, data)

    def _transmit(self, can_id: int, data: bytes) -> bool:
        return self._port.send(can_id, data)

    def receive(self) -> Received | None:
        """Return the oldest frame received as id, data and arrival [ns]; None if there is none."""
        return self._inbox.popleft() if self.readable() else None

    def readable(self) -> bool:
        """Return whether a frame waits."""
        return bool(self._inbox)

    def next_event_ns(self) -> int | None:
        """Return when something happens on the bus by itself."""
        return self._world.next_event_ns()

    def advance(self, to_ns: int) -> None:
        """Let the bus go on to `to_ns`."""
        self._world.port_fault(self._port)
        self._world.advance(to_ns)
        self._send_error_frames()

    def close(self) -> None:
        """Discard what was received."""
        self._inbox.clear()


class VirtualPort(MasterPort):
    """As `MasterPort`, with python-can's virtual bus between master and drives.

    Others that join the channel in this process see every frame and may send their own.

    Parameters
    ----------
    world, clock, depth
        As for `MasterPort`.
    channel : str
        Of the virtual bus.
    """

    def __init__(self, world: CanWorld, clock: Clock, depth: int, channel: str) -> None:
        super().__init__(world, clock, depth)
        import can

        self._mine: Any = can.Bus(interface="virtual", channel=channel)
        self._theirs: Any = can.Bus(interface="virtual", channel=channel)

    def _take(self, now_ns: int, can_id: int, data: bytes) -> None:
        self._theirs.send(message_of(can_id, data, self._world.medium.fd))

    def _transmit(self, can_id: int, data: bytes) -> bool:
        if len(self._port.queue) >= self._depth:
            return False
        self._mine.send(message_of(can_id, data, self._world.medium.timing.fd))
        self._pull()
        return True

    def _pull(self) -> None:
        while (message := self._theirs.recv(0.0)) is not None:
            if (frame := frame_of(message, self._world)) is not None:
                self._port.send(*frame)

    def advance(self, to_ns: int) -> None:
        """Hand over what was sent, and let the bus go on to `to_ns`."""
        super().advance(to_ns)
        self._pull()

    def readable(self) -> bool:
        """Return whether a frame waits."""
        while (message := self._mine.recv(0.0)) is not None:
            if (frame := frame_of(message, self._world)) is not None:
                can_id, data, fd = frame
                if self._world.medium.timing.fd and not fd:
                    self.classic_ids.add(can_id)
                self._inbox.append((can_id, data, self._clock.now_ns()))
        return bool(self._inbox)

    def shut(self) -> None:
        """Leave the virtual bus."""
        self._mine.shutdown()
        self._theirs.shutdown()


def message_of(can_id: int, data: bytes, fd: bool) -> Any:
    """Return a frame as python-can has it."""
    import can

    return can.Message(
        arbitration_id=can_id & ~EXTENDED,
        data=data,
        is_extended_id=bool(can_id & EXTENDED),
        is_fd=fd,
        bitrate_switch=fd,
    )


def linux_frame(message: Any) -> Frame:
    """Return a frame of python-can, its identifier with Linux's bits."""
    can_id = message.arbitration_id
    for marked, bit in (
        (message.is_extended_id, EXTENDED),
        (message.is_remote_frame, REMOTE),
        (message.is_error_frame, ERROR),
    ):
        if marked:
            can_id |= bit
    return can_id, bytes(message.data), bool(message.is_fd)


def frame_of(message: Any, world: CanWorld) -> Frame | None:
    """Return a frame of python-can for a bus, None if it is not a data frame of its kind."""
    can_id, data, fd = linux_frame(message)
    others = REMOTE | ERROR | (0 if world.extended else EXTENDED)
    if can_id & others or (fd and not world.medium.timing.fd):
        return None
    return can_id, data, fd
