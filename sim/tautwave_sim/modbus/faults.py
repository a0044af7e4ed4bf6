"""A seeded plan of what goes wrong between master and drives: how often, and exactly when."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import NamedTuple

from tautwave.streams import uniform_stream
from tautwave_sim.modbus.options import (
    DRIVE_FAULTS,
    LINK_FAULTS,
    REQUEST_FAULTS,
    FaultEvent,
    ModbusFaults,
)

NOISE_MOST = 8


class LinkFailure(NamedTuple):
    """How a link fails, and for how long [ns]; 0: permanently."""

    kind: str
    span_ns: int


class Outcome(NamedTuple):
    """What happens to one request and its response."""

    lost: bool = False
    unanswered: bool = False
    late_ns: int = 0
    noise: bytes = b""
    wrong_unit: bool = False
    keep: float = 1.0
    """Share of the response's bytes that arrive; at least one is missing below 1."""
    flip: float | None = None
    """Where the wrong bit is, as a share of what can be wrong."""
    code: int | None = None
    """Of the exception sent instead."""
    link: LinkFailure | None = None
    """How the link fails with this request, which then has no response."""


UNDISTURBED = Outcome()


class FaultPlan:
    """Decides on each request; the same plan on the same requests decides the same.

    Parameters
    ----------
    faults : ModbusFaults
        The plan.
    """

    def __init__(self, faults: ModbusFaults) -> None:
        self._late_ns = round(faults.late_s * 1e9)
        self._code = faults.exception_code
        self._events = [_Event(event) for event in faults.events]
        self._streams: dict[str, tuple[float, Iterator[float]]] = {}
        for kind in REQUEST_FAULTS:
            probability = getattr(faults, kind)
            if probability > 0.0:
                key = (faults.seed, zlib.crc32(kind.encode()))
                self._streams[kind] = (probability, uniform_stream(key))
        self._place = uniform_stream((faults.seed, zlib.crc32(b"place")))
        self._idle = not self._events and not self._streams

    def request(self, unit: int, t_ns: int | None) -> Outcome:
        """Decide on a request to a unit, `t_ns` after the drives began to move (None: not yet)."""
        if self._idle:
            return UNDISTURBED
        kinds = {
            kind: self._code
            for kind, (probability, stream) in self._streams.items()
            if next(stream) < probability
        }
        link = None
        for event in self._events:
            if event.kind in LINK_FAULTS:
                if event.by_request and event.applies(unit, t_ns):
                    link = event.failure
            elif event.kind in REQUEST_FAULTS and event.applies(unit, t_ns):
                kinds[event.kind] = event.code or 4
        if not kinds and link is None:
            return UNDISTURBED
        return Outcome(
            lost="request_lost" in kinds,
            unanswered="answer_lost" in kinds,
            late_ns=self._late_ns if "answer_late" in kinds else 0,
            noise=self._noise() if "noise" in kinds else b"",
            wrong_unit="wrong_unit" in kinds,
            keep=next(self._place) if "truncated" in kinds else 1.0,
            flip=next(self._place) if "corrupted" in kinds else None,
            code=kinds.get("exception"),
            link=link,
        )

    def _noise(self) -> bytes:
        count = 1 + int(next(self._place) * NOISE_MOST)
        return bytes(int(next(self._place) * 256) for _ in range(count))

    def link_failures(self, t_ns: int | None) -> list[LinkFailure]:
        """Return how the link fails by `t_ns`, each failure once."""
        return [
            event.failure
            for event in self._events
            if event.kind in LINK_FAULTS and not event.by_request and event.comes(t_ns)
        ]

    def drive_events(self, unit: int, t_ns: int | None) -> list[tuple[str, int | None]]:
        """Return the faults due with this request to a drive: kind and code, each once."""
        return [
            (event.kind, event.code)
            for event in self._events
            if event.kind in DRIVE_FAULTS and event.applies_to(unit, t_ns)
        ]


def corrupt(frame: bytes, outcome: Outcome) -> bytes:
    """Return what arrives of a response's frame."""
    if outcome.flip is not None and frame:
        bit = int(outcome.flip * 8 * len(frame))
        spoilt = bytearray(frame)
        spoilt[bit // 8] ^= 1 << bit % 8
        frame = bytes(spoilt)
    if outcome.keep < 1.0:
        frame = frame[: int(outcome.keep * len(frame))]
    return outcome.noise + frame


class _Event:
    """A scripted fault and how far it has come."""

    def __init__(self, keys: FaultEvent) -> None:
        self.kind: str = keys.kind
        self.code = keys.code
        self.by_request = keys.at_s is None
        self.failure = LinkFailure(keys.kind, round(keys.duration_s * 1e9))
        self._unit = keys.unit
        self._from_ns = None if keys.at_s is None else round(keys.at_s * 1e9)
        self._span_ns = round(keys.duration_s * 1e9)
        self._nth = keys.nth if keys.nth is not None or keys.at_s is not None else 1
        self._left = keys.times
        self._seen = 0
        self._began_ns: int | None = None

    def applies(self, unit: int, t_ns: int | None) -> bool:
        """Note a request; return whether it is meant."""
        if self._unit is not None and unit != self._unit:
            return False
        self._seen += 1
        if self._nth is not None and self._seen < self._nth:
            return False
        if self._from_ns is not None and (t_ns is None or t_ns < self._from_ns):
            return False
        if self._span_ns > 0 and t_ns is not None and self.kind in REQUEST_FAULTS:
            if self._began_ns is None:
                self._began_ns = t_ns
            return t_ns < self._began_ns + self._span_ns
        self._left -= 1
        return self._left >= 0

    def comes(self, t_ns: int | None) -> bool:
        """Return whether its time has come, once."""
        if self._left <= 0 or self._from_ns is None or t_ns is None or t_ns < self._from_ns:
            return False
        self._left = 0
        return True

    def applies_to(self, unit: int, t_ns: int | None) -> bool:
        """Return whether a drive has it now, once."""
        if self.by_request:
            return self.applies(unit, t_ns)
        return (self._unit is None or unit == self._unit) and self.comes(t_ns)
