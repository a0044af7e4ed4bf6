"""A seeded plan of what goes wrong on a CAN bus: how often of itself, and exactly when."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tautwave.streams import uniform_stream

FrameFault = Literal["lost", "delayed", "duplicated", "corrupted", "error_frame", "sync_lost"]
PortFault = Literal["queue_full", "bus_off", "bus_down"]

FRAME_FAULTS: tuple[FrameFault, ...] = (
    "lost",
    "delayed",
    "duplicated",
    "corrupted",
    "error_frame",
    "sync_lost",
)
SYNC_ID = 0x80

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class FaultEvent(_Keys):
    """Something that goes wrong once, at a time or at a frame."""

    kind: FrameFault | PortFault
    """`lost`: gone, unnoticed; `delayed`: arrives `delay_s` late; `duplicated`:
    arrives twice; `corrupted`: arrives with a wrong bit in its data (beyond what a CRC finds);
    `error_frame`: destroyed (CRC error), its sender repeats it; `sync_lost`: as `lost`, of a
    SYNC; `queue_full`: nothing more can be sent; `bus_off`: the master's controller leaves the
    bus; `bus_down`: the interface is gone."""
    at_s: Annotated[float, Field(ge=0.0)] | None = None
    """[s] after the drives began to move: the first frame from then on."""
    nth: Annotated[int, Field(ge=1)] | None = None
    """The n-th frame since power-on, of those with `can_id` where that is given."""
    can_id: Annotated[int, Field(ge=0, le=0x7FF)] | None = None
    """Frames with this identifier only."""
    times: Annotated[int, Field(ge=1)] = 1
    """So many frames in a row, of those meant."""
    duration_s: Annotated[float, Field(ge=0.0)] = 0.0
    """[s] How long it lasts, for `error_frame` and all faults that are not of a single frame; 0:
    permanently, or one frame for `error_frame`."""

    @model_validator(mode="after")
    def _meant(self) -> FaultEvent:
        if self.kind not in FRAME_FAULTS and (self.nth is not None or self.can_id is not None):
            raise ValueError(f"{self.kind} happens at a time: give at_s, and no nth or can_id")
        return self


class CanFaults(_Keys):
    """What goes wrong on the bus; each key is a probability per frame."""

    seed: Annotated[int, Field(ge=0)] = 0
    lost: Probability = 0.0
    delayed: Probability = 0.0
    duplicated: Probability = 0.0
    corrupted: Probability = 0.0
    error_frame: Probability = 0.0
    sync_lost: Probability = 0.0
    queue_full: Probability = 0.0
    """Per frame sent by the master."""
    delay_s: Annotated[float, Field(gt=0.0)] = 1e-3
    """[s] How late a delayed frame arrives."""
    events: Annotated[tuple[FaultEvent, ...], Field(strict=False)] = ()


class Outcome(NamedTuple):
    """What becomes of one frame."""

    lost: bool = False
    destroyed: bool = False
    late_ns: int = 0
    twice: bool = False
    data: bytes | None = None
    """What arrives instead of its data."""


UNDISTURBED = Outcome()


class CanFaultPlan:
    """Decides on each frame; the same plan on the same frames decides the same.

    Parameters
    ----------
    faults : CanFaults
        The plan.
    seed : tuple of int
        Of the bus; every kind draws from a stream of its own.
    """

    def __init__(self, faults: CanFaults, seed: tuple[int, ...] = ()) -> None:
        self._delay_ns = round(faults.delay_s * 1e9)
        self._events = [_Event(event) for event in faults.events]
        self._streams: dict[str, tuple[float, Iterator[float]]] = {}
        for kind in (*FRAME_FAULTS, "queue_full"):
            probability = getattr(faults, kind)
            if probability > 0.0:
                key = (*seed, faults.seed, zlib.crc32(kind.encode()))
                self._streams[kind] = (probability, uniform_stream(key))
        self._place = uniform_stream((*seed, faults.seed, zlib.crc32(b"place")))
        self.idle = not self._events and not self._streams

    def _draw(self, kind: str) -> bool:
        if kind not in self._streams:
            return False
        probability, stream = self._streams[kind]
        return next(stream) < probability

    def frame(self, t_ns: int | None, can_id: int, data: bytes) -> Outcome:
        """Decide on a frame whose bits are over at `t_ns`, None before anything moved."""
        if self.idle:
            return UNDISTURBED
        kinds = {kind for kind in FRAME_FAULTS[:-1] if self._draw(kind)}
        if can_id == SYNC_ID and self._draw("sync_lost"):
            kinds.add("lost")
        for event in self._events:
            if event.kind in FRAME_FAULTS and event.applies(t_ns, can_id):
                kinds.add("lost" if event.kind == "sync_lost" else event.kind)
        if not kinds:
            return UNDISTURBED
        return Outcome(
            lost="lost" in kinds,
            destroyed="error_frame" in kinds,
            late_ns=self._delay_ns if "delayed" in kinds else 0,
            twice="duplicated" in kinds,
            data=self._corrupted(data) if "corrupted" in kinds else None,
        )

    def _corrupted(self, data: bytes) -> bytes:
        if not data:
            return data
        bit = int(next(self._place) * 8 * len(data))
        spoilt = bytearray(data)
        spoilt[bit // 8] ^= 1 << bit % 8
        return bytes(spoilt)

    def port(self, t_ns: int | None) -> str:
        """Return the fault of the master's port at `t_ns`: '' or the worst of the port faults."""
        faults = {event.kind for event in self._events if event.holds(t_ns)}
        for kind in ("bus_down", "bus_off", "queue_full"):
            if kind in faults:
                return kind
        return ""

    def refuses(self, t_ns: int | None) -> bool:
        """Return whether the queue is full for a frame that the master sends now."""
        return self._draw("queue_full") or self.port(t_ns) == "queue_full"


class _Event:
    """A scripted fault and how far it has come."""

    def __init__(self, keys: FaultEvent) -> None:
        self.kind = keys.kind
        self._can_id = SYNC_ID if keys.kind == "sync_lost" else keys.can_id
        self._from_ns = None if keys.at_s is None else round(keys.at_s * 1e9)
        self._span_ns = round(keys.duration_s * 1e9)
        self._nth = keys.nth if keys.nth is not None or keys.at_s is not None else 1
        self._left = keys.times
        self._seen = 0
        self._began_ns: int | None = None

    def applies(self, t_ns: int | None, can_id: int) -> bool:
        if self._can_id is not None and can_id != self._can_id:
            return False
        self._seen += 1
        if self._nth is not None and self._seen < self._nth:
            return False
        if self._from_ns is not None and (t_ns is None or t_ns < self._from_ns):
            return False
        if self._span_ns > 0 and t_ns is not None:
            if self._began_ns is None:
                self._began_ns = t_ns
            return t_ns < self._began_ns + self._span_ns
        self._left -= 1
        return self._left >= 0

    def holds(self, t_ns: int | None) -> bool:
        if self.kind in FRAME_FAULTS or t_ns is None:
            return False
        since = t_ns - (self._from_ns or 0)
        return since >= 0 and (self._span_ns == 0 or since < self._span_ns)
