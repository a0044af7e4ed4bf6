"""Values of objects: each type ends where CiA 301 has it end."""

from __future__ import annotations

import pytest

from tautwave_sim.canopen.dictionary import Entry
from tests.sim.canopen.master import Master, SdoRefusal

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


@pytest.mark.parametrize(
    ("index", "sub", "wrong", "right", "code"),
    [
        (0x1005, 0, (0x40000080, 0x81, 0), 0x80, 0x06090030),  # it produces no SYNC
        (0x1014, 0, (0x80, 0x181), 0x85, 0x06090030),
        (0x1014, 0, (0x80,), 0x80000080, 0x06090030),  # any, while it is off
        (0x1010, 1, (0x64616F6C,), 0x65766173, 0x08000020),  # "load" where "save" is due
        (0x1011, 1, (0x65766173,), 0x64616F6C, 0x08000020),
    ],
)
def test_an_object_of_communication_takes_what_cia_301_lets_it(
    index: int, sub: int, wrong: tuple[int, ...], right: int, code: int
) -> None:
    node = Master()
    node.wait()
    for value in wrong:
        with pytest.raises(SdoRefusal, match=f"{code:08X}"):
            node.write(1, index, sub, value, 4)
    node.write(1, index, sub, right, 4)
