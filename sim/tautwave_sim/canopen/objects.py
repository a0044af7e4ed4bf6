"""The objects of a simulated drive, with types, access and defaults.

Sources: CiA 301 v4.2.0, 7.5.2 (communication area); CiA 402-2 v3.0 (drive profile). Values that
depend on the drive (identity, factors, modes) are set by the caller.
"""

from __future__ import annotations

from tautwave_sim.canopen.dictionary import NO_OBJECT, Entry, ObjectDictionary
from tautwave_sim.canopen.options import Quirks

PDOS = 4
MAPPED = 8
DEVICE_TYPE = 0x00020192
"""Profile 402, servo drive (CiA 402-2, 1000h)."""

SAVE, LOAD = 0x65766173, 0x64616F6C
INVALID = 0x80000000
NO_RTR = 0x40000000

_U8, _U16, _U32, _I8, _I16, _I32 = "U8", "U16", "U32", "I8", "I16", "I32"

COMMUNICATION = (
    (0x1000, 0, Entry(_U32, "ro", DEVICE_TYPE)),
    (0x1001, 0, Entry(_U8, "ro", 0, "t")),
    (0x1003, 0, Entry(_U8, "rw", 0)),
    (0x1005, 0, Entry(_U32, "rw", 0x80)),
    (0x1006, 0, Entry(_U32, "rw", 0)),
    (0x1007, 0, Entry(_U32, "rw", 0)),
    (0x1008, 0, Entry("STR", "const", b"tautwave simulated CiA 402 drive")),
    (0x1009, 0, Entry("STR", "const", b"none")),
    (0x100A, 0, Entry("STR", "const", b"1")),
    (0x1010, 0, Entry(_U8, "ro", 1)),
    (0x1010, 1, Entry(_U32, "rw", 1)),
    (0x1011, 0, Entry(_U8, "ro", 1)),
    (0x1011, 1, Entry(_U32, "rw", 1)),
    (0x1015, 0, Entry(_U16, "rw", 0)),
    (0x1016, 0, Entry(_U8, "ro", 4)),
    (0x1017, 0, Entry(_U16, "rw", 0)),
    (0x1018, 0, Entry(_U8, "ro", 4)),
    (0x1018, 1, Entry(_U32, "ro", 0)),
    (0x1018, 2, Entry(_U32, "ro", 0)),
    (0x1018, 3, Entry(_U32, "ro", 0)),
    (0x1018, 4, Entry(_U32, "ro", 0)),
    (0x1019, 0, Entry(_U8, "rw", 0)),
    (0x1029, 0, Entry(_U8, "ro", 1)),
    (0x1029, 1, Entry(_U8, "rw", 0, high=2)),
)

DRIVE = (
    (0x6007, 0, Entry(_I16, "rw", 1, low=0, high=3)),
    (0x603F, 0, Entry(_U16, "ro", 0, "t")),
    (0x6040, 0, Entry(_U16, "rw", 0, "rt")),
    (0x6041, 0, Entry(_U16, "ro", 0, "t")),
    (0x605A, 0, Entry(_I16, "rw", 2, low=0, high=8)),
    (0x605B, 0, Entry(_I16, "rw", 0, low=0, high=1)),
    (0x605C, 0, Entry(_I16, "rw", 1, low=0, high=1)),
    (0x605D, 0, Entry(_I16, "rw", 1, low=1, high=2)),
    (0x605E, 0, Entry(_I16, "rw", 2, low=0, high=2)),
    (0x6060, 0, Entry(_I8, "rw", 0, "rt")),
    (0x6061, 0, Entry(_I8, "ro", 0, "t")),
    (0x6062, 0, Entry(_I32, "ro", 0, "t")),
    (0x6064, 0, Entry(_I32, "ro", 0, "t")),
    (0x6065, 0, Entry(_U32, "rw", 0xFFFFFFFF)),
    (0x6066, 0, Entry(_U16, "rw", 0)),
    (0x6067, 0, Entry(_U32, "rw", 10)),
    (0x606C, 0, Entry(_I32, "ro", 0, "t")),
    (0x606D, 0, Entry(_U16, "rw", 1000)),
    (0x6071, 0, Entry(_I16, "rw", 0, "rt")),
    (0x6072, 0, Entry(_U16, "rw", 3000, "rt")),
    (0x6073, 0, Entry(_U16, "rw", 3000, "rt")),
    (0x6074, 0, Entry(_I16, "ro", 0, "t")),
    (0x6075, 0, Entry(_U32, "rw", 1000)),
    (0x6076, 0, Entry(_U32, "rw", 1000)),
    (0x6077, 0, Entry(_I16, "ro", 0, "t")),
    (0x6078, 0, Entry(_I16, "ro", 0, "t")),
    (0x607A, 0, Entry(_I32, "rw", 0, "rt")),
    (0x607C, 0, Entry(_I32, "rw", 0)),
    (0x607D, 0, Entry(_U8, "ro", 2)),
    (0x607D, 1, Entry(_I32, "rw", -(1 << 31))),
    (0x607D, 2, Entry(_I32, "rw", (1 << 31) - 1)),
    (0x607F, 0, Entry(_U32, "rw", 0xFFFFFFFF, "rt")),
    (0x6080, 0, Entry(_U32, "rw", 0xFFFFFFFF, "rt")),
    (0x6081, 0, Entry(_U32, "rw", 1000, "rt")),
    (0x6083, 0, Entry(_U32, "rw", 10000, "rt")),
    (0x6084, 0, Entry(_U32, "rw", 10000, "rt")),
    (0x6085, 0, Entry(_U32, "rw", 100000, "rt")),
    (0x6086, 0, Entry(_I16, "rw", 0, low=0, high=0)),
    (0x6087, 0, Entry(_U32, "rw", 10000, "rt")),
    (0x608F, 0, Entry(_U8, "ro", 2)),
    (0x608F, 1, Entry(_U32, "rw", 1)),
    (0x608F, 2, Entry(_U32, "rw", 1)),
    (0x6091, 0, Entry(_U8, "ro", 2)),
    (0x6091, 1, Entry(_U32, "rw", 1)),
    (0x6091, 2, Entry(_U32, "rw", 1)),
    (0x6092, 0, Entry(_U8, "ro", 2)),
    (0x6092, 1, Entry(_U32, "rw", 1)),
    (0x6092, 2, Entry(_U32, "rw", 1)),
    (0x6098, 0, Entry(_I8, "rw", 37)),
    (0x6099, 0, Entry(_U8, "ro", 2)),
    (0x6099, 1, Entry(_U32, "rw", 1000)),
    (0x6099, 2, Entry(_U32, "rw", 100)),
    (0x609A, 0, Entry(_U32, "rw", 10000)),
    (0x60B0, 0, Entry(_I32, "rw", 0, "rt")),
    (0x60B1, 0, Entry(_I32, "rw", 0, "rt")),
    (0x60B2, 0, Entry(_I16, "rw", 0, "rt")),
    (0x60C2, 0, Entry(_U8, "ro", 2)),
    (0x60C2, 1, Entry(_U8, "rw", 1, low=1)),
    (0x60C2, 2, Entry(_I8, "rw", -3, low=-9, high=0)),
    (0x60F4, 0, Entry(_I32, "ro", 0, "t")),
    (0x60FF, 0, Entry(_I32, "rw", 0, "rt")),
    (0x60FD, 0, Entry(_U32, "ro", 0)),
    (0x6502, 0, Entry(_U32, "ro", 0)),
)

