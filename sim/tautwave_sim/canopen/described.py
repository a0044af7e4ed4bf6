"""A simulated drive follows the EDS or DCF that a rig names for it: objects, access, defaults.

What the file leaves out is refused as a drive refuses it, though the simulation goes on using it.
Values by which the motor is simulated stay the rig's where the file states nothing: an increment
per turn, a rated torque of 0. Parameter values of a DCF are for the master to write.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tautwave.contracts import DescribedObject
from tautwave_sim.canopen.dictionary import NO_OBJECT, NO_SUBINDEX, SIZES, Entry, ObjectDictionary
from tautwave_sim.canopen.objects import INVALID, MAPPED, PDOS

CONTROLWORD, STATUSWORD = (0x6040, 0), (0x6041, 0)
MODES = (0x6502, 0)
_MANDATORY = (0x1000, 0x1001, 0x1018)
_PDOS = range(0x1400, 0x1C00)
_STATES_NOTHING: Mapping[tuple[int, int], tuple[int, ...]] = {
    (0x1000, 0): (0,), (0x6075, 0): (0,), (0x6076, 0): (0,), (0x608F, 1): (0, 1), (0x608F, 2): (0,),
    (0x6091, 1): (0,), (0x6091, 2): (0,), (0x6092, 1): (0, 1), (0x6092, 2): (0,), MODES: (0,),
}  # fmt: skip
"""Defaults that state nothing, as of a drive that knows no motor yet."""
_IDENTITY = 0x1018

Key = tuple[int, int]


def follow(
    objects: ObjectDictionary, found: Sequence[DescribedObject], *, identified: bool
) -> int | None:
    """Fill a dictionary from a file; return its modes as in 6502h, None where not stated.

    `identified`: the rig states the drive's identity, which then stays.
    """
    listed = {(one.index, one.sub): one for one in found}
    for key, one in listed.items():
        if not (identified and one.index == _IDENTITY):
            _take(objects, key, one)
    if CONTROLWORD in listed and STATUSWORD in listed:  # not a file of some objects only
        _hide(objects, listed)
    for base in (0x1600, 0x1A00):
        for number in range(PDOS):
            _mapping(objects, base + number)
    modes = listed.get(MODES)
    value = None if modes is None else modes.default
    return value if isinstance(value, int) and value else None


def _take(objects: ObjectDictionary, key: Key, one: DescribedObject) -> None:
    held = objects.entries.get(key[0], {}).get(key[1])
    kind = one.kind if one.kind in SIZES or held is None else held.kind
    kind = kind if kind in SIZES else "STR"
    if held is not None and SIZES.get(kind) != SIZES.get(held.kind):
        kind = held.kind  # its value is computed with this type
    default = one.default
    if default is None or isinstance(default, bytes) != (kind == "STR"):
        default = held.default if held is not None else b"" if kind == "STR" else 0
    if held is not None and default in _STATES_NOTHING.get(key, ()):
        default = held.default
    carried = held.pdo if held is not None else "t" if one.access in ("ro", "const") else "rt"
    pdo = "" if one.mapped is False or (held is None and not one.mapped) else carried
    objects.add(*key, Entry(kind, one.access, default, pdo))


def _hide(objects: ObjectDictionary, listed: Mapping[Key, DescribedObject]) -> None:
    indices = {index for index, _ in listed}
    has_pdos = any(index in _PDOS for index in indices)
    for key in list(objects.values):
        index, _ = key
        if key in listed or index < 0x1000 or index in _MANDATORY:
            continue
        if index in _PDOS and not has_pdos:
            continue
        objects.refusals[key] = NO_SUBINDEX if index in indices else NO_OBJECT


def _mapping(objects: ObjectDictionary, index: int) -> None:
    """Leave a mapping empty, and its PDO off, where its objects are not ones that it can carry."""
    letter = "t" if index >= 0x1A00 else "r"
    count = objects.number(index, 0)
    words = [objects.values.get((index, sub)) for sub in range(1, count + 1)]
    if count <= MAPPED and all(_carried(objects, word, letter) for word in words):
        return
    held = objects.entries[index][0]
    objects.add(index, 0, held._replace(default=0))
    com = objects.entries[index - 0x200][1]
    if isinstance(com.default, int):
        objects.add(index - 0x200, 1, com._replace(default=com.default | INVALID))


def _carried(objects: ObjectDictionary, word: int | bytes | None, letter: str) -> bool:
    if not isinstance(word, int):
        return False
    key = word >> 16, word >> 8 & 0xFF
    entry = objects.entries.get(key[0], {}).get(key[1])
    if entry is None or key in objects.refusals or 8 * entry.size != word & 0xFF:
        return False
    return letter in entry.pdo
