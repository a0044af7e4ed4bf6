"""UDP multicast as a bus: the datagrams of python-can's `udp_multicast`, at half its cost."""

from __future__ import annotations

import os
import select
from collections.abc import Collection, Sequence

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave.multicast import REMOTE, Group, GroupFrame
from tautwave_drivers.can.batches import Frame
from tautwave_drivers.can.framing import ERROR_FRAME, EXTENDED, STANDARD_MASK, Framing

_CLASSIC = Framing()
REMEDY = (
    "the channel is a multicast address that this machine has a route to "
    "(without a network: ip route add 239.0.0.0/8 dev lo)"
)


class MulticastPort:
    """A group of UDP multicast; what this port sends does not come back to it.

    Parameters
    ----------
    group : Group
        The open group.
    clock : Clock
        Stamps what is received.
    where : str
        The interface, for messages.
    framing : Framing
        What it sends and takes.

    Attributes
    ----------
    classic_ids : set of int
        Identifiers of classic frames that came to a port of FD frames.
    """

    def __init__(self, group: Group, clock: Clock, where: str, framing: Framing = _CLASSIC) -> None:
        self._group = group
        self._where = where
        self._now_ns = clock.now_ns
        self._framing = framing
        self._fd = framing.fd
        self._others = REMOTE if framing.extended else REMOTE | EXTENDED
        self._ids = None if framing.ids is None else frozenset(framing.ids)
        self._queue: select.epoll | None = None
        self.classic_ids: set[int] = set()

    @classmethod
    def open(cls, channel: str, clock: Clock, framing: Framing = _CLASSIC) -> MulticastPort:
        """Join the group `channel`.

        Raises
        ------
        DriverError
            It is no group, no network could have it, or msgpack is missing.
        """
        where = f"udp_multicast:{channel}"
        try:
            group = Group(channel)
        except ImportError as err:
            raise DriverError(
                f"{where} needs msgpack: pip install 'python-can[multicast]'"
            ) from err
        except OSError as err:
            raise DriverError(f"cannot open {where} ({err}); {REMEDY}") from err
        return cls(group, clock, where, framing)

    def fileno(self) -> int:
        """Return the descriptor a clock waits for."""
        return self._group.fileno()

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False when there is no room for it."""
        if can_id > STANDARD_MASK or len(data) > 8:
            self._framing.check(can_id, len(data))
        try:
            return self._group.send(can_id, data, self._fd)
        except OSError as err:
            raise self._lost(err) from err

    def has_frames(self) -> bool:
        """Return whether there is something to take, quicker than by taking nothing."""
        if self._queue is None:
            self._queue = select.epoll()
            self._queue.register(self._group, select.EPOLLIN)
        return bool(self._queue.poll(0))

    def receive(self) -> Frame | None:
        """Return the oldest frame as id, data and arrival [ns], None if there is none."""
        frames = self.receive_some(1)
        return frames[0] if frames else None

    def receive_some(self, most: int) -> list[Frame]:
        """Return what has arrived, oldest first, `most` frames at most."""
        try:
            while got := self._group.receive_some(most):
                if frames := self._taken(got):
                    return frames
        except OSError as err:
            raise self._lost(err) from err
        return []

    def _taken(self, got: Sequence[GroupFrame]) -> list[Frame]:
        """Return those of the frames that came that this port takes."""
        now_ns, fd, ids = self._now_ns(), self._fd, self._ids
        frames: list[Frame] = []
        for can_id, data, is_fd, _ in got:
            if not can_id & ERROR_FRAME:
                if can_id & self._others or (is_fd and not fd):
                    continue
                if ids is not None and can_id not in ids:
                    continue
                if fd and not is_fd:
                    self.classic_ids.add(can_id)
            frames.append((can_id, data, now_ns))
        return frames

    def listen(self, ids: Collection[int]) -> None:
        """Take these ids only from now on, and error frames."""
        self._ids = frozenset(ids)

    def close(self) -> None:
        """Leave the group."""
        if self._queue is not None:
            self._queue.close()
        self._group.close()

    def _lost(self, err: OSError) -> DriverError:
        why = os.strerror(err.errno) if err.errno else str(err)
        return DriverError(f"{self._where}: the network is down ({why}); {REMEDY}")
