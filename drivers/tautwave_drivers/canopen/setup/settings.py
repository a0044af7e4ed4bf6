"""Objects that a drive has to hold before it is enabled: written, read back and reported."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.contracts import BusSpec
from tautwave.errors import DeviceFault
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.bus.network import AbortError, RemoteDrive
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.aborts import abort_text
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import Mode, mode_name, supported_text, supports
from tautwave_drivers.cia402.reactions import acts_on_loss, reaction_text
from tautwave_drivers.cia402.si_units import is_length, unit_text, velocity_unit
from tautwave_drivers.cia402.units import MICRO, MILLI

CIA_402 = 0x0192
_SYNC_PRODUCER = 1 << 30


class Outcome(NamedTuple):
    """Result of a setting: the value in the drive now (None: no such object), and a note."""

    value: int | None
    text: str


def settle(drive: RemoteDrive, entry: Entry, wanted: int) -> Outcome:
    """Set an object to `wanted`; return its value afterwards, and why if it is another."""
    try:
        before = drive.number(entry)
    except AbortError as err:
        words = abort_text(err.code).split(";")[0]
        return Outcome(None, f"{drive.name} has no {entry.address} {entry.name} ({words})")
    what = f"{drive.name}: {entry.address} {entry.name}"
    if before == wanted:
        return Outcome(wanted, f"{what} = {_shown(entry, wanted)}, already set")
    try:
        drive.write(entry, wanted)
    except AbortError as err:
        return Outcome(before, f"{what} stays {_shown(entry, before)}: {err}")
    after = drive.number(entry)
    if after != wanted:
        reported = f"{_shown(entry, after)} after {_shown(entry, wanted)} was written"
        return Outcome(after, f"{what} is {reported}")
    reported = f"{_shown(entry, wanted)} (was {_shown(entry, before)})"
    return Outcome(wanted, f"{what} = {reported}, read back")


def _shown(entry: Entry, value: int) -> str:
    """Return a value as text."""
    if entry == c.CONSUMER_HEARTBEAT:
        return f"node {value >> 16} within {value & 0xFFFF} ms" if value else "none"
    unit = "" if entry.unit == "bits" else entry.unit.replace("rated/1000", "per mille")
    return f"{value} {unit}".strip()


def require(drive: RemoteDrive, entry: Entry, wanted: int, remedy: str) -> Outcome:
    """As `settle`, but a drive that has the object has to hold what is wanted.

    Raises
    ------
    DeviceFault
        It holds something else.
    """
    found = settle(drive, entry, wanted)
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


def check_scale(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Compare rated torque and encoder with the rig, as far as the drive reports them.

    Raises
    ------
    DeviceFault
        Torque or position would be scaled wrongly.
    """
    notes = []
    rated = drive.find(o.RATED_TORQUE)
    said = axis.node.rated_torque
    if rated is None:
        notes.append(f"{drive.name} has no 6076:00: rated torque {said:g} N m is not checked")
    elif not any(
        math.isclose(rated * unit, said, rel_tol=0.0, abs_tol=_step(unit, said))
        for unit in (MILLI, MICRO)
    ):
        raise DeviceFault(
            f"{drive.name}: rated torque 6076:00 is {rated} (mN m, or uN m on some drives), but "
            f"the rig states {said:g} N m; correct rated_torque, which scales every torque"
        )
    else:
        notes.append(f"{drive.name}: 6076:00 rated torque {rated} is {said:g} N m, as in the rig")
    offset = drive.find(o.HOME_OFFSET)
    if offset is not None:  # after the DCF, which may have written it
        axis.identity["home_offset"] = str(offset)
    increments, turns = drive.find(o.ENCODER_INCREMENTS), drive.find(o.ENCODER_REVOLUTIONS)
    if increments and turns:
        counts = axis.node.counts_per_revolution
        if increments != counts * turns:
            raise DeviceFault(
                f"{drive.name}: 608F says {increments} increments in {turns} motor turns, but the "
                f"rig states {counts} per turn; correct counts_per_revolution"
            )
        notes.append(f"{drive.name}: 608F has {counts} counts per motor turn, as in the rig")
    return [*notes, *_factor_group(drive, axis), *_velocity_unit(drive, axis)]


