"""What an EDS or DCF says that a run would be refused for, before any wire."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tautwave_drivers.canopen.files.reading import DeviceFile
from tautwave_drivers.canopen.mapping import Layout, Mapping, as_held
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import mode_name, supported_text, supports
from tautwave_drivers.cia402.reactions import acts_on_loss

CIA_402 = 0x0192
DRIVE_PROFILE = range(0x6000, 0xA000)
PROFILES = {0x0191: "an I/O module (CiA 401)", 0x0196: "an encoder (CiA 406)"}


def no_drive(file: DeviceFile) -> str:
    """Return why a file describes no drive, '' where it may."""
    kind = file.number(c.DEVICE_TYPE)
    if kind == 0 and not any(index in DRIVE_PROFILE for index, _ in file.objects):
        return (
            f"{file.path} describes no CiA 402 drive: 1000:00 device type is 0, and it has no "
            "object of the drive profile (6000h to 9FFFh)"
        )
    if not kind or kind & 0xFFFF == CIA_402:
        return ""
    what = PROFILES.get(kind & 0xFFFF, "another device")
    return (
        f"{file.path} describes {what}, not a CiA 402 drive: 1000:00 device type is 0x{kind:08X}, "
        "but its low word should be 0192"
    )


def lacking(file: DeviceFile, mode: int, needed: Sequence[Entry]) -> Iterator[str]:
    """Yield why a drive as in the file cannot run in `mode`, which needs some objects.

    A file without controlword and statusword lists only some objects: what it leaves out
    means nothing.
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


def fixed_otherwise(file: DeviceFile, wanted: Sequence[Mapping]) -> Iterator[str]:
    """Yield each PDO whose mapping a drive as in the file cannot change, and is not a wanted one.

    `wanted` are mappings that would do, the best first.
    """
    for pdo, what, layouts in (
        (c.rpdo(1), "RPDO1", [one.rpdo for one in wanted]),
        (c.tpdo(1), "TPDO1", [one.tpdo for one in wanted]),
    ):
        words = _fixed(file, pdo)
        if words is None or any(_holds(each, words, pdo) for each in layouts):
            continue
        has = ", ".join(f"{word:08X}" for word in words) or "nothing"
        yield (
            f"{file.path} has a fixed mapping of {what} ({has} in {pdo.mapped_count.index:04X}h), "
            f"not the wanted one: {layouts[0].text()}"
        )


def _holds(layout: Layout, words: list[int], pdo: c.PdoEntries) -> bool:
    sent = pdo.cob_id.index >= 0x1800
    return layout.words == words or as_held(layout, words, sent=sent) is not None


def _fixed(file: DeviceFile, pdo: c.PdoEntries) -> list[int] | None:
    """Return mapping entries that the file says to be constant, None where it does not say so."""
    count = file.objects.get((pdo.mapped_count.index, 0))
    number = file.number(pdo.mapped_count)
    if count is None or count.writable or number is None or number > 8:
        return None
    words = [file.number(pdo.mapped(at)) for at in range(1, number + 1)]
    known = [word for word in words if word is not None]
    return known if len(known) == number else None


def unmappable(file: DeviceFile, wanted: Sequence[Entry]) -> Iterator[str]:
    """Yield each wanted object that no PDO carries, by the file's PDOMapping.

    A file in which no object has one does not use that field.
    """
    if not any(one.mappable for one in file.objects.values()):
        return
    for entry in wanted:
        described = file.objects.get((entry.index, entry.sub))
        if described is not None and described.mappable is False:
            yield (
                f"according to its EDS {entry.address} {entry.name} is in no PDO (PDOMapping=0): a "
                "run tries mapping: lean where that is without it, else it is refused"
            )


def unwatched(file: DeviceFile) -> str:
    """Return why a drive as in the file would go on when its master stops, '' where it may not."""

    def has(entry: Entry) -> bool:
        described = file.objects.get((entry.index, entry.sub))
        return described is not None and described.writable

    if (o.CONTROLWORD.index, 0) not in file.objects:
        return ""
    if not has(c.CONSUMER_HEARTBEAT) and not has(c.rpdo(1).timer):
        return "it has no watchdog (neither 1016:01 nor 1400:05 can be written)"
    reaction = file.objects.get((o.ABORT_CONNECTION.index, 0))
    if reaction is None:
        return "it does not say how it reacts to a lost master (no 6007:00)"
    fixed = None if reaction.writable else file.number(o.ABORT_CONNECTION)
    if fixed is not None and not acts_on_loss(fixed):
        return f"it has no reaction to a lost master (6007:00 is {fixed} and cannot be written)"
    producer = file.objects.get((c.PRODUCER_HEARTBEAT.index, 0))
    if producer is None or not (producer.writable or file.number(c.PRODUCER_HEARTBEAT)):
        return "it has no heartbeat (1017:00) by which its loss is noticed"
    return ""
