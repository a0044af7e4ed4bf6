"""The datagram between two sites, without sockets: bytes in, a packet or a refusal out.

A packet supersedes all that are older: it has the counters of its slot, those of slots before for
a receiver that missed them, and the newest word on credit. Layout, most significant byte first:

    0   1  version                   8  8  slot
    1   1  site: 0 master, 1 slave  16  8  sender's clock [ns] when it left
    2   1  lines                    24  8  clock in the newest packet the sender had got [ns]
    3   1  slots repeated           32  8  for how long it had it [ns]
    4   4  zero                     40     each line: granted, asked, then wave integral and
                                           energy of the slot and of those repeated, 8 bytes each

On the way it is sealed (`tautwave.sites.seal`), which adds session and sequence and keeps out what
is forged, repeated or of another session. Nothing that comes from a wire raises.
"""

from __future__ import annotations

import functools
import struct
from enum import Enum
from typing import NamedTuple

from tautwave.laws.counters import SPAN

VERSION = 1
MAX_BYTES = 1160
"""What passes every path unfragmented, tunnels and the seal included."""

HEADER = struct.Struct(">BBBBIQQQQ")
FIELDS = 9
"""Numbers of the header."""
COUNTER = struct.Struct(">Q")


class Line(NamedTuple):
    """One wave line of a packet, as counters.

    granted, asked: energy sent back, and how much in all would be taken; pairs: wave integral and
    energy of the packet's slot and of those before it, newest first.
    """

    granted: int
    asked: int
    pairs: tuple[tuple[int, int], ...]


class Packet(NamedTuple):
    """One slot of one site; times [ns] are those of monotonic clocks.

    clock_ns: sender's clock when it left; echo_ns, held_ns: `clock_ns` of the newest packet that
    the sender had got, and for how long it had it; 0, 0 before the first.
    """

    site: int
    slot: int
    clock_ns: int
    echo_ns: int
    held_ns: int
    lines: tuple[Line, ...]


class Refusal(Enum):
    """Why a payload is not a packet."""

    SHORT = "is too short for a packet"
    VERSION = "uses another protocol version; both sites need the same release"
    LENGTH = "has a length that differs from its header"
    SITE = "comes from the same side as this one; one site is the master, the other the slave"
    RANGE = "contains values that no site sends"


def packet_size(lines: int, repeated: int) -> int:
    """Return the bytes of a packet."""
    return HEADER.size + lines * (2 + 2 * (1 + repeated)) * COUNTER.size


@functools.cache
def layout(lines: int, repeated: int) -> struct.Struct:
    """Return header and numbers of a packet that fits a datagram: as few as there are of those."""
    return struct.Struct(f"{HEADER.format}{lines * (2 + 2 * (1 + repeated))}Q")


def write_packet(packet: Packet) -> bytes:
    """Return a packet as bytes.

    Raises
    ------
    ValueError
        The packet has no line, lines of unlike length, or does not fit a datagram.
    """
    site, slot, clock_ns, echo_ns, held_ns, lines = packet
    count = len(lines[0].pairs) if lines else 0
    numbers: list[int] = []
    for granted, asked, pairs in lines:
        if len(pairs) != count:
            count = 0
        numbers += (granted, asked)
        for pair in pairs:
            numbers += pair
    if count == 0:
        raise ValueError("all lines of a packet repeat the same slots, and there is at least one")
    if packet_size(len(lines), count - 1) > MAX_BYTES:
        raise ValueError(f"a packet has at most {MAX_BYTES} bytes: repeat fewer slots")
    return layout(len(lines), count - 1).pack(
        VERSION, site, len(lines), count - 1, 0, slot, clock_ns, echo_ns, held_ns, *numbers
    )


def read_packet(data: bytes, site: int) -> Packet | Refusal:
    """Return what an opened payload says, or why it is refused; never raises.

    Parameters
    ----------
    data : bytes
        The payload.
    site : int
        This end: packets come from the other one.
    """
    if len(data) < packet_size(1, 0):
        return Refusal.SHORT
    if data[0] != VERSION:
        return Refusal.VERSION
    lines, repeated = data[2], data[3]
    if lines == 0 or len(data) != packet_size(lines, repeated) or len(data) > MAX_BYTES:
        return Refusal.LENGTH
    fields = layout(lines, repeated).unpack(data)
    _, sender, _, _, zero, slot, clock_ns, echo_ns, held_ns = fields[:FIELDS]
    if sender == site:
        return Refusal.SITE
    if zero or sender > 1 or repeated > slot or max(slot, *fields[FIELDS:]) >= SPAN:
        return Refusal.RANGE
    each = (len(fields) - FIELDS) // lines
    read = []
    for at in range(FIELDS, len(fields), each):
        to = at + each
        pairs = tuple(zip(fields[at + 2 : to : 2], fields[at + 3 : to : 2], strict=True))
        read.append(Line(fields[at], fields[at + 1], pairs))
    return Packet(sender, slot, clock_ns, echo_ns, held_ns, tuple(read))