RPDO_DEFAULTS = ((0x60400010,), (0x60400010, 0x60600008), (0x60400010, 0x607A0020))
TPDO_DEFAULTS = ((0x60410010,), (0x60410010, 0x60610008), (0x60410010, 0x60640020))
VELOCITY_DEFAULTS = ((0x60400010, 0x60FF0020), (0x60410010, 0x606C0020))
"""Mapping of PDO 1 to 3, and of RPDO 4 and TPDO 4 (CiA 402-2, profile velocity)."""


def build(node_id: int, quirks: Quirks) -> ObjectDictionary:
    """Return the objects of one drive, at their defaults."""
    objects = ObjectDictionary()
    for index, sub, entry in (*COMMUNICATION, *DRIVE):
        objects.add(index, sub, entry)
    objects.add(0x1014, 0, Entry(_U32, "rw", 0x80 + node_id))
    for sub in range(1, 5):
        objects.add(0x1016, sub, Entry(_U32, "rw", 0))
    for dummy, kind in ((2, _I8), (3, _I16), (4, _I32), (5, _U8), (6, _U16), (7, _U32)):
        objects.add(dummy, 0, Entry(kind, "wo", 0, "r"))  # fillers of RPDOs (CiA 301, 7.4.7)
    for number in range(PDOS):
        _add_pdo(objects, 0x1400 + number, 0x200 + 0x100 * number + node_id, number)
        _add_pdo(objects, 0x1800 + number, 0x180 + 0x100 * number + node_id, number)
        if quirks.rpdo_timer != "yes":
            objects.remove(0x1400 + number, 5)
            if quirks.rpdo_timer == "no_object":
                objects.refusals[0x1400 + number, 5] = NO_OBJECT
            objects.add(0x1400 + number, 0, Entry(_U8, "ro", 2))
    if not quirks.heartbeat_consumer:
        objects.remove(0x1016)
    if not quirks.abort_option:
        objects.remove(0x6007)
    if not quirks.quick_stop_option:
        objects.add(0x605A, 0, Entry(_I16, "ro", 2))
    if not quirks.interpolation_period:
        objects.remove(0x60C2)
    return objects


def _add_pdo(objects: ObjectDictionary, index: int, cob_id: int, number: int) -> None:
    sends = index >= 0x1800
    flags = (0 if number == 0 else INVALID) | (NO_RTR if sends else 0)
    objects.add(index, 0, Entry(_U8, "ro", 5))
    objects.add(index, 1, Entry(_U32, "rw", cob_id | flags))
    objects.add(index, 2, Entry(_U8, "rw", 255))
    objects.add(index, 3, Entry(_U16, "rw", 0))
    objects.add(index, 5, Entry(_U16, "rw", 0))
    defaults = TPDO_DEFAULTS if sends else RPDO_DEFAULTS
    mapped = (*defaults, VELOCITY_DEFAULTS[sends])[number]
    objects.add(index + 0x200, 0, Entry(_U8, "rw", len(mapped), high=MAPPED))
    for sub in range(1, MAPPED + 1):
        default = mapped[sub - 1] if sub <= len(mapped) else 0
        objects.add(index + 0x200, sub, Entry(_U32, "rw", default))
