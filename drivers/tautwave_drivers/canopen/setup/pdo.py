"""PDO set-up of one drive by SDO: the mapping procedure, and reading all of it back.

Source: CiA 301 v4.2, 7.5.2.36 and 7.5.2.38: make the PDO invalid, set its type, its mapping count
to 0, its entries, the count, then make it valid.
"""

from __future__ import annotations

from tautwave.errors import DeviceFault
from tautwave_drivers.canopen.bus.network import AbortError, RemoteDrive
from tautwave_drivers.canopen.mapping import Layout
from tautwave_drivers.cia402.communication import (
    COB_ID_INVALID,
    COB_ID_NO_RTR,
    PdoEntries,
    rpdo,
    tpdo,
)
from tautwave_drivers.cia402.entry import Entry

_ID_BITS = 0x7FF
OTHERS = (2, 3, 4)
_TYPES = {1: "on every SYNC", 255: "on event"}


def map_pdo(
    drive: RemoteDrive, pdo: PdoEntries, what: str, cob_id: int, kind: int, layout: Layout
) -> str:
    """Write one PDO, read it back, and return the note about it.

    Raises
    ------
    DriverError
        The drive refuses an object, or holds something else than was written.
    """
    keep = drive.number(pdo.cob_id) & COB_ID_NO_RTR  # drives reject changes of it
    drive.write(pdo.cob_id, COB_ID_INVALID | keep | cob_id)
    drive.write(pdo.transmission, kind)
    drive.write(pdo.mapped_count, 0)
    for number, entry in enumerate(layout.entries, 1):
        drive.write(pdo.mapped(number), entry.mapping)
    drive.write(pdo.mapped_count, len(layout.entries))
    drive.write(pdo.cob_id, keep | cob_id)
    _compare(drive, pdo.cob_id, cob_id, mask=COB_ID_INVALID | _ID_BITS)
    _compare(drive, pdo.transmission, kind)
    _compare(drive, pdo.mapped_count, len(layout.entries))
    for number, entry in enumerate(layout.entries, 1):
        _compare(drive, pdo.mapped(number), entry.mapping)
    return (
        f"{drive.name}: {what} 0x{cob_id:03X} {_TYPES[kind]}: {layout.text()}; "
        "written and read back"
    )


def _compare(drive: RemoteDrive, entry: Entry, wanted: int, mask: int = -1) -> None:
    found = drive.number(entry)
    if found & mask != wanted & mask:
        raise DeviceFault(
            f"{drive.name} reads 0x{found:X} at {entry.address} {entry.name} after 0x{wanted:X} "
            "was written: its PDO mapping may be fixed; see its manual"
        )


def silence_others(drive: RemoteDrive) -> str:
    """Switch off PDOs 2 to 4, so that nothing else writes a target or loads the bus."""
    off = []
    for name, make in (("RPDO", rpdo), ("TPDO", tpdo)):
        for number in OTHERS:
            entry = make(number).cob_id
            found = drive.find(entry)
            if found is None:
                break
            if found & COB_ID_INVALID:
                continue
            try:
                drive.write(entry, found | COB_ID_INVALID)
            except AbortError as err:
                return f"{drive.name}: {name}{number} stays on: {err}"
            _compare(drive, entry, COB_ID_INVALID, mask=COB_ID_INVALID)
            off.append(f"{name}{number}")
    return f"{drive.name}: switched off {', '.join(off)}" if off else ""
