"""What goes wrong on the line: by seeded chance, or scripted to the packet or the moment."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from tautwave.streams import uniform_stream

ANSWER_KINDS = ("lost", "late", "truncated", "corrupted", "wrong_id", "extra_bytes")
"""Faults of one response of a servo."""
DEAF = "deaf"
"""The servo misses an instruction."""
LINE_KINDS = ("unplug", "replug", "remove", "restore")
"""The adapter leaves the host and comes back; a servo leaves the line and comes back."""

PACKET_KINDS = (*ANSWER_KINDS, DEAF)
DETAIL = "detail"


class Event(NamedTuple):
    """One scripted fault.

    `at_s` [s] after slot 0, or `nth`: the response (or, for `deaf`, the instruction) with that
    number, from 1 on. `device_id` None: any servo.
    """

    kind: str
    at_s: float | None = None
    nth: int | None = None
    device_id: int | None = None


class FaultPlan:
    """Decides which packets are disturbed, the same for the same seed.

    Parameters
    ----------
    seed : tuple of int
        Begins the random streams, one for each kind.
    chances : mapping
        Probability of each kind, per response (`deaf`: per instruction and servo).
    events : sequence of Event
        Scripted faults of packets.
    """

    def __init__(
        self, seed: tuple[int, ...], chances: dict[str, float], events: Sequence[Event]
    ) -> None:
        self._chances = {kind: chance for kind, chance in chances.items() if chance > 0.0}
        self._streams: dict[str, Iterator[float]] = {
            kind: uniform_stream((*seed, zlib.crc32(kind.encode())))
            for kind in (*PACKET_KINDS, DETAIL)
        }
        self._events = [event for event in events if event.kind in PACKET_KINDS]
        self._counts: dict[tuple[bool, int | None], int] = {}

    def response_fault(self, device_id: int, time_s: float) -> str:
        """Return the fault of a servo's next response: a kind, or ''."""
        return self._decide(device_id, time_s, ANSWER_KINDS)

    def deaf(self, device_id: int, time_s: float) -> bool:
        """Return whether a servo misses an instruction."""
        return self._decide(device_id, time_s, (DEAF,)) == DEAF

    def _decide(self, device_id: int, time_s: float, kinds: tuple[str, ...]) -> str:
        deaf = kinds == (DEAF,)
        for key in ((deaf, device_id), (deaf, None)):
            self._counts[key] = self._counts.get(key, 0) + 1
        drawn = ""
        for event in self._events:
            if event.kind not in kinds or event.device_id not in (None, device_id):
                continue
            if event.nth is not None and event.nth != self._counts[deaf, event.device_id]:
                continue
            if event.at_s is not None and time_s < event.at_s:
                continue
            self._events.remove(event)
            drawn = event.kind
            break
        for kind in kinds:  # drawn whether an event has decided or not: it shifts no stream
            if kind in self._chances and next(self._streams[kind]) < self._chances[kind]:
                drawn = drawn or kind
        return drawn

    def corrupt(self, kind: str, packet: bytes) -> bytes:
        """Return a response with its bytes disturbed; a wrong id or a delay are done elsewhere."""
        if kind == "lost":
            return b""
        if kind == "truncated":
            return packet[: 1 + self._pick(len(packet) - 1)]
        if kind == "corrupted":
            at = self._pick(len(packet))
            return packet[:at] + bytes((packet[at] ^ (1 << self._pick(8)),)) + packet[at + 1 :]
        if kind == "extra_bytes":
            extra = bytes(self._pick(256) for _ in range(1 + self._pick(8)))
            return extra + packet if self._pick(2) else packet + extra
        return packet

    def _pick(self, count: int) -> int:
        return int(next(self._streams[DETAIL]) * count)