def _factor_group(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Compare a drive's position units per motor turn (6091h, 6092h) with the rig's counts.

    Drives that always count increments leave a feed of 1 here. Whole numbers hold the product of
    counts and gear only to some 1e-5.
    """
    gear, shaft = drive.find(o.GEAR_MOTOR), drive.find(o.GEAR_SHAFT)
    feed, turns = drive.find(o.FEED), drive.find(o.FEED_REVOLUTIONS)
    if not (gear and shaft and feed and turns) or feed == 1:
        return []
    counts = axis.node.counts_per_revolution
    if not math.isclose(feed * shaft, counts * turns * gear, rel_tol=1e-4):
        raise DeviceFault(
            f"{drive.name}: gear 6091 ({gear}/{shaft}) and feed 6092 ({feed}/{turns}) give "
            f"{feed * shaft / (turns * gear):g} position units per motor turn, but the rig states "
            f"{counts}; set them so that one unit is one encoder increment, or correct "
            "counts_per_revolution"
        )
    return [
        f"{drive.name}: 6091 and 6092 give {counts} position units per motor turn, as in the rig"
    ]


def _velocity_unit(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Compare a drive's velocity unit (60A9h) with the rig's, where it is used.

    The object does not say whether it is at the motor or at the gear's output; both are accepted.
    """
    node = axis.node
    if not axis.servo and (node.move is None or node.move.mode != "pv"):
        return []
    word = drive.find(o.VELOCITY_UNIT)
    reported = velocity_unit(word) if word else None
    if word is None or reported is None:
        return []
    said = axis.scale.velocity_quantum  # at the axis
    travel = axis.scale.encoder_quantum * node.counts_per_revolution  # of it, per motor turn
    meant = [reported]
    if not is_length(word):
        meant = [reported * travel / math.tau, reported * travel * node.gear_ratio / math.tau]
    if not any(math.isclose(said, each, rel_tol=1e-3) for each in meant):
        right = " or ".join(
            f"{each / axis.scale.encoder_quantum:.6g}" for each in dict.fromkeys(meant)
        )
        raise DeviceFault(
            f"{drive.name}: one velocity unit is {unit_text(word)} by 60A9:00, which is {right} "
            f"counts/s, but the rig states velocity_factor {node.velocity_factor:g}; correct it"
        )
    return [f"{drive.name}: 60A9 velocity unit {unit_text(word)}, as velocity_factor"]


def _step(unit: float, said: float) -> float:
    return max(0.5 * unit, 1e-3 * said)


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


def check_sync(drive: RemoteDrive, options: CanopenOptions) -> list[str]:
    """Make sure that SYNC is 80h and that this drive does not produce it."""
    found = drive.find(c.SYNC_COB_ID)
    if found is None or found & (_SYNC_PRODUCER | 0x7FF) == 0x80:
        return []
    return [require(drive, c.SYNC_COB_ID, 0x80, "two masters would send SYNC").text]


def limit_torque(drive: RemoteDrive, axis: Axis) -> list[str]:
    """Lower 6072h to the rig's effort_limit until the bus is closed; refuse a drive with less.

    Raises
    ------
    DeviceFault
        The drive would clip torque below the rig's limit.
    """
    if axis.servo:
        return []
    step = axis.scale.effort_quantum
    wanted = min(0xFFFF, math.ceil(axis.spec.effort_limit / step - 1e-9))
    held = drive.find(o.MAX_TORQUE)
    if held is None:
        return [f"{drive.name} has no 6072:00: only this program limits its torque"]
    if held < wanted:
        raise DeviceFault(
            f"{drive.name}: 6072:00 max torque {held} per mille is {held * step:.4g}, below the "
            f"rig's effort_limit {axis.spec.effort_limit:g}; lower effort_limit, or raise 6072h "
            "with the drive's tool if motor and mechanics allow it; after a run was killed, its "
            "limit stays until the drive is power-cycled"
        )
    if held > wanted:
        axis.torque_before = held
    return [settle(drive, o.MAX_TORQUE, wanted).text]


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
    heartbeat = settle(drive, c.CONSUMER_HEARTBEAT, consumer)
    deadline = settle(drive, c.rpdo(1).timer, options.heartbeat_timeout_ms)
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
