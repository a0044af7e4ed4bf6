"""SDO abort codes as text, and what to do about them.

Source: CiA 301 v4.2, table of SDO abort codes.
"""

from __future__ import annotations

ABORT_CODES = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "SDO protocol timed out",
    0x05040001: "unknown SDO command",
    0x05040002: "wrong block size",
    0x05040003: "wrong sequence number",
    0x05040004: "CRC error",
    0x05040005: "out of memory",
    0x06010000: "object does not allow this access",
    0x06010001: "attempt to read a write-only object",
    0x06010002: "attempt to write a read-only object",
    0x06020000: "object does not exist",
    0x06040041: "object cannot be mapped to a PDO",
    0x06040042: "mapped objects exceed the length of the PDO",
    0x06040043: "parameter incompatibility",
    0x06040047: "internal incompatibility in the device",
    0x06060000: "hardware error",
    0x06070010: "length does not fit the data type",
    0x06070012: "data too long",
    0x06070013: "data too short",
    0x06090011: "sub-index does not exist",
    0x06090030: "value not allowed",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x06090036: "maximum value is less than minimum value",
    0x060A0023: "resource not available",
    0x08000000: "general error",
    0x08000020: "data cannot be transferred or stored",
    0x08000021: "data cannot be transferred because of local control",
    0x08000022: "data cannot be transferred in the present device state",
    0x08000023: "no object dictionary",
    0x08000024: "no data",
}
"""SDO abort codes of CiA 301."""

NOT_NOW = frozenset((0x05040000, 0x05040005, 0x06060000, 0x08000020, 0x08000021, 0x08000022))
"""Aborts of a read that do not decide whether the object exists."""

NO_OBJECT = frozenset((0x06020000, 0x06090011))
"""Those that say that there is no such object, or no such sub-index."""

_REMEDIES = {
    0x05040000: "check that the node is powered, its id and the bit rate",
    0x06010002: "omit it from the rig: this drive fixes the value",
    0x06020000: "this drive does not have it: omit it, or use other firmware",
    0x06040041: "map another object: the drive's EDS lists those that can be mapped",
    0x06040042: "map fewer objects: a classic PDO has 8 bytes",
    0x06070010: "compare the type with the drive's EDS",
    0x06070012: "compare the type with the drive's EDS",
    0x06070013: "compare the type with the drive's EDS",
    0x06090011: "this drive has fewer sub-indexes: compare with its EDS",
    0x06090030: "give a value that the drive's manual lists",
    0x06090031: "give a smaller value",
    0x06090032: "give a greater value",
    0x08000021: "take the drive out of local control (its configuration tool, its panel)",
    0x08000022: "write it while the drive is disabled and the node is pre-operational",
}


def abort_text(code: int) -> str:
    """Return an SDO abort code as text, with a remedy where there is one."""
    words = ABORT_CODES.get(code)
    if words is None:
        return f"0x{code:08X}: not an abort code of CiA 301; see the drive's manual"
    remedy = _REMEDIES.get(code)
    return f"0x{code:08X}: {words}; {remedy}" if remedy else f"0x{code:08X}: {words}"
