"""Objects that a drive has to hold before it is enabled: written, read back and reported."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

from tautwave.contracts import BusSpec
from tautwave.device_settings import DeviceSetting, Lasts, Settled
from tautwave.errors import BusTimeout, DeviceFault
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.network import AbortError, RemoteDrive
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.canopen.setup.meaning import wanted_torque
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.aborts import abort_text
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import Mode, mode_name, supported_text, supports
from tautwave_drivers.cia402.reactions import NEXT, acts_on_loss, is_standard, reaction_text

CIA_402 = 0x0192
KEPT_OPTIONS = (o.SHUTDOWN_OPTION, o.DISABLE_OPTION, o.HALT_OPTION, o.FAULT_OPTION)
"""Reactions that stay the drive's own: none of our stops rests on them, but 6007h may."""
_PRODUCER = 1 << 30
VERIFIED_MOST = 10


class Outcome(NamedTuple):
    """Result of a setting: the value in the drive now (None: no object), and a note."""

    value: int | None
    text: str


def settle(
    drive: RemoteDrive,
    entry: Entry,
    wanted: int,
    lasts: Lasts = Lasts.STORED,
    idle: int | None = None,
) -> Outcome:
    """Set an object to `wanted`; return its value afterwards, and why if it is another.

    A loan is given back when the bus is closed; `idle` where the drive holds it already, from a
    run that was killed.
    """
    what = f"{entry.address} {entry.name}"
    show = partial(_shown, entry)
    setting = DeviceSetting(entry, what, wanted, lasts, idle=idle, show=show)
    settled = drive.settings.settle(setting)
    if settled.after == wanted:
        drive.settings.hold(setting)
    return Outcome(settled.after, _text(drive, what, wanted, settled, show))


def _text(
    drive: RemoteDrive, what: str, wanted: int, found: Settled, show: Callable[[int], str]
) -> str:
    """Return what came of a setting as a sentence."""
    before, after, refusal = found
    if before is None or after is None:
        words = abort_text(refusal.code).split(";")[0] if isinstance(refusal, AbortError) else ""
        return f"{drive.name} has no {what} ({words})"
    text = f"{drive.name}: {what} "
    if refusal is not None:
        return f"{text}stays {show(before)}: {refusal}"
    if after != wanted:
        return f"{text}is {show(after)} after {show(wanted)} was written"
    if before == wanted:
        return f"{text}= {show(wanted)}, already set"
    return f"{text}= {show(wanted)} (was {show(before)}), read back"


def verify(drive: RemoteDrive) -> None:
    """Read once more what was set: the power may have been off meanwhile, with nothing heard of it.

    Raises
    ------
    DeviceFault
        The drive has forgotten.
    BusTimeout
        It does not respond, or not once to all that is read without a repeat.
    """
    for _ in range(VERIFIED_MOST):
        silences = drive.silences
        for setting, value in drive.settings.forgotten():
            raise DeviceFault(
                f"{drive.name}: {setting.name} reads {setting.show(value)} instead of "
                f"{setting.show(setting.wanted)}: it restarted while it was set up or enabled, and "
                "has forgotten what was set; check its supply, then run again"
            )
        if drive.silences == silences:  # else it may have restarted between two of them
            return
    raise BusTimeout(
        f"{drive.name} left a request without a response in each of {VERIFIED_MOST} tries to read "
        "its settings once more; check its supply, cable and termination"
    )


def store(drive: RemoteDrive) -> list[str]:
    """Store the lasting settings in the drive, and no loan.

    Raises
    ------
    DriverError
        A loan could not be set again afterwards.
    """
    if not drive.settings.changed:
        return [f"{drive.name}: nothing changed, nothing stored"]
    notes = [f"{drive.name}: to be stored (1010:01): {_changed(drive)}"]

    def save() -> None:
        try:
            drive.write(c.STORE_ALL, c.SAVE)
            notes.append(f"{drive.name}: settings stored (1010:01)")
        except AbortError as err:
            notes.append(f"{drive.name} does not store its settings: {err}")

    drive.settings.without_loans(save)
    return notes


def not_stored(drive: RemoteDrive) -> list[str]:
    """Return what was set that the drive forgets, and what stores it."""
    if not drive.settings.changed:
        return []
    return [
        f"{drive.name}: set until its power is off: {_changed(drive)}; to store them, switch it "
        "off and on, and run once with --configure"
    ]


def _changed(drive: RemoteDrive) -> str:
    return ", ".join(entry.address for entry in drive.settings.changed)


def _shown(entry: Entry, value: int) -> str:
    """Return a value as text."""
    if entry == c.CONSUMER_HEARTBEAT:
        return f"node {value >> 16} within {value & 0xFFFF} ms" if value else "none"
    unit = "" if entry.unit == "bits" else entry.unit.replace("rated/1000", "per mille")
    return f"{value} {unit}".strip()


