"""Objects that a drive has to hold before it is enabled: written, read back and reported."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.contracts import BusSpec
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.bus.network import AbortError, RemoteDrive
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.canopen.setup.meaning import wanted_torque
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.aborts import abort_text
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import Mode, mode_name, supported_text, supports
from tautwave_drivers.cia402.reactions import acts_on_loss, reaction_text

CIA_402 = 0x0192
_PRODUCER = 1 << 30


class Outcome(NamedTuple):
    """Result of a setting: the value in the drive now and before (None: no object), and a note."""

    value: int | None
    text: str
    before: int | None = None


def settle(drive: RemoteDrive, entry: Entry, wanted: int, *, lasting: bool = True) -> Outcome:
    """Set an object to `wanted`; return its value afterwards, and why if it is another.

    A `lasting` change is one that `--configure` stores.
    """
    try:
        before = drive.number(entry)
    except AbortError as err:
        words = abort_text(err.code).split(";")[0]
        return Outcome(None, f"{drive.name} has no {entry.address} {entry.name} ({words})")
    what = f"{drive.name}: {entry.address} {entry.name}"
    if before == wanted:
        return Outcome(wanted, f"{what} = {_shown(entry, wanted)}, already set", before)
    try:
        drive.write(entry, wanted)
    except AbortError as err:
        return Outcome(before, f"{what} stays {_shown(entry, before)}: {err}", before)
    after = drive.number(entry)
    if lasting and after != before:
        drive.changed.append(entry.address)
    if after != wanted:
        reported = f"{_shown(entry, after)} after {_shown(entry, wanted)} was written"
        return Outcome(after, f"{what} is {reported}", before)
    reported = f"{_shown(entry, wanted)} (was {_shown(entry, before)})"
    return Outcome(wanted, f"{what} = {reported}, read back", before)


def borrow(
    drive: RemoteDrive, axis: Axis, entry: Entry, wanted: int, idle: int | None = None
) -> Outcome:
    """As `settle`, for as long as the bus is open: `give_back` sets what was found.

    `idle` is given back where the drive holds `wanted` already, from a run that was killed.
    """
    found = settle(drive, entry, wanted, lasting=False)
    before = idle if found.before == wanted and idle is not None else found.before
    if before is not None and before != wanted:
        axis.borrowed.setdefault(entry, before)
    return found


def give_back(drive: RemoteDrive, axis: Axis) -> None:
    """Set what was borrowed to what was found, as far as the drive responds."""
    for entry, value in axis.borrowed.items():
        try:
            settle(drive, entry, value, lasting=False)
        except DriverError:
            return


def store(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Store the lasting settings in the drive, and nothing that is borrowed.

    Raises
    ------
    DriverError
        Something borrowed could not be set again afterwards.
    """
    if not drive.changed:
        return [f"{drive.name}: nothing changed, nothing stored"]
    held = {entry: drive.number(entry) for entry in axis.borrowed}
    give_back(drive, axis)
    try:
        drive.write(c.STORE_ALL, c.SAVE)
        text = f": settings stored (1010:01): {', '.join(drive.changed)}"
    except AbortError as err:
        text = f" does not store its settings: {err}"
    for entry, value in held.items():
        require(drive, entry, value, "it was set before its settings were stored", lasting=False)
    return [f"{drive.name}{text}"]


def _shown(entry: Entry, value: int) -> str:
    """Return a value as text."""
    if entry == c.CONSUMER_HEARTBEAT:
        return f"node {value >> 16} within {value & 0xFFFF} ms" if value else "none"
    unit = "" if entry.unit == "bits" else entry.unit.replace("rated/1000", "per mille")
    return f"{value} {unit}".strip()


def require(
    drive: RemoteDrive, entry: Entry, wanted: int, remedy: str, *, lasting: bool = True
) -> Outcome:
    """As `settle`, but a drive that has the object has to hold what is wanted.

    Raises
    ------
    DeviceFault
        It holds something else.
    """
    found = settle(drive, entry, wanted, lasting=lasting)
    if found.value is not None and found.value != wanted:
        raise DeviceFault(f"{found.text}; {remedy}")
    return found


