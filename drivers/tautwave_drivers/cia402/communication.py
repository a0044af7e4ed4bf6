"""Objects of the CANopen communication profile (CiA 301) that a drive's set-up needs."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from tautwave_drivers.cia402.entry import Entry

_301 = "CiA 301 v4.2, 7.5.2"


def _entry(index: int, sub: int, kind: str, name: str, unit: str, meaning: str) -> Entry:
    return Entry(name, index, sub, kind, unit, meaning, _301)


DEVICE_TYPE = _entry(0x1000, 0, "U32", "device type", "", "low word 0192h: supports CiA 402")
ERROR_REGISTER = _entry(0x1001, 0, "U8", "error register", "bits", "classes of active errors")
ERROR_COUNT = _entry(0x1003, 0, "U8", "error history count", "", "0 written clears it")
ERROR_NEWEST = _entry(0x1003, 1, "U32", "newest error", "", "low word: emergency error code")
SYNC_COB_ID = _entry(0x1005, 0, "U32", "SYNC COB-ID", "", "bit 30: the device produces SYNC")
SYNC_PERIOD = _entry(0x1006, 0, "U32", "SYNC period", "us", "0: none")
SYNC_WINDOW = _entry(0x1007, 0, "U32", "SYNC window", "us", "0: none")
DEVICE_NAME = _entry(0x1008, 0, "STR", "device name", "", "by the manufacturer")
HARDWARE_VERSION = _entry(0x1009, 0, "STR", "hardware version", "", "by the manufacturer")
SOFTWARE_VERSION = _entry(0x100A, 0, "STR", "software version", "", "by the manufacturer")
STORE_ALL = _entry(0x1010, 1, "U32", "store parameters", "", "written 'save': stores everything")
TIME_COB_ID = _entry(0x1012, 0, "U32", "TIME COB-ID", "", "bit 31: it listens, bit 30: it sends")
EMCY_COB_ID = _entry(0x1014, 0, "U32", "EMCY COB-ID", "", "80h + node; bit 31: none is sent")
EMCY_INHIBIT = _entry(
    0x1015, 0, "U16", "EMCY inhibit time", "100 us", "minimum time between two of them"
)
CONSUMER_COUNT = _entry(0x1016, 0, "U8", "heartbeats watched", "", "entries of 1016h")
CONSUMER_HEARTBEAT = _entry(
    0x1016, 1, "U32", "consumer heartbeat", "ms", "node << 16 | time; 0: monitors nothing"
)
PRODUCER_HEARTBEAT = _entry(0x1017, 0, "U16", "producer heartbeat", "ms", "0: sends none")
IDENTITY_COUNT = _entry(0x1018, 0, "U8", "identity entries", "", "entries of 1018h")
VENDOR_ID = _entry(0x1018, 1, "U32", "vendor id", "", "given by CiA")
PRODUCT_CODE = _entry(0x1018, 2, "U32", "product code", "", "by the manufacturer")
REVISION = _entry(0x1018, 3, "U32", "revision", "", "major << 16 | minor")
SERIAL_NUMBER = _entry(0x1018, 4, "U32", "serial number", "", "by the manufacturer")
SYNC_COUNTER = _entry(0x1019, 0, "U8", "SYNC counter overflow", "", "0: SYNC has no counter")
ERROR_BEHAVIOUR = _entry(
    0x1029,
    1,
    "U8",
    "behaviour on communication error",
    "",
    "0: to pre-operational, 1: stays, 2: stopped",
)

SAVE = 0x65766173
"""'save' as the value written to 1010h:01."""

COMMUNICATION = tuple(value for value in list(globals().values()) if isinstance(value, Entry))
"""Every object of this module but those of the PDOs, by index."""

RESERVED = _entry(0x0FFF, 0, "U32", "reserved object", "", "no device has it")

COB_ID_INVALID = 1 << 31
"""Bit of a PDO's COB-ID while the PDO does not exist."""
COB_ID_NO_RTR = 1 << 30
"""Bit of a TPDO's COB-ID: no remote frame allowed."""


class PdoEntries(NamedTuple):
    """The objects of one PDO; `mapped(n)` is the n-th mapping entry, counted from 1."""

    cob_id: Entry
    transmission: Entry
    inhibit_time: Entry
    timer: Entry
    sync_start: Entry
    mapped_count: Entry

    def mapped(self, number: int) -> Entry:
        """Return the mapping entry `number` (1 to 64)."""
        return replace(
            self.mapped_count,
            name=f"mapping entry {number}",
            sub=number,
            type="U32",
            meaning="index << 16 | sub-index << 8 | length in bits",
        )


def rpdo(number: int) -> PdoEntries:
    """Return the objects of receive PDO `number` (1 to 512): 1400h and 1600h onwards."""
    return _pdo(0x1400, number, "deadline timer", "timeout without a frame: 8250h; 0: none")


def tpdo(number: int) -> PdoEntries:
    """Return the objects of transmit PDO `number` (1 to 512): 1800h and 1A00h onwards."""
    return _pdo(0x1800, number, "event timer", "maximum interval between frames; 0: none")


def _pdo(base: int, number: int, timer: str, meaning: str) -> PdoEntries:
    at = base + number - 1
    kind = "0 on change with SYNC, 1 to 240 every n-th SYNC, 254 and 255 on event"
    return PdoEntries(
        _entry(at, 1, "U32", "COB-ID", "", "bit 31: does not exist; bit 30: no RTR"),
        _entry(at, 2, "U8", "transmission type", "", kind),
        _entry(at, 3, "U16", "inhibit time", "100 us", "minimum time between two frames"),
        _entry(at, 5, "U16", timer, "ms", meaning),
        _entry(
            at, 6, "U8", "SYNC start value", "", "counter of the first SYNC that counts; 0: any"
        ),
        _entry(at + 0x200, 0, "U8", "mapped objects", "", "0 while the mapping is changed"),
    )
