"""Contents of a PDO as data, and its bytes by one precompiled `struct`.

Source: CiA 301 v4.2, 7.2.2 and 7.5.2.36: objects follow each other without gaps, little endian.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import FORMATS, Entry

if TYPE_CHECKING:
    from tautwave_drivers.canopen.options import Node, SensorInput

RPDO_1, RPDO_2, TPDO_1 = 0x200, 0x300, 0x180
"""COB-IDs of the PDOs in use without the node id (CiA 301, pre-defined connection set)."""


class Layout(NamedTuple):
    """The objects in one PDO, in order."""

    entries: tuple[Entry, ...]

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return sum(entry.bits for entry in self.entries) // 8

    @property
    def codec(self) -> struct.Struct:
        """Packs and unpacks all objects at once."""
        return struct.Struct("<" + "".join(FORMATS[entry.type][1:] for entry in self.entries))

    def at(self, wanted: Entry) -> int:
        """Return the place of an object, -1 where it is not mapped."""
        return self.entries.index(wanted) if wanted in self.entries else -1

    def text(self) -> str:
        """Return the objects as text."""
        return ", ".join(f"{entry.index:04X} {entry.name}" for entry in self.entries)


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


def mapping_of(causality: str, node: Node) -> Mapping:
    """Return the cyclic PDOs for a causality, the node's `mapping` and what it is to report."""
    rpdo, tpdo = _MAPPINGS[causality, node.mapping]
    if causality == "impedance" and node.report_torque:
        tpdo = Layout((*tpdo.entries, o.TORQUE))
    if node.effort_sensor is not None:
        tpdo = Layout((*tpdo.entries, sensor_entry(node.effort_sensor)))
    return Mapping(rpdo, tpdo)
