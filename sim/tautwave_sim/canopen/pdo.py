"""Process data objects of one device: communication and mapping parameters at work.

Source: CiA 301 v4.2.0, 7.5.2.35 to 7.5.2.38 (parameters, and the order they are changed in).
"""

from __future__ import annotations

from collections.abc import Callable

from tautwave_sim.canopen.dictionary import (
    COUNT_FIRST,
    MAPPING_TOO_LONG,
    NO_OBJECT,
    NOT_MAPPABLE,
    WRONG_STATE,
    WRONG_VALUE,
    Entry,
    ObjectDictionary,
    SdoAbort,
    Value,
)
from tautwave_sim.canopen.objects import INVALID, MAPPED

EXTENDED = 0x20000000
LAST_CYCLIC = 240
EVENT = (254, 255)
CONTROLWORD = 0x6040
MEASURED = (0x6062, 0x6064, 0x606C, 0x6074, 0x6077, 0x6078, 0x60F4)

Part = tuple[int, int, Entry]


class Pdo:
    """What a RPDO and a TPDO have in common: an identifier, a type and a mapping.

    Parameters
    ----------
    objects : ObjectDictionary
        The device's.
    index : int
        Of the communication parameters; those of the mapping are 200h further.
    configurable : callable
        Whether the device is in a state in which mappings may change.
    """

    def __init__(
        self, objects: ObjectDictionary, index: int, configurable: Callable[[], bool]
    ) -> None:
        self._objects = objects
        self._index = index
        self._map = index + 0x200
        self._sends = index >= 0x1800
        self._configurable = configurable
        self.parts: tuple[Part, ...] = ()
        self.size = 0
        self.cob_id = 0
        self.valid = False
        self.kind = 255
        self.inhibit_ns = 0
        self.timer_ns = 0
        self._wire()
        self.load()

    def _wire(self) -> None:
        writers = self._objects.writers
        writers[self._index, 1] = self._take_cob_id
        writers[self._index, 2] = self._take_kind
        writers[self._index, 3] = self._take_inhibit
        writers[self._index, 5] = self._take_timer
        writers[self._map, 0] = self._take_count
        for sub in range(1, MAPPED + 1):
            writers[self._map, sub] = self._take_part

    def load(self) -> None:
        """Take everything from the objects, after these were restored."""
        number = self._objects.number
        cob_id = number(self._index, 1)
        self.cob_id, self.valid = cob_id & 0x7FF, not cob_id & INVALID
        self.kind = number(self._index, 2)
        self.inhibit_ns = number(self._index, 3) * 100_000
        self.timer_ns = number(self._index, 5) * 1_000_000
        count = number(self._map, 0)
        self.parts = tuple(self._part(number(self._map, sub + 1)) for sub in range(count))
        self.size = sum(entry.size for _, _, entry in self.parts)

    def _part(self, word: int) -> Part:
        index, sub, bits = word >> 16, word >> 8 & 0xFF, word & 0xFF
        if (index, sub) not in self._objects:
            raise SdoAbort(NO_OBJECT)
        entry = self._objects.entry(index, sub)
        if ("t" if self._sends else "r") not in entry.pdo or bits != 8 * entry.size:
            raise SdoAbort(NOT_MAPPABLE)
        return index, sub, entry

    def _take_cob_id(self, value: int) -> None:
        valid = not value & INVALID
        if value & EXTENDED or value & 0x1FFFF800:
            raise SdoAbort(WRONG_VALUE)
        if self.valid and valid and value & 0x7FF != self.cob_id:
            raise SdoAbort(WRONG_VALUE)  # an identifier changes while the PDO does not exist
        if valid and _reserved(value & 0x7FF):
            raise SdoAbort(WRONG_VALUE)
        self.cob_id, self.valid = value & 0x7FF, valid
        self.begin()

    def _take_kind(self, value: int) -> None:
        if LAST_CYCLIC < value < EVENT[0]:
            raise SdoAbort(WRONG_VALUE)
        self.kind = value
        self.begin()

    def _take_inhibit(self, value: int) -> None:
        if self.valid:
            raise SdoAbort(WRONG_STATE)
        self.inhibit_ns = value * 100_000

    def _take_timer(self, value: int) -> None:
        self.timer_ns = value * 1_000_000
        self.begin()

    def _take_count(self, count: int) -> None:
        self._check_may_map()
        words = [self._objects.number(self._map, sub) for sub in range(1, count + 1)]
        parts = tuple(self._part(word) for word in words)
        size = sum(entry.size for _, _, entry in parts)
        if size > 8:
            raise SdoAbort(MAPPING_TOO_LONG)
        self.parts, self.size = parts, size

    def _take_part(self, word: int) -> None:
        self._check_may_map()
        if self._objects.number(self._map, 0) != 0:
            raise SdoAbort(COUNT_FIRST)
        if word:  # 0 empties an entry
            self._part(word)

    def _check_may_map(self) -> None:
        if self.valid or not self._configurable():
            raise SdoAbort(WRONG_STATE)

    def begin(self) -> None:
        """Begin anew: nothing was received or sent."""


