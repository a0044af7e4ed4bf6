"""What passes on buses while it is recorded: frames and bytes, both ways, as lines of text.

A line has the time [s], the bus, `>` for what this host sent or `<` for what it received, and bytes
in hexadecimal, of a CAN frame `ID#DATA` as candump has it. Memory is bounded: the first and the
last seconds are kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

from tautwave.contracts import Clock
from tautwave.errors import ConfigError

LEAVING = "*"
"""In place of a bus: from here on this host switches all devices off."""
RUNNING = "#"
"""In place of a bus: from here on cycles run. For readers such a line is a comment."""
DIRECTIONS = ("R", "T")
BYTES = -1
"""In place of an id: not a CAN frame."""
EXTENDED = 0x80000000

T = TypeVar("T")


class Event(NamedTuple):
    """Something sent (`out`) or received: when [ns], on which bus, under which CAN id."""

    at_ns: int
    bus: str
    out: bool
    can_id: int
    data: bytes

    def line(self) -> str:
        """Return it as a line of text."""
        if self.bus == LEAVING:
            return f"{self.at_ns * 1e-9:.6f} {LEAVING} leaving"
        if self.bus == RUNNING:
            return f"{RUNNING} {self.at_ns * 1e-9:.6f} running"
        what = self.data.hex().upper()
        if self.can_id != BYTES:
            width = 8 if self.can_id & EXTENDED else 3
            what = f"{self.can_id & ~EXTENDED:0{width}X}#{what}"
        return f"{self.at_ns * 1e-9:.6f} {self.bus} {'>' if self.out else '<'} {what}"


def around_gap(first: Sequence[T], last: Sequence[T], sent: Callable[[T], bool]) -> list[T]:
    """Return what one bus had before and after a gap, without exchanges that the gap cuts.

    An exchange begins with what was `sent` after something was received.
    """
    ends, begins = _begins(first, sent), _begins(last, sent)
    return [*first[: ends[-1] if ends else None], *last[begins[0] if begins else 0 :]]


def _begins(events: Sequence[T], sent: Callable[[T], bool]) -> list[int]:
    return [at for at, (one, two) in enumerate(pairwise(events), 1) if sent(two) and not sent(one)]


class Traffic:
    """What passes up to `span_s` after the first cycle, and in the last `span_s`.

    Devices are opened and enabled before that cycle, which takes as long as it takes. Exchanges are
    kept whole; of each part at most `at_most` events.
    """

    def __init__(self, span_s: float, at_most: int = 20_000) -> None:
        self._span_ns = round(span_s * 1e9)
        self._first: list[Event] = []
        self._last: deque[Event] = deque(maxlen=at_most)
        self._at_most = at_most
        self._left_out = False
        self._running_ns: int | None = None

    def add(self, event: Event) -> None:
        """Take an event."""
        first, last = self._first, self._last
        if event.bus == RUNNING and self._running_ns is None:
            self._running_ns = event.at_ns
        early = self._running_ns is None or event.at_ns - self._running_ns <= self._span_ns
        if early and len(first) < self._at_most:
            first.append(event)
            return
        self._left_out = self._left_out or len(last) == self._at_most
        last.append(event)
        while event.at_ns - last[0].at_ns > self._span_ns:
            last.popleft()
            self._left_out = True

    @property
    def events(self) -> list[Event]:
        """Everything that was kept, without a request or an answer whose other half is not."""
        kept = []
        numbered = list(enumerate([*self._first, *self._last]))
        for bus in dict.fromkeys(event.bus for _, event in numbered):
            own = [one for one in numbered if one[1].bus == bus]
            if self._left_out and bus not in (LEAVING, RUNNING):
                first = [one for one in own if one[0] < len(self._first)]
                own = around_gap(first, own[len(first) :], lambda one: one[1].out)
            kept += own
        kept.sort(key=lambda one: (one[1].at_ns, one[0]))
        return [event for _, event in kept]


_recording: list[Traffic] = []


@contextmanager
def recorded(span_s: float) -> Iterator[Traffic]:
    """Record what passes on ports that are opened within the block."""
    traffic = Traffic(span_s)
    _recording.append(traffic)
    try:
        yield traffic
    finally:
        _recording.remove(traffic)


def note_leaving(clock: Clock) -> None:
    """Note that all devices are switched off from now on."""
    if _recording:
        _recording[-1].add(Event(clock.now_ns(), LEAVING, True, BYTES, b""))


def note_running(clock: Clock) -> None:
    """Note that all devices are open and enabled, and cycles begin."""
    if _recording:
        _recording[-1].add(Event(clock.now_ns(), RUNNING, True, BYTES, b""))


def tapped(bus: str, port: Any, clock: Clock) -> Any:
    """Return a port, or a simulated bus that gives ports; recorded, where that is asked for."""
    if not _recording or port is None:
        return port
    return _Tap(bus, port, clock.now_ns, _recording[-1].add)


BATCHES = frozenset({"send_all", "receive_some"})
"""Several frames in one call: of a recorded port they go and come one by one, so none is missed."""


class _Tap:
    """A port, in front of another one."""

    def __init__(
        self, bus: str, port: Any, now_ns: Callable[[], int], add: Callable[[Event], None]
    ) -> None:
        self._bus, self._port, self._now_ns, self._add = bus, port, now_ns, add

    def __getattr__(self, name: str) -> Any:
        if name in BATCHES:
            raise AttributeError(name)
        return getattr(self._port, name)

    def write(self, data: bytes) -> None:
        self._add(Event(self._now_ns(), self._bus, True, BYTES, bytes(data)))
        self._port.write(data)

    def read(self) -> bytes:
        data: bytes = self._port.read()
        if data:
            self._add(Event(self._now_ns(), self._bus, False, BYTES, bytes(data)))
        return data

    def send(self, can_id: int, data: bytes) -> bool:
        sent: bool = self._port.send(can_id, data)
        if sent:
            self._add(Event(self._now_ns(), self._bus, True, can_id, bytes(data)))
        return sent

    def receive(self) -> tuple[int, bytes, int] | None:
        frame: tuple[int, bytes, int] | None = self._port.receive()
        if frame is not None:  # when it came, not when it was read
            at_ns = min(frame[2], self._now_ns())
            self._add(Event(at_ns, self._bus, False, frame[0], bytes(frame[1])))
        return frame

    def port(self, endpoint: str) -> Any:
        return _Tap(self._bus, self._port.port(endpoint), self._now_ns, self._add)


def parse_lines(lines: Iterable[str], where: str, hosts: Callable[[int], bool]) -> list[Event]:
    """Return the events of lines of text, or of a candump log.

    Parameters
    ----------
    lines : iterable of str
        `0.000120 line > FF01`, or `(0.000120) can0 601#4000100000000000`. Empty lines and those
        that begin with # are left out.
    where : str
        For errors.
    hosts : callable
        Whether a frame of a candump log, by its id, is one that a host sends.

    Raises
    ------
    ConfigError
        A line is neither.
    """
    events = []
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        event = _event(words, hosts)
        if event is None:
            raise ConfigError(
                f"{where}:{number}: {line.strip()[:60]!r} is no line of traffic: TIME BUS > HEX, "
                "TIME BUS < ID#HEX, or one of candump -L"
            )
        events.append(event)
    return events


def _event(words: list[str], hosts: Callable[[int], bool]) -> Event | None:
    """Return the event of a line, None where it is none."""
    if len(words) == 4 and words[3] in DIRECTIONS:  # of the logger, which may be anybody
        words = words[:3]
    head, mark, body = words[-1].partition("#")
    try:
        at_ns = round(float(words[0].strip("()")) * 1e9)
        if words[1:] == [LEAVING, "leaving"]:
            return Event(at_ns, LEAVING, True, BYTES, b"")
        can_id = (int(head, 16) | (EXTENDED if len(head) > 3 else 0)) if mark else BYTES
        remote = mark and body.startswith("R")
        data = b"" if remote else bytes.fromhex(body if mark else head)
    except (ValueError, OverflowError):
        return None
    if len(words) == 4 and words[2] in "<>":
        return Event(at_ns, words[1], words[2] == ">", can_id, data)
    if len(words) == 3 and mark:
        return Event(at_ns, words[1], bool(remote) or hosts(can_id), can_id, data)
    return None
