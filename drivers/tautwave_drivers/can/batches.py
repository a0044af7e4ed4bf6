"""Several frames in one call, of ports that have such calls and of those that have not."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave.contracts import FramePort

Frame = tuple[int, bytes, int]


def send_each(port: FramePort, frames: Sequence[tuple[int, bytes]]) -> int:
    """Send frames, one by one, until one does not go out; return how many did."""
    sent = 0
    for can_id, data in frames:
        if not port.send(can_id, data):
            break
        sent += 1
    return sent


def sending(port: FramePort) -> Callable[[Sequence[tuple[int, bytes]]], int]:
    """Return what sends several frames of a port and returns how many went out."""
    send_all: Callable[[Sequence[tuple[int, bytes]]], int] | None = getattr(port, "send_all", None)
    return send_all if send_all is not None else lambda frames: send_each(port, frames)


def waiting(port: FramePort) -> Callable[[], bool]:
    """Return what says whether a port may have frames; one that cannot say may always have some."""
    ask: Callable[[], bool] | None = getattr(port, "has_frames", None)
    return ask if ask is not None else lambda: True


def receiving(port: FramePort) -> Callable[[int], Sequence[Frame]]:
    """Return what gives frames that have arrived at a port, a number of them at most."""
    receive_some: Callable[[int], Sequence[Frame]] | None = getattr(port, "receive_some", None)
    if receive_some is not None:
        return receive_some

    def one(most: int) -> Sequence[Frame]:
        frame = port.receive()
        return () if frame is None else (frame,)

    return one