def require(
    drive: RemoteDrive, entry: Entry, wanted: int, remedy: str, lasts: Lasts = Lasts.STORED
) -> Outcome:
    """As `settle`, but a drive that has the object has to hold what is wanted.

    Raises
    ------
    DeviceFault
        It holds something else.
    """
    outcome = settle(drive, entry, wanted, lasts)
    if outcome.value is not None and outcome.value != wanted:
        raise DeviceFault(f"{outcome.text}; {remedy}")
    return outcome


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
    identity = {name: drive.find(entry) for name, entry in entries.items()}
    wanted = axis.node.identity
    for name, entry in entries.items():
        value = None if wanted is None else getattr(wanted, name)
        if value is not None and identity[name] != value:
            shown = "nothing" if identity[name] is None else f"0x{identity[name]:X}"
            raise DeviceFault(
                f"{drive.name} is a different device: {entry.address} {entry.name} is {shown}, "
                f"but the rig expects 0x{value:X}; check the node id, or correct identity in the "
                "rig"
            )
    words = ", ".join(
        f"{name} 0x{value:X}" for name, value in identity.items() if value is not None
    )
    axis.identity = {name: f"0x{value:X}" for name, value in identity.items() if value is not None}
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
        outcomes = [
            require(drive, entry, value, remedy)
            for entry, value in zip(
                (o.INTERPOLATION_INDEX, o.INTERPOLATION_TIME), reversed(wanted), strict=True
            )
        ]
        notes = [each.text for each in outcomes]
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
    cob_id = drive.find(c.SYNC_COB_ID)
    if cob_id is not None and cob_id & (_PRODUCER | 0x7FF) != 0x80:
        notes.append(require(drive, c.SYNC_COB_ID, 0x80, "two masters would send SYNC").text)
    if drive.find(c.SYNC_COUNTER):
        remedy = "it would wait for a counter, which this master's SYNC does not have; set it to 0"
        notes.append(require(drive, c.SYNC_COUNTER, 0, remedy).text)
    time = drive.find(c.TIME_COB_ID)
    if time is not None and time & _PRODUCER:
        notes.append(settle(drive, c.TIME_COB_ID, time & ~_PRODUCER).text)
    return notes


def limit_torque(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Lower 6072h to the rig's effort_limit until the bus is closed."""
    if axis.servo or drive.find(o.MAX_TORQUE) is None:
        return []
    return [settle(drive, o.MAX_TORQUE, wanted_torque(axis), Lasts.LOAN).text]


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
    heartbeat = settle(drive, c.CONSUMER_HEARTBEAT, consumer, Lasts.LOAN, 0)
    deadline = settle(drive, c.rpdo(1).timer, options.heartbeat_timeout_ms, Lasts.LOAN, 0)
    reaction = settle(drive, o.ABORT_CONNECTION, options.abort_connection_option)
    quick = settle(drive, o.QUICK_STOP_OPTION, options.quick_stop_option)
    axis.machine = axis.new_machine(quick.value)
    notes = [each.text for each in (produced, heartbeat, deadline, reaction, quick)]
    held = {entry.index: drive.find(entry) for entry in KEPT_OPTIONS}
    held |= {
        o.ABORT_CONNECTION.index: reaction.value,
        o.QUICK_STOP_OPTION.index: quick.value,
    }
    for index, value in sorted(held.items()):
        if value is not None:
            notes.append(f"{drive.name}: {reaction_text(index, value)}")
    watches = heartbeat.value == consumer or bool(deadline.value)
    acts = reaction.value is not None and acts_on_loss(reaction.value)
    unknown = _unknown_reaction(reaction.value, held, options)
    acts = acts and not unknown
    if watches and acts and axis.watched:
        return notes
    lacking = []
    if not watches:
        lacking.append(f"{heartbeat.text}; {deadline.text}")
    if unknown:
        lacking.append(f"{reaction.text}, but {unknown} (abort_connection_option: 2 needs none)")
    elif not acts:
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


def _unknown_reaction(
    loss: int | None, held: Mapping[int, int | None], options: CanopenOptions
) -> str:
    """Return what is not known of how 6007h = `loss` ends the torque, '' if all is.

    A `quick_stop_option` of the manufacturer's counts as known where the rig states it.
    """
    index = NEXT.get(loss or 0, 0)
    value = held.get(index)
    if value is None or is_standard(index, value):
        return ""
    if index == o.QUICK_STOP_OPTION.index and value == options.quick_stop_option:
        return ""
    return reaction_text(index, value)


def free_emergencies(drive: RemoteDrive) -> list[str]:
    """Set the EMCY inhibit time (1015h) to 0: an EMCY it delays may be why the drive stops."""
    if not drive.find(c.EMCY_INHIBIT):
        return []
    outcome = settle(drive, c.EMCY_INHIBIT, 0, Lasts.LOAN)
    if not outcome.value:
        return [outcome.text]
    return [
        f"{outcome.text}; warning: its errors may be reported {outcome.value * 1e-4:g} s late, "
        "or not at all: set 1015:00 to 0 with its tool"
    ]
