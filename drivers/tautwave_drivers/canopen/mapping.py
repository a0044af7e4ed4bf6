"""Contents of a PDO as data, and its bytes by one precompiled `struct`.

Source: CiA 301 v4.2, 7.2.2 and 7.5.2.36: objects follow each other without gaps, little endian.
"""

from __future__ import annotations

import operator
import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import FORMATS, Entry

if TYPE_CHECKING:
    from tautwave_drivers.canopen.options import Node, SensorInput

_KINDS = {8: "U8", 16: "U16", 32: "U32", 64: "U64"}
"""Types by their length in a mapping entry."""
LAST_FILLER = 0x1F

RPDO_1, RPDO_2, TPDO_1 = 0x200, 0x300, 0x180
"""COB-IDs of the PDOs in use without the node id (CiA 301, pre-defined connection set)."""


class Layout(NamedTuple):
    """The objects in one PDO, in order; `held` is how a drive has them, if that is another way.

    `held` are pairs of an entry and a type: the entries in the drive's order, None for objects of
    its own between them.
    """

    entries: tuple[Entry, ...]
    held: tuple[tuple[Entry | None, str], ...] = ()

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return self._codec.size

    @property
    def words(self) -> list[int]:
        """Mapping entries of the objects in their own order."""
        return [entry.mapping for entry in self.entries]

    @property
    def _codec(self) -> struct.Struct:
        types = [kind for _, kind in self.held] or [entry.type for entry in self.entries]
        return struct.Struct("<" + "".join(FORMATS[kind][1:] for kind in types))

    @property
    def pack(self) -> Callable[..., bytes]:
        """Packs the values of all objects; what else the drive has there is 0."""
        pack = self._codec.pack
        if not self.held:
            return pack
        places = [len(self.entries) if one is None else self.at(one) for one, _ in self.held]
        return lambda *values: pack(*map((*values, 0).__getitem__, places))

    @property
    def unpack(self) -> Callable[[bytes], tuple[int, ...]]:
        """Unpacks the values of all objects."""
        unpack = self._codec.unpack_from
        if not self.held:
            return unpack
        order = [one for one, _ in self.held]
        take = operator.itemgetter(*map(order.index, self.entries))
        return lambda data: take(unpack(data))

    def at(self, wanted: Entry) -> int:
        """Return the place of an object, -1 where it is not mapped."""
        return self.entries.index(wanted) if wanted in self.entries else -1

    def text(self) -> str:
        """Return the objects as text."""
        return ", ".join(f"{entry.index:04X} {entry.name}" for entry in self.entries)


def as_held(layout: Layout, words: Sequence[int], *, sent: bool) -> Layout | None:
    """Return a layout by the drive's own mapping, None where that does not have all of it.

    A PDO that the drive sends may have more; one that it receives may have fillers only (CiA 301,
    7.4.7): whatever else we would write 0 into.
    """
    known = {entry.mapping: entry for entry in layout.entries}
    held = [(known.get(word), _KINDS.get(word & 0xFF, "")) for word in words]
    held = [(one, one.type if one else kind) for one, kind in held]
    ours = [one for one, _ in held if one is not None]
    others = [word for word in words if word not in known]
    if len(ours) != len(layout.entries) or set(ours) != set(layout.entries):
        return None
    if not all(kind for _, kind in held):
        return None
    if not sent and any(word >> 16 > LAST_FILLER for word in others):
        return None
    return Layout(layout.entries, tuple(held))


class Mapping(NamedTuple):
    """Cyclic PDOs of one drive: received and sent."""

    rpdo: Layout
    tpdo: Layout


_MAPPINGS = {
    ("impedance", "lean"): Mapping(
        Layout((o.CONTROLWORD, o.TARGET_TORQUE)), Layout((o.STATUSWORD, o.POSITION))
    ),
    ("impedance", "full"): Mapping(
        Layout((o.CONTROLWORD, o.TARGET_TORQUE, o.MODE)),
        Layout((o.STATUSWORD, o.POSITION, o.MODE_DISPLAY)),
    ),
    # An admittance axis needs its measured effort, so both have 6077h.
    ("admittance", "lean"): Mapping(
        Layout((o.CONTROLWORD, o.TARGET_VELOCITY)), Layout((o.STATUSWORD, o.POSITION, o.TORQUE))
    ),
    ("admittance", "full"): Mapping(
        Layout((o.CONTROLWORD, o.TARGET_VELOCITY, o.MODE)),
        Layout((o.STATUSWORD, o.POSITION, o.TORQUE)),
    ),
}


def sensor_entry(sensor: SensorInput) -> Entry:
    """Return the object of an effort sensor."""
    return Entry(
        "effort sensor", sensor.index, sensor.subindex, "I16", "counts", "measured", "CiA 401"
    )


def mappings_of(causality: str, node: Node) -> list[Mapping]:
    """Return the mapping of a node, then the lean one where its drive may have that instead."""
    first = mapping_of(causality, node)
    if node.mapping == "lean" or node.homing or node.move:  # these change the mode
        return [first]
    return [first, mapping_of(causality, node.model_copy(update={"mapping": "lean"}))]


def mapping_of(causality: str, node: Node) -> Mapping:
    """Return the cyclic PDOs for a causality, the node's `mapping` and what it is to report."""
    rpdo, tpdo = _MAPPINGS[causality, node.mapping]
    if causality == "impedance" and node.report_torque:
        tpdo = Layout((*tpdo.entries, o.TORQUE))
    if node.effort_sensor is not None:
        tpdo = Layout((*tpdo.entries, sensor_entry(node.effort_sensor)))
    return Mapping(rpdo, tpdo)