def _reserved(cob_id: int) -> bool:
    """Return whether an identifier is never a PDO's (CiA 301, 7.3.5)."""
    return cob_id <= 0x180 or 0x581 <= cob_id <= 0x67F or cob_id >= 0x6E0


class Rpdo(Pdo):
    """Receives: at the next SYNC or at once, and within its time if it has one."""

    def begin(self) -> None:
        """Begin anew: nothing was received."""
        self.waiting: bytes | None = None
        self.deadline_ns: int | None = None

    def receive(self, now_ns: int, data: bytes) -> bool:
        """Take a frame that is long enough; return whether it has to act at once."""
        if self.timer_ns > 0:
            self.deadline_ns = now_ns + self.timer_ns
        self.waiting = data
        return self.kind > LAST_CYCLIC

    def act(self) -> None:
        """Write what was received last into its objects; what is refused is left out."""
        data, self.waiting = self.waiting, None
        if data is None:
            return
        at = 0
        word = None
        for index, sub, entry in self.parts:
            value = entry.decode(data[at : at + entry.size])
            at += entry.size
            if index == CONTROLWORD:
                word = (index, sub, entry, value)
            else:
                self._write(index, sub, entry, value)
        if word is not None:  # last: it may be about the targets beside it
            self._write(*word)

    def _write(self, index: int, sub: int, entry: Entry, value: Value) -> None:
        try:
            self._objects.write(index, sub, entry, value)
        except SdoAbort:
            return


class Tpdo(Pdo):
    """Sends: at every n-th SYNC, at a SYNC after a change, at a change, or by its timer."""

    def begin(self) -> None:
        """Begin anew: nothing was sent."""
        self._syncs = 0
        self._last: bytes | None = None
        self._sent_ns: int | None = None
        self._seen_ns = 0

    def pack(self) -> bytes:
        """Return the data as of now."""
        objects = self._objects
        parts = self.parts
        return b"".join(entry.encode(objects.number(index, sub)) for index, sub, entry in parts)

    def carries(self, index: int) -> bool:
        """Return whether an object is mapped."""
        return any(part[0] == index for part in self.parts)

    def at_sync(self) -> bytes | None:
        """Return what to send at this SYNC, if anything."""
        if not self.valid or self.kind > LAST_CYCLIC or not self.parts:
            return None
        self._syncs += 1
        if self.kind > 0 and self._syncs < self.kind:
            return None
        self._syncs = 0
        data = self.pack()
        if self.kind == 0 and data == self._last:
            return None
        self._last = data
        return data

    def at_event(self, now_ns: int) -> bytes | None:
        """Return what to send at `now_ns` because it changed, or because its time is over."""
        if not self.valid or self.kind not in EVENT or not self.parts:
            return None
        self._seen_ns = now_ns
        since = None if self._sent_ns is None else now_ns - self._sent_ns
        if since is not None and since < self.inhibit_ns:
            return None
        events = self._events()
        if events == self._last and not (since is not None and 0 < self.timer_ns <= since):
            return None
        self._last, self._sent_ns = events, now_ns
        return self.pack()

    def _events(self) -> bytes:
        """Return what has to change to be events; with a timer, measured values wait for that."""
        number = self._objects.number
        return b"".join(
            entry.encode(number(index, sub))
            for index, sub, entry in self.parts
            if self.timer_ns == 0 or index not in MEASURED
        )

    def next_event_ns(self) -> int | None:
        """Return when its timer or its inhibit time is over."""
        if not self.valid or self.kind not in EVENT or self._sent_ns is None or not self.parts:
            return None
        inhibited = self._sent_ns + self.inhibit_ns
        times = [inhibited] if inhibited > self._seen_ns else []
        if self.timer_ns > 0:
            times.append(self._sent_ns + max(self.timer_ns, self.inhibit_ns))
        return min(times, default=None)
