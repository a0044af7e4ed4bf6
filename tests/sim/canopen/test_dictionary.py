"""Values of objects: each type ends where CiA 301 has it end."""

from __future__ import annotations

import pytest

from tautwave_sim.canopen.dictionary import Entry

TYPES = {
    "U8": (0, 255),
    "I8": (-128, 127),
    "U16": (0, 65535),
    "I16": (-32768, 32767),
    "I32": (-(2**31), 2**31 - 1),
}


@pytest.mark.parametrize("kind", TYPES)
def test_a_value_beyond_its_type_is_held_at_its_end(kind: str) -> None:
    entry, (least, greatest) = Entry(kind, "rw", 0), TYPES[kind]
    assert entry.bounds() == (least, greatest)
    for end, beyond in ((least, least - 1), (greatest, greatest + 1)):
        assert entry.encode(beyond) == end.to_bytes(entry.size, "little", signed=least < 0)
