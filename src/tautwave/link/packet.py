"""The datagram between two sites, without sockets: bytes in, a packet or a refusal out.

A packet supersedes all that are older: it has the counters of its slot, those of slots before for
a receiver that missed them, and the newest word on credit. Layout, most significant byte first:

    0   2  "tw"                     24  8  slot
    2   1  version                  32  8  sender's clock [ns] when it left
    3   1  site: 0 master, 1 slave  40  8  clock in the newest packet the sender had got [ns]
    4   1  lines                    48  8  for how long it had it [ns]
    5   1  slots repeated           56     each line: granted, asked, then wave integral and
    6   2  zero                            energy of the slot and of those repeated, 8 bytes each
    8   8  session                 -16 16  seal
    16  8  sequence

The seal is a keyed hash of all before it (BLAKE2s): who has not got the key of the session can
neither make nor change a packet. It does not hide anything.

Source of the seal: RFC 7693. Nothing that comes from a wire raises.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from enum import Enum
from typing import NamedTuple

from tautwave.laws.counters import SPAN

MAGIC = b"tw"
VERSION = 1
SEAL_BYTES = 16
KEY_BYTES = 32
GREATEST_BYTES = 1200
"""What passes every path unfragmented, tunnels included."""

HEADER = struct.Struct(">2sBBBBHQQQQQQ")
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

    session: int
    site: int
    sequence: int
    slot: int
    clock_ns: int
    echo_ns: int
    held_ns: int
    lines: tuple[Line, ...]


class Refusal(Enum):
    """Why a datagram is no packet of this session."""

    FOREIGN = "is no packet of this program"
    VERSION = "speaks another version of the protocol; both sites need the same release"
    LENGTH = "has another length than its header says"
    SITE = "comes from the same side as this one; one site is the master, the other the slave"
    SESSION = "belongs to another session"
    FORGED = "has a seal that does not fit: it was changed on the way, or made without the key"
    RANGE = "has numbers that no site sends"


def packet_size(lines: int, repeated: int) -> int:
    """Return the bytes of a packet."""
    return HEADER.size + lines * (2 + 2 * (1 + repeated)) * COUNTER.size + SEAL_BYTES


def seal_of(content: bytes, key: bytes) -> bytes:
    """Return the keyed hash of a packet's content."""
    return hashlib.blake2s(content, digest_size=SEAL_BYTES, key=key).digest()


def write_packet(packet: Packet, key: bytes) -> bytes:
    """Return a packet as bytes, sealed with the session's key of this direction.

    Raises
    ------
    ValueError
        The packet has no line, lines of unlike length, or does not fit a datagram.
    """
    repeated = {len(line.pairs) - 1 for line in packet.lines}
    if len(repeated) != 1 or min(repeated) < 0:
        raise ValueError("all lines of a packet repeat the same slots, and there is at least one")
    count = repeated.pop()
    if packet_size(len(packet.lines), count) > GREATEST_BYTES:
        raise ValueError(f"a packet has at most {GREATEST_BYTES} bytes: repeat fewer slots")
    head = (packet.session, packet.sequence, packet.slot)
    times = (packet.clock_ns, packet.echo_ns, packet.held_ns)
    parts = [HEADER.pack(MAGIC, VERSION, packet.site, len(packet.lines), count, 0, *head, *times)]
    for line in packet.lines:
        numbers = (line.granted, line.asked, *(part for pair in line.pairs for part in pair))
        parts.append(struct.pack(f">{len(numbers)}Q", *numbers))
    content = b"".join(parts)
    return content + seal_of(content, key)


def read_packet(data: bytes, key: bytes, session: int, site: int) -> Packet | Refusal:
    """Return what a datagram says, or why it is refused; never raises.

    Parameters
    ----------
    data : bytes
        The datagram.
    key : bytes
        The session's key of the direction it came in.
    session, site : int
        This session, and this end: packets come from the other one.
    """
    if len(data) < packet_size(1, 0) or data[:2] != MAGIC:
        return Refusal.FOREIGN
    _, version, sender, lines, repeated, zero, *head = HEADER.unpack_from(data)
    name, sequence, slot, clock_ns, echo_ns, held_ns = head
    if version != VERSION:
        return Refusal.VERSION
    if lines == 0 or len(data) != packet_size(lines, repeated) or len(data) > GREATEST_BYTES:
        return Refusal.LENGTH
    if name != session:
        return Refusal.SESSION
    if sender == site:
        return Refusal.SITE
    if not hmac.compare_digest(data[-SEAL_BYTES:], seal_of(data[:-SEAL_BYTES], key)):
        return Refusal.FORGED
    numbers = struct.unpack_from(f">{(len(data) - HEADER.size - SEAL_BYTES) // 8}Q", data, 56)
    if zero or sender > 1 or repeated > slot or max(slot, *numbers) >= SPAN:
        return Refusal.RANGE
    each = len(numbers) // lines
    found = []
    for at in range(0, len(numbers), each):
        pairs = numbers[at + 2 : at + each]
        found.append(
            Line(numbers[at], numbers[at + 1], tuple(zip(pairs[::2], pairs[1::2], strict=True)))
        )
    return Packet(name, sender, sequence, slot, clock_ns, echo_ns, held_ns, tuple(found))
