"""PDO set-up of one drive by SDO: the mapping procedure, and reading all of it back.

COB-ID, type and mapping are written apart from the ledger of settings: as one procedure, in which a
value holds only with those after it, and is compared once all are written.
Source: CiA 301 v4.2, 7.5.2.36 and 7.5.2.38: make the PDO invalid, set its type, its mapping count
to 0, its entries, the count, then make it valid.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from tautwave.errors import DeviceFault
from tautwave_drivers.canopen.mapping import Layout, as_held
from tautwave_drivers.canopen.network import AbortError, RemoteDrive
from tautwave_drivers.canopen.setup.settings import require
from tautwave_drivers.cia402.communication import (
    COB_ID_INVALID,
    COB_ID_NO_RTR,
    PdoEntries,
    rpdo,
    tpdo,
)
from tautwave_drivers.cia402.entry import Entry

_ID_BITS = 0x7FF
MAX_PDOS, PDOS_OF_AN_AXIS = 512, 64
"""PDOs in each direction, and of each axis of a drive with several (CiA 402-1)."""
MAX_MAPPED = 8
PROBING_NS = 2_000_000_000
_TYPES = {1: "on every SYNC", 255: "on event"}


def map_pdo(
    drive: RemoteDrive,
    pdo: PdoEntries,
    what: str,
    cob_id: int,
    kind: int,
    layouts: Sequence[Layout],
    timing: Mapping[Entry, int] | None = None,
) -> tuple[str, Layout]:
    """Set up one PDO; return the note about it, and its layout: the first that the drive takes.

    The mapping is read first. One that is as wanted is not written; one that cannot be written is
    taken as it is where it has all objects. `timing` are times of the PDO, where the drive has
    them: they too change only while it is off.

    Raises
    ------
    DriverError
        The drive refuses an object, or holds something else than was written.
    """
    keep = drive.number(pdo.cob_id) & COB_ID_NO_RTR  # drives reject changes of it
    drive.write(pdo.cob_id, COB_ID_INVALID | keep | cob_id)
    drive.write(pdo.transmission, kind)
    layout, how = _map(drive, pdo, what, layouts)
    for entry, value in (timing or {}).items():
        require(
            drive, entry, value, "the drive would not send in every cycle; set it with its tool"
        )
    drive.write(pdo.cob_id, keep | cob_id)
    _compare(drive, pdo.cob_id, cob_id, mask=COB_ID_INVALID | _ID_BITS)
    _compare(drive, pdo.transmission, kind)
    text = f"{drive.name}: {what} 0x{cob_id:03X} {_TYPES[kind]}: {layout.text()}; {how}"
    return text, layout


def _map(
    drive: RemoteDrive, pdo: PdoEntries, what: str, layouts: Sequence[Layout]
) -> tuple[Layout, str]:
    """Map the first layout that the drive takes; return it and how it came to be."""
    held = _mapped(drive, pdo)
    refusals: list[AbortError] = []
    for layout in layouts:
        less = f" (lean: {refusals[0]})" if refusals else ""
        if held == layout.words:
            return layout, f"already so{less}"
        try:
            drive.write(pdo.mapped_count, 0)
            for number, entry in enumerate(layout.entries, 1):
                drive.write(pdo.mapped(number), entry.mapping)
            drive.write(pdo.mapped_count, len(layout.entries))
        except AbortError as err:
            refusals.append(err)
            before, held = held, _mapped(drive, pdo)
            as_it_is = as_held(layout, held, sent=pdo.cob_id.index >= 0x1800)
            if as_it_is is not None and held == before:
                return as_it_is, f"as the drive has it fixed{less}"
            continue
        _compare(drive, pdo.mapped_count, len(layout.entries))
        for number, entry in enumerate(layout.entries, 1):
            _compare(drive, pdo.mapped(number), entry.mapping)
        drive.settings.changed.append(pdo.mapped_count)
        return layout, f"written and read back{less}"
    tried = "; nor as ".join(layout.text() for layout in layouts)
    has = ", ".join(f"{word:08X}" for word in held) or "nothing"
    raise DeviceFault(
        f"{drive.name}: {what} cannot be mapped as {tried}: {refusals[-1]}; it has {has} "
        f"({pdo.mapped_count.address})"
    )


def _mapped(drive: RemoteDrive, pdo: PdoEntries) -> list[int]:
    """Return the mapping entries that the drive holds."""
    count = drive.find(pdo.mapped_count) or 0
    words = [drive.find(pdo.mapped(number)) for number in range(1, min(count, MAX_MAPPED) + 1)]
    return [word for word in words if word is not None]


def _compare(drive: RemoteDrive, entry: Entry, wanted: int, mask: int = -1) -> None:
    value = drive.number(entry)
    if value & mask != wanted & mask:
        raise DeviceFault(
            f"{drive.name} reads 0x{value:X} at {entry.address} {entry.name} after 0x{wanted:X} "
            "was written: its PDO mapping may be fixed; see its manual"
        )


def silence_others(drive: RemoteDrive, used: Collection[int], named: Collection[int]) -> list[str]:
    """Switch off every PDO but the first ones: nothing else writes a target or loads the bus.

    Parameters
    ----------
    drive : RemoteDrive
        The drive.
    used : collection of int
        COB-IDs that have a use on this bus.
    named : collection of int
        Indices that the drive's EDS has.

    Raises
    ------
    DeviceFault
        One stays on with a COB-ID that has another use.
    """
    off: list[str] = []
    notes = []
    end = drive.clock.now_ns() + PROBING_NS
    for name, base, make in (("RPDO", 0x1400, rpdo), ("TPDO", 0x1800, tpdo)):
        listed = {index - base + 1 for index in named if 0 < index - base < MAX_PDOS}
        for number, cob_id in _valid_pdos(drive, make, listed, end):
            entry = make(number).cob_id
            try:
                drive.write(entry, cob_id | COB_ID_INVALID)
            except AbortError as err:
                if cob_id & _ID_BITS in used:
                    raise DeviceFault(
                        f"{drive.name}: {entry.address} {name}{number} has the COB-ID "
                        f"0x{cob_id & _ID_BITS:X}, which has another use on this bus, and cannot "
                        f"be switched off: {err}"
                    ) from err
                notes.append(f"{drive.name}: {name}{number} stays on: {err}")
                continue
            _compare(drive, entry, COB_ID_INVALID, mask=COB_ID_INVALID)
            off.append(f"{name}{number}")
            drive.settings.changed.append(entry)
    if drive.clock.now_ns() > end:
        notes.append(
            f"{drive.name} took {PROBING_NS * 1e-9:g} s to list its PDOs: not all were checked"
        )
    return [*notes, f"{drive.name}: switched off {', '.join(off)}"] if off else notes


def _valid_pdos(
    drive: RemoteDrive, make: Callable[[int], PdoEntries], listed: set[int], end_ns: int
) -> Iterator[tuple[int, int]]:
    """Yield number and COB-ID of the PDOs that are on, but for the first.

    Upwards until one does not exist, of each axis that a drive may have, and those of its EDS.
    """
    ahead = sorted(listed, reverse=True)
    for block in range(1, MAX_PDOS, PDOS_OF_AN_AXIS):
        number = block
        while number < block + PDOS_OF_AN_AXIS and drive.clock.now_ns() < end_ns:
            cob_id = drive.find(make(number).cob_id)
            listed.discard(number)
            if cob_id is None:
                break
            if number > 1 and not cob_id & COB_ID_INVALID:
                yield number, cob_id
            number += 1
    while ahead and drive.clock.now_ns() < end_ns:
        number = ahead.pop()
        cob_id = drive.find(make(number).cob_id) if number in listed else None
        if cob_id is not None and number > 1 and not cob_id & COB_ID_INVALID:
            yield number, cob_id
