"""What an EDS or DCF says that a run would be refused for, before any wire."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tautwave_drivers.canopen.files.reading import DeviceFile
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import mode_name, supported_text, supports

CIA_402 = 0x0192
PROFILES = {0x0191: "an I/O module (CiA 401)", 0x0196: "an encoder (CiA 406)"}


def no_drive(file: DeviceFile) -> str:
    """Return why a file describes no drive, '' where it may."""
    kind = file.number(c.DEVICE_TYPE)
    if not kind or kind & 0xFFFF == CIA_402:
        return ""
    what = PROFILES.get(kind & 0xFFFF, "another device")
    return (
        f"{file.path} describes {what}, not a CiA 402 drive: 1000:00 device type is 0x{kind:08X}, "
        "but its low word should be 0192"
    )


def lacking(file: DeviceFile, mode: int, needed: Sequence[Entry]) -> Iterator[str]:
    """Yield why a drive as in the file cannot run in `mode`, which needs some objects.

    A file without controlword and statusword lists only some objects, and tells nothing by what it
    leaves out.
    """
    known = {o.CONTROLWORD, o.STATUSWORD}
    if any((entry.index, entry.sub) not in file.objects for entry in known):
        return
    modes = file.number(o.SUPPORTED_MODES)
    if modes and not supports(modes, mode):
        yield (
            f"{file.path} has no {mode_name(mode)}: 6502:00 (0x{modes:X}) lists "
            f"{supported_text(modes)}"
        )
    for entry in needed:
        if (entry.index, entry.sub) not in file.objects:
            yield f"{file.path} has no {entry.address} {entry.name}, which {mode_name(mode)} needs"


def unwatched(file: DeviceFile) -> str:
    """Return why a drive as in the file would go on when its master stops, '' where it may not."""

    def has(entry: Entry) -> bool:
        found = file.objects.get((entry.index, entry.sub))
        return found is not None and found.writable

    if (o.CONTROLWORD.index, 0) not in file.objects:
        return ""
    if not has(c.CONSUMER_HEARTBEAT) and not has(c.rpdo(1).timer):
        return "it has no watchdog (neither 1016:01 nor 1400:05 can be written)"
    if (o.ABORT_CONNECTION.index, 0) not in file.objects:
        return "it does not say how it reacts to a lost master (no 6007:00)"
    return ""
