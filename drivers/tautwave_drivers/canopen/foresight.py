"""What the options of a rig and the files of its drives tell before any wire."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tautwave.contracts import AxisFacts, AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.files.belonging import (
    KIND,
    Use,
    check_files,
    identity_of,
    two_identities,
)
from tautwave_drivers.canopen.files.foreseen import unmappable, unwatched
from tautwave_drivers.canopen.files.reading import DeviceFile, read_device_file
from tautwave_drivers.canopen.mapping import mappings_of
from tautwave_drivers.canopen.options import CanopenOptions, Node, nodes_of, scale
from tautwave_drivers.canopen.setup.meaning import ENTRIES, Row, verdicts
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import Mode

_STATES_NOTHING = (o.RATED_TORQUE, o.RATED_CURRENT)
"""Objects whose default of 0 is of a drive that knows no motor yet."""


def files_of(axes: Sequence[tuple[AxisSpec, Node]]) -> list[Use]:
    """Return the EDS and DCF files of a bus, and what the rig wants of their drives."""
    uses = []
    for axis, node in axes:
        if node.eds is None:
            continue
        identity = {} if node.identity is None else node.identity.model_dump()
        mode, needed = Mode.CST, [o.TARGET_TORQUE, o.POSITION]
        if axis.causality == "admittance":
            mode, needed = Mode.CSV, [o.TARGET_VELOCITY, o.POSITION, o.TORQUE]
        wanted = mappings_of(axis.causality, node)
        uses.append(
            Use(axis.name, node.id, node.eds, identity, node.dcf_include, mode, needed, wanted)
        )
    return uses


def facts(options: CanopenOptions, bus: BusSpec) -> Sequence[AxisFacts]:
    """Return the steps of each axis' sensors and commands [SI].

    Raises
    ------
    ConfigError
        The EDS or DCF of a node cannot be read, its values are not for that node, or a run would
        refuse the drive that it describes.
    """
    nodes = nodes_of(options, bus)
    check_files(files_of(list(zip(bus.axes, nodes, strict=True))))
    problems = []
    for axis, node, file in _files(options, bus):
        for one, sentence in _meaning(file, axis, node, bus.rate_hz, options):
            if _set_by(file, one):
                problems.append(
                    f"{axis.name}: {file.path} sets what a run refuses: {sentence}; correct it "
                    "there as well"
                )
    if problems:
        raise ConfigError(problems)
    return [
        AxisFacts(one.encoder_quantum, one.effort_quantum, one.velocity_quantum)
        if axis.causality == "admittance"
        else AxisFacts(one.encoder_quantum, one.effort_quantum, 0.0)
        for axis, one in (
            (axis, scale(node, axis)) for axis, node in zip(bus.axes, nodes, strict=True)
        )
    ]


def foreseen(options: CanopenOptions, bus: BusSpec) -> Sequence[str]:
    """Return what a run would say or refuse of drives as their files have them, by axis."""
    sentences: dict[str, list[str]] = {}
    for axis, node, file in _files(options, bus):
        for sentence in of_file(file, axis, node, options, bus.rate_hz):
            sentences.setdefault(sentence, []).append(axis.name)
    return [f"{', '.join(names)}: {sentence}" for sentence, names in sentences.items()]


def of_file(
    file: DeviceFile, axis: AxisSpec, node: Node, options: CanopenOptions, rate_hz: float
) -> Iterator[str]:
    """Yield what a run would say or refuse of a drive as in its file."""
    if reason := unwatched(file):
        yield f"according to its EDS {reason}; a run needs --allow-unwatched"
    for wanted in mappings_of(axis.causality, node)[:1]:
        yield from unmappable(file, (*wanted.rpdo.entries, *wanted.tpdo.entries))
    yield from two_identities(file)
    yield from file.unreadable((*KIND, *ENTRIES))
    for one, sentence in _meaning(file, axis, node, rate_hz, options):
        if not _set_by(file, one):
            yield (f"a run refuses the drive while it holds the default of its EDS: {sentence}")


def _files(options: CanopenOptions, bus: BusSpec) -> Iterator[tuple[AxisSpec, Node, DeviceFile]]:
    for axis, node in zip(bus.axes, nodes_of(options, bus), strict=True):
        if node.eds is not None:
            yield axis, node, read_device_file(node.eds)


def _meaning(
    file: DeviceFile, spec: AxisSpec, node: Node, rate_hz: float, options: CanopenOptions
) -> Iterator[tuple[Row, str]]:
    """Yield rows of the table that refuse the values of a file, each with its sentence."""
    axis = Axis(spec, node, options, rate_hz)
    axis.identity = {name: f"0x{value:X}" for name, value in identity_of(file).items()}
    read = {entry: _number(file, entry, node.id) for entry in ENTRIES}
    for row, verdict in verdicts(read, axis):
        if verdict.refusal:
            yield row, verdict.refusal


def _number(file: DeviceFile, entry: Entry, node_id: int) -> int | None:
    value = file.number(entry, node_id)
    stated = value != 0 or entry not in _STATES_NOTHING or _has_value(file, entry)
    return value if stated else None


def _set_by(file: DeviceFile, row: Row) -> bool:
    """Return whether the file holds a parameter value of one of the objects."""
    return any(_has_value(file, entry) for entry in row.entries)


def _has_value(file: DeviceFile, entry: Entry) -> bool:
    one = file.objects.get((entry.index, entry.sub))
    return one is not None and one.value is not None and bool(one.value.text)
