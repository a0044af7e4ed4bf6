"""Whose drive a DCF is: its values belong to one node, and to one kind of device."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tautwave.errors import ConfigError
from tautwave_drivers.canopen.files.choosing import COMMANDS, is_named
from tautwave_drivers.canopen.files.foreseen import fixed_otherwise, lacking, no_drive
from tautwave_drivers.canopen.files.reading import DeviceFile, Setting, read_device_file
from tautwave_drivers.canopen.files.values import integer
from tautwave_drivers.canopen.mapping import Mapping as PdoMapping
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry

IDENTITY = {
    "vendor": (c.VENDOR_ID, "vendornumber"),
    "product": (c.PRODUCT_CODE, "productnumber"),
    "revision": (c.REVISION, "revisionnumber"),
}
"""What a file says of its device: an object, and the field of [DeviceInfo] where that is empty."""
KIND = (c.DEVICE_TYPE, o.SUPPORTED_MODES, *(entry for entry, _ in IDENTITY.values()))
"""What a file says of the kind of drive."""


def identity_of(file: DeviceFile) -> dict[str, int]:
    """Return vendor, product and revision as far as the file states them; 0 states nothing."""
    stated = {
        name: file.number(entry) or integer(file.info.get(key))
        for name, (entry, key) in IDENTITY.items()
    }
    return {name: value for name, value in stated.items() if value}


def two_identities(file: DeviceFile) -> Iterator[str]:
    """Yield where 1018h and [DeviceInfo] differ, both as manuals and as tools write numbers."""
    for name, (entry, key) in IDENTITY.items():
        held, written = file.number(entry), integer(file.info.get(key))
        if held and written and held != written:
            yield (
                f"{file.path}: {entry.address} {name} is 0x{held:X} ({held}), but [DeviceInfo] has "
                f"0x{written:X} ({written}): 1018h counts; compare with `tautwave scan canopen`"
            )


def of_another(file: DeviceFile, drive: Mapping[str, int | None], whose: str) -> str:
    """Return why the values of a DCF are not for this drive, '' if nothing says so."""
    if not has_values(file):
        return ""
    for name, value in identity_of(file).items():
        wanted = drive.get(name)
        if wanted and wanted != value:
            return (
                f"{file.path} is for {name} 0x{value:X}, but {whose} 0x{wanted:X}; export a DCF "
                f"from this drive, or remove the {name} from the file if its values suit both"
            )
    return ""


def has_values(file: DeviceFile) -> bool:
    """Return whether it has parameter values: whether it is a DCF."""
    return any(one.value is not None and one.value.text for one in file.objects.values())


def parameters(file: DeviceFile, node_id: int) -> list[Setting]:
    """Return the parameter values of a DCF.

    Raises
    ------
    ConfigError
        One cannot be read, or does not fit its type.
    """
    settings = list(file.settings(node_id))
    problems = [one for one in settings if isinstance(one, str)]
    if problems:
        raise ConfigError(problems)
    return [one for one in settings if not isinstance(one, str)]


class Use(NamedTuple):
    """A file in a rig: the axis and its node, the path, and what the rig wants of the drive.

    That is its identity, objects of the DCF to include, its mode, the objects of that, and the
    mappings that would do.
    """

    axis: str
    node: int
    path: str
    identity: Mapping[str, int | None]
    include: Sequence[str]
    mode: int
    needed: Sequence[Entry]
    mappings: Sequence[PdoMapping]


def check_files(uses: Sequence[Use]) -> None:
    """Check the EDS and DCF files of a bus.

    Raises
    ------
    ConfigError
        A file cannot be read, is another drive's, or has a value that its object cannot take.
    """
    problems = list(_problems(uses))
    if problems:
        raise ConfigError(problems)


def why_refused(
    file: DeviceFile, mode: int, needed: Sequence[Entry], mappings: Sequence[PdoMapping]
) -> list[str]:
    """Return why a run would refuse any drive as in the file."""
    if one := no_drive(file):
        return [one]
    return [*lacking(file, mode, needed), *fixed_otherwise(file, mappings)]


def _problems(uses: Sequence[Use]) -> Iterator[str]:
    sharing: defaultdict[Path, list[int]] = defaultdict(list)
    for use in uses:
        sharing[Path(use.path).resolve()].append(use.node)
    for name, node, path, identity, include, mode, needed, mappings in uses:
        try:
            file = read_device_file(path)
            settings = parameters(file, node)
        except ConfigError as err:
            yield from (f"{name}: {text}" for text in err.problems)
            continue
        reasons = why_refused(file, mode, needed, mappings)
        yield from (f"{name}: {reason}; name this drive's own file" for reason in reasons)
        both = sharing[Path(path).resolve()]
        stated = file.node_id if has_values(file) else None
        if stated is not None and len(both) > 1:
            if node == both[0]:
                listed = " and ".join(str(number) for number in both)
                yield (
                    f"{name}: {path} is given to nodes {listed}, but belongs to node {stated} "
                    "(its NodeID); give each node its own file, or remove NodeID from it if "
                    "its values suit all of them"
                )
        elif stated is not None and stated != node:
            yield (
                f"{name}: {path} is the DCF of node {stated} (NodeID in it), but the rig gives "
                f"it to node {node}; export one from that drive, or correct the rig"
            )
        for address in include:
            taken = [one.object for one in settings if is_named(one.object, (address,))]
            if not taken:
                yield (
                    f"{name}: dcf_include names {address}, but {path} has no value for it that can "
                    "be written; remove it"
                )
            elif taken[0].index in COMMANDS:
                yield (
                    f"{name}: dcf_include names {address}, a command or target; a file must not "
                    "move a motor: remove it"
                )
        problem = of_another(file, identity, "the rig expects")
        if problem:
            yield f"{name}: {problem}, or correct identity in the rig"