def check_identity(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Compare 1000h, 1018h and 6502h with the rig; return what the drive is.

    Raises
    ------
    DeviceFault
        It is another device, not a drive, or lacks the mode that the axis needs.
    """
    kind = drive.number(c.DEVICE_TYPE)
    if kind & 0xFFFF != CIA_402:
        raise DeviceFault(
            f"{drive.name} is not a CiA 402 drive: 1000:00 device type is 0x{kind:08X}, but its "
            "low word should be 0192; check the node id"
        )
    entries = {
        "vendor": c.VENDOR_ID,
        "product": c.PRODUCT_CODE,
        "revision": c.REVISION,
        "serial": c.SERIAL_NUMBER,
    }
    found = {name: drive.find(entry) for name, entry in entries.items()}
    wanted = axis.node.identity
    for name, entry in entries.items():
        value = None if wanted is None else getattr(wanted, name)
        if value is not None and found[name] != value:
            shown = "nothing" if found[name] is None else f"0x{found[name]:X}"
            raise DeviceFault(
                f"{drive.name} is a different device: {entry.address} {entry.name} is {shown}, "
                f"but the rig expects 0x{value:X}; check the node id, or correct identity in the "
                "rig"
            )
    words = ", ".join(f"{name} 0x{value:X}" for name, value in found.items() if value is not None)
    axis.identity = {name: f"0x{value:X}" for name, value in found.items() if value is not None}
    software = drive.find_text(c.SOFTWARE_VERSION)
    if software is not None:
        axis.identity["software"] = software
    checked = "not checked: the rig gives no identity" if wanted is None else "as the rig says"
    notes = [f"{drive.name}: {words or 'no 1018h'} ({checked})"]
    modes = drive.find(o.SUPPORTED_MODES)
    needed = [(axis.mode, f"an {axis.spec.causality} axis")]
    if axis.node.homing is not None:
        needed.append((Mode.HM, "homing"))
    if axis.node.move is not None:
        needed.append((Mode.CSP if axis.node.move.mode == "csp" else Mode.PV, "move"))
    if modes is None:
        return [*notes, f"{drive.name} has no 6502:00, so its modes are checked when it is enabled"]
    for mode, what in needed:
        if not supports(modes, mode):
            raise DeviceFault(
                f"{drive.name} does not support {mode_name(mode)}, which {what} needs; 6502:00 "
                f"(0x{modes:X}) lists: {supported_text(modes)}"
            )
    return [*notes, f"{drive.name}: modes {supported_text(modes)}"]


def set_period(drive: RemoteDrive, bus: BusSpec) -> list[str]:
    """Set the interpolation period 60C2h, and 1006h where it is in use, to the rig's period.

    Raises
    ------
    DeviceFault
        The drive keeps another period, or its 60C2h cannot hold this one.
    """
    wanted = o.interpolation_period(bus.period_ns)
    if bus.period_ns % 1_000_000 == 0 and bus.period_ns <= 255_000_000:
        wanted = bus.period_ns // 1_000_000, -3  # some drives support no unit but ms
    if wanted is None:
        if drive.find(o.INTERPOLATION_TIME) is None:
            return [f"{drive.name} has no 60C2:01, so its interpolation period cannot be set"]
        raise DeviceFault(
            f"{drive.name}: {bus.period_ns / 1e3:g} us cannot be represented in 60C2h (1 to 255 "
            "times a power of ten); choose another rate_hz, such as 1000, 500 or 250"
        )
    held = drive.find(o.INTERPOLATION_TIME), drive.find(o.INTERPOLATION_INDEX)
    if None not in held and held[0] * 10.0 ** held[1] * 1e9 == bus.period_ns:  # type: ignore[operator]
        notes = [f"{drive.name}: 60C2 = {held[0]} x 10**{held[1]} s, already set"]
    else:
        remedy = "the drive must interpolate at the period of SYNC: use a rate_hz that it supports"
        found = [
            require(drive, entry, value, remedy)
            for entry, value in zip(
                (o.INTERPOLATION_INDEX, o.INTERPOLATION_TIME), reversed(wanted), strict=True
            )
        ]
        notes = [each.text for each in found]
    period = drive.find(c.SYNC_PERIOD)
    if period:
        notes.append(settle(drive, c.SYNC_PERIOD, bus.period_ns // 1000).text)
    return notes


def check_sync(drive: RemoteDrive) -> list[str]:
    """Make sure that SYNC is 80h without a counter, and that this drive sends neither it nor TIME.

    Raises
    ------
    DeviceFault
        The drive keeps something else.
    """
    notes = []
    found = drive.find(c.SYNC_COB_ID)
    if found is not None and found & (_PRODUCER | 0x7FF) != 0x80:
        notes.append(require(drive, c.SYNC_COB_ID, 0x80, "two masters would send SYNC").text)
    if drive.find(c.SYNC_COUNTER):
        remedy = "it would wait for a counter that this master's SYNC has not; set it to 0"
        notes.append(require(drive, c.SYNC_COUNTER, 0, remedy).text)
    time = drive.find(c.TIME_COB_ID)
    if time is not None and time & _PRODUCER:
        notes.append(settle(drive, c.TIME_COB_ID, time & ~_PRODUCER).text)
    return notes


def limit_torque(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Lower 6072h to the rig's effort_limit until the bus is closed."""
    if axis.servo or drive.find(o.MAX_TORQUE) is None:
        return []
    return [borrow(drive, axis, o.MAX_TORQUE, wanted_torque(axis)).text]


def set_watchdogs(
    drive: RemoteDrive, axis: Axis, options: CanopenOptions, *, allow_unwatched: bool
) -> list[str]:
    """Make the drive watch this master, and stop on its own when the master stops sending.

    `axis.unwatched` says what it does where it will not.

    Raises
    ------
    DeviceFault
        The drive would keep moving; `--allow-unwatched` accepts that.
    """
    produced = settle(drive, c.PRODUCER_HEARTBEAT, options.heartbeat_ms)
    axis.watched = bool(produced.value)
    consumer = options.master_id << 16 | options.heartbeat_timeout_ms
    heartbeat = borrow(drive, axis, c.CONSUMER_HEARTBEAT, consumer, idle=0)
    deadline = borrow(drive, axis, c.rpdo(1).timer, options.heartbeat_timeout_ms, idle=0)
    reaction = settle(drive, o.ABORT_CONNECTION, options.abort_connection_option)
    quick = settle(drive, o.QUICK_STOP_OPTION, options.quick_stop_option)
    axis.machine = axis.new_machine(quick.value)
    notes = [each.text for each in (produced, heartbeat, deadline, reaction, quick)]
    for entry, found in ((o.ABORT_CONNECTION, reaction), (o.QUICK_STOP_OPTION, quick)):
        if found.value is not None:
            notes.append(f"{drive.name}: {reaction_text(entry.index, found.value)}")
    watches = heartbeat.value == consumer or bool(deadline.value)
    acts = reaction.value is not None and acts_on_loss(reaction.value)
    if watches and acts and axis.watched:
        return notes
    lacking = []
    if not watches:
        lacking.append(f"{heartbeat.text}; {deadline.text}")
    if not acts:
        lacking.append(reaction.text)
    if not axis.watched:
        lacking.append(produced.text)
    text = "; ".join(lacking)
    if not allow_unwatched:
        raise DeviceFault(
            f"{drive.name} would keep following its last command if this program stops sending: "
            f"{text}; use a drive or firmware with a watchdog, or --allow-unwatched with a hand "
            "on the emergency stop"
        )
    if not (watches and acts):
        axis.unwatched = f"(node {axis.node.id}) keeps following its last command: {text}"
    return notes
