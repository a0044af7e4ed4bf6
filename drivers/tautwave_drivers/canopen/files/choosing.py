"""Which parameter values of a DCF are written into a drive: those that tune it.

A DCF is a dump of all objects. Some of them set the node on the bus, trigger something when they
are written, or move or release the motor; those are left out unless the rig names them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from typing import NamedTuple

from tautwave_drivers.canopen.files.reading import FileObject, Setting

COMMUNICATION = range(0x1000, 0x2000)
LEFT_OUT = (
    (COMMUNICATION, "communication, store and restore"),
    (range(0x2000, 0x2006), "node id and bit rate on many drives"),
    (range(0x2009, 0x200A), "node id and bit rate on many drives"),
    (range(0x6042, 0x6043), "a target"),
    (range(0x60C1, 0x60C2), "a target"),
    (range(0x60FE, 0x60FF), "digital outputs and brake"),
    (range(0x6200, 0x6400), "digital outputs"),
    (range(0x6411, 0x6412), "analogue outputs"),
)
"""Areas that are left out, and what they do."""

COMMANDS = frozenset(
    (0x6040, 0x6060, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF)
)  # fmt: skip
"""Commands and targets: never written from a file, which must not move a motor."""

_NAMES = re.compile(
    r"node.?(id|num|addr)|(can|bus|device|slave).?(id\b|addr)|baud|bit.?rate|\blss\b"
    r"|\b(re)?stor(e|ing)|\bsave|\bload\b|factory|default|reset|reboot|boot|password|firmware"
    r"|control.?word|command|target|mode.{0,4}operation|operation.?mode|\benable|\bstart\b"
    r"|brake|digital.{0,3}out|analog(ue)?.{0,3}out|output",
    re.IGNORECASE,
)
"""Names of a manufacturer's objects that do so too."""
_AXIS = 0x800
_PROFILE, _MANUFACTURER = range(0x6000, 0xA000), range(0x2000, 0x6000)


def why_left_out(one: FileObject) -> str:
    """Return why an object is left out, '' where it is written."""
    index = one.index
    # The drive profile of each axis of a drive with several; outputs of CiA 401 lie where they lie.
    of_axis = 0x6000 + (index - 0x6000) % _AXIS if index in _PROFILE else index
    if of_axis in COMMANDS:
        return "commands and targets"
    for area, why in LEFT_OUT:
        if index in area or (of_axis in area and area[0] < 0x6200):
            return why
    match = _NAMES.search(one.name) if index in _MANUFACTURER else None
    return "" if match is None else f"named {match[0].lower()!r}"


class Choice(NamedTuple):
    """Values to be written, and a sentence about those that are left out."""

    written: list[Setting]
    note: str


def choose(settings: Iterable[Setting], named: Collection[str]) -> Choice:
    """Return what of a DCF is written; `named` are addresses (`2003`, `2003:01`) of the rig."""
    written: list[Setting] = []
    quiet = 0
    listed: list[str] = []
    for setting in settings:
        one = setting.object
        why = why_left_out(one)
        if not why or is_named(one, named):
            written.append(setting)
        elif one.index in COMMUNICATION:
            quiet += 1
        else:
            listed.append(f"{one.address} {one.name} ({why})")
    if quiet:
        listed.append(f"{quiet} objects of communication (1000h to 1FFFh)")
    if not listed:
        return Choice(written, "")
    return Choice(written, f"left out, unless dcf_include names them: {', '.join(listed)}")


def is_named(one: FileObject, named: Collection[str]) -> bool:
    """Return whether the rig names an object, or all of its sub-indices."""
    return any(each.upper() in (one.address, one.address[:4]) for each in named)
