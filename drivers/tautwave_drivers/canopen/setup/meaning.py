"""Objects of a drive that change sign, scale or meaning of a number that is sent or read.

Every one stands in `TABLE`. Each is read before any torque, where the drive has it, and compared
with what the rig states; a difference is refused with the object, its value and what would be
right. Source: CiA 402-2 v3.0, factor group and limits; 6089h to 608Ch and 6093h to 6095h as in its
edition 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from tautwave.errors import DeviceFault
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.si_units import (
    is_increments,
    is_length,
    position_unit,
    unit_text,
    unit_word,
    velocity_unit,
)
from tautwave_drivers.cia402.units import MAXON, MICRO, MILLI

if TYPE_CHECKING:
    from tautwave_drivers.canopen.network import RemoteDrive

RATIO_TOLERANCE = 1e-4
"""Whole numbers hold the product of counts and gear only to some 1e-5."""
TOOL = "with the drive's tool or a DCF"

ZEROED = (
    o.TARGET_TORQUE,
    o.TORQUE_OFFSET,
    o.TARGET_VELOCITY,
    o.VELOCITY_OFFSET,
    o.POSITION_OFFSET,
)
"""What is left in these acts as soon as the drive is enabled: they are written 0."""

OF_VELOCITY = (o.VELOCITY_NOTATION, o.VELOCITY_DIMENSION, o.MAX_PROFILE_VELOCITY)
"""They mean nothing to a run that sends no velocity, which does not read them."""

Read = Mapping[Entry, int | None]
"""Values of all objects in the table; None where the drive has none."""


class Verdict(NamedTuple):
    """On one row: why it is refused and what would be right, or a note; both may be ''."""

    refusal: str = ""
    note: str = ""


class Row(NamedTuple):
    """Objects, what they scale, the values that are right for it, in words, and the rule.

    `caps`: they only limit it, and a run or a person may lower them.
    """

    entries: tuple[Entry, ...]
    scales: str
    right: str
    judge: Callable[[Read, Axis], Verdict]
    caps: bool = False


def check_meaning(drive: RemoteDrive, axis: Axis, master_id: int) -> list[str]:
    """Compare every object of the table with the rig; return notes.

    `master_id` is this master's: a limit that a run of it left, which was killed, is said to be so.

    Raises
    ------
    DeviceFault
        A number would mean something else than in the rig, or the drive does not tell.
    """
    read = {
        entry: drive.find(entry, surely=True) if uses(axis) or entry not in OF_VELOCITY else None
        for entry in ENTRIES
    }
    notes = []
    for row, verdict in verdicts(read, axis):
        if verdict.refusal and o.MAX_TORQUE in row.entries and _armed_by(drive, master_id):
            raise DeviceFault(
                f"{drive.name}: {verdict.refusal}; or switch the drive off and on: a run that was "
                "killed lowered it (its watchdog 1016:01 is still armed)"
            )
        if verdict.refusal:
            raise DeviceFault(f"{drive.name}: {verdict.refusal}")
        if verdict.note:
            notes.append(f"{drive.name}{verdict.note}")
    axis.identity["scales"] = " ".join(
        f"{entry.address}={value}"
        for row in TABLE
        if not row.caps
        for entry in row.entries
        if (value := read[entry]) is not None
    )
    for name, entry in (("home_offset", o.HOME_OFFSET), ("rated_current", o.RATED_CURRENT)):
        value = read[entry]
        if value is not None:
            axis.identity[name] = str(value)
    return notes


def _armed_by(drive: RemoteDrive, master_id: int) -> bool:
    """Return whether a drive still watches a master, as only a killed one leaves it."""
    held = drive.find(c.CONSUMER_HEARTBEAT)
    return held is not None and held >> 16 == master_id and held & 0xFFFF > 0


def verdicts(read: Read, axis: Axis) -> Iterator[tuple[Row, Verdict]]:
    """Yield the verdict on each row; a refusal has the objects, their values and what is right."""
    for row in TABLE:
        verdict = row.judge(read, axis)
        if verdict.refusal:
            shown = ", ".join(
                f"{entry.address} {entry.name} is {_shown(entry, value)}"
                for entry in row.entries
                if (value := read[entry]) is not None
            )
            refusal = f"{shown}; right for {row.scales} is {row.right}: {verdict.refusal}"
            verdict = Verdict(refusal, verdict.note)
        yield row, verdict


def counts_per_turn(read: Read) -> float | None:
    """Return what a drive with these values counts per motor turn, None where that is not stated.

    Drives leave 1/1, or 0, in 608Fh where they do not say what encoder they have.
    """
    word = _position_word(read)
    unit = position_unit(word) if word and not is_increments(word) else None
    if word and unit is not None and not is_length(word):
        return math.tau / unit / _gear(read)
    feed = _feed(read)
    if feed is not None:
        return feed / _gear(read)
    increments = _ratio(read, o.ENCODER_INCREMENTS, o.ENCODER_REVOLUTIONS)
    return None if increments is None or increments <= 1.0 else increments


def _shown(entry: Entry, value: int) -> str:
    if entry in (o.POSITION_UNIT, o.VELOCITY_UNIT):
        return f"0x{value:08X} ({unit_text(value)})"
    return f"0x{value:02X}" if entry.unit == "bits" else str(value)


def _ratio(read: Read, numerator: Entry, divisor: Entry) -> float | None:
    """Return a quotient of two objects, None where it is not stated (absent, 0).

    An absent divisor is 1.
    """
    above, below = read.get(numerator), read.get(divisor)
    below = 1 if below is None else below
    return above / below if above and below else None


# -- signs and zeros --------------------------------------------------------------------------


def _polarity(read: Read, axis: Axis) -> Verdict:
    if not read[o.POLARITY]:
        return Verdict()
    return Verdict(
        f"set it to 0 {TOOL}, and state direction: {-axis.node.direction} in the rig if the axis "
        "then moves the wrong way"
    )


def _home_offset(read: Read, axis: Axis) -> Verdict:
    held, wanted = read[o.HOME_OFFSET], axis.node.home_offset
    if held is None or held == wanted:
        return Verdict()
    return Verdict(
        f"the rig states home_offset {wanted}; state home_offset: {held} in its node if the zero "
        f"of the drive is meant, or set it to {wanted} {TOOL}"
    )


WRAP_SPARE = 0.1
"""Of the span of 607Bh, beyond position_range on either side: no axis gets there in a run."""


def _wrap(read: Read, axis: Axis) -> Verdict:
    low, high = read[o.MIN_WRAP], read[o.MAX_WRAP]
    if low == high or (low == -(1 << 31) and high == (1 << 31) - 1):
        return Verdict()
    if low is not None and high is not None:
        ends = [end / axis.scale.encoder_quantum for end in axis.spec.position_range]
        spare = WRAP_SPARE * (high - low)
        if low + spare <= min(ends) and max(ends) <= high - spare:
            return Verdict()  # the run has stopped long before
    return Verdict(f"positions jump at these ends; set both to 0 {TOOL}")


# -- positions --------------------------------------------------------------------------------


def _gear(read: Read) -> float:
    """Return motor turns per turn of the driving shaft (6091h), 1 where it is not stated."""
    return _ratio(read, o.GEAR_MOTOR, o.GEAR_SHAFT) or 1.0


def _feed(read: Read) -> float | None:
    """Return position units per turn of the driving shaft (6092h), None where not stated.

    Drives that always count increments leave a feed of 1 there.
    """
    return None if read.get(o.FEED) == 1 else _ratio(read, o.FEED, o.FEED_REVOLUTIONS)


def _old_word(read: Read, notation: Entry, dimension: Entry) -> int | None:
    """Return a unit by two indices of edition 2 as a unit word, None where there are none."""
    power, unit = read.get(notation), read.get(dimension)
    return None if power is None and unit is None else unit_word(power or 0, unit or 0)


def _position_word(read: Read) -> int | None:
    """Return the unit of positions as a word, by 60A8h or else by edition 2's indices."""
    return read.get(o.POSITION_UNIT) or _old_word(read, o.POSITION_NOTATION, o.POSITION_DIMENSION)


def _si_unit(read: Read) -> float | None:
    """Return the SI value of one position unit, None for increments or none."""
    word = _position_word(read)
    return position_unit(word) if word and not is_increments(word) else None


def _differs(counts: float, axis: Axis) -> bool:
    stated = axis.node.counts_per_revolution
    return not math.isclose(counts, stated, rel_tol=RATIO_TOLERANCE)


def _state(counts: float) -> str:
    """Return how to state so many counts per turn, '' where that is no whole number."""
    whole = round(counts)
    near = whole > 0 and math.isclose(counts, whole, rel_tol=RATIO_TOLERANCE)
    return f"counts_per_revolution: {whole}" if near else ""


def _position_unit(read: Read, axis: Axis) -> Verdict:
    increments = f"set it to increments (0x00B50000, on some drives 0) {TOOL}"
    return _unit_of_position(read, axis, read[o.POSITION_UNIT], "60A8", increments)


def _old_position_unit(read: Read, axis: Axis) -> Verdict:
    word = _old_word(read, o.POSITION_NOTATION, o.POSITION_DIMENSION)
    return _unit_of_position(read, axis, word, "6089 and 608A", f"set both to 0 {TOOL}")


def _unit_of_position(
    read: Read, axis: Axis, word: int | None, named: str, increments: str
) -> Verdict:
    if not word or is_increments(word):
        return Verdict()
    unit = position_unit(word)
    if unit is None:
        return Verdict(f"this driver does not know that unit; {increments}")
    node = axis.node
    if not is_length(word):
        counts = math.tau / unit / _gear(read)
    elif node.feed is None:
        return Verdict(f"a length, but the axis is rotary; {increments}")
    else:
        counts = node.feed / node.gear_ratio / unit
    if _differs(counts, axis):
        stated = _state(counts)
        state = f"state {stated} in the rig, or " if stated else ""
        return Verdict(
            f"that makes {counts:g} counts per motor turn, but the rig states "
            f"{node.counts_per_revolution}; {state}{increments}"
        )
    return Verdict(note=f": {named} {unit_text(word)} is one count, as in the rig")


def _factors(read: Read, axis: Axis) -> Verdict:
    gear, feed = _gear(read), _feed(read)
    if feed is None:
        if gear == 1.0 or _si_unit(read) is not None:
            return Verdict()
        return Verdict(
            "6092h does not state what a turn of the gear's output is, so a position may be "
            f"counted at either end; set 6091:01 and 6091:02 to 1 {TOOL}, and leave the gear to "
            "gear_ratio in the rig"
        )
    counts = feed / gear
    if _differs(counts, axis):
        stated = _state(counts)
        state = f", or state {stated} if the drive does count in that unit" if stated else ""
        return Verdict(
            f"they give {counts:g} position units per motor turn, but the rig states "
            f"{axis.node.counts_per_revolution}; set them {TOOL} so that one unit is one encoder "
            f"increment{state}"
        )
    in_rig = axis.node.counts_per_revolution
    return Verdict(
        note=f": 6091 and 6092 give {in_rig} position units per motor turn, as in the rig"
    )


def _encoder(read: Read, axis: Axis) -> Verdict:
    increments = _ratio(read, o.ENCODER_INCREMENTS, o.ENCODER_REVOLUTIONS)
    in_rig = axis.node.counts_per_revolution
    if increments is None or increments == 1.0:  # drives leave 1/1 where they do not say it
        return Verdict()
    if _si_unit(read) is not None or (_feed(read) is not None and _differs(increments, axis)):
        if increments * (1.0 + RATIO_TOLERANCE) >= in_rig:
            return Verdict(
                note=f": 608F has {increments:g} increments for {in_rig} counts per turn"
            )
        return Verdict(
            f"the encoder has only {increments:g} increments per motor turn for the {in_rig} "
            "position units that the drive makes of them; choose a coarser unit in 60A8h or 6092h"
        )
    if _differs(increments, axis):
        stated = _state(increments)
        state = f"state {stated} in the rig if the motor has that encoder, or " if stated else ""
        return Verdict(
            f"that makes {increments:g} counts per motor turn, but the rig states {in_rig}; {state}"
            f"set 608Fh {TOOL}"
        )
    return Verdict(note=f": 608F has {in_rig} counts per motor turn, as in the rig")


def _one(numerator: Entry, divisor: Entry, *, velocity: bool) -> Callable[[Read, Axis], Verdict]:
    """Return the rule of a factor that has to be 1."""

    def judge(read: Read, axis: Axis) -> Verdict:
        if _ratio(read, numerator, divisor) in (None, 1.0) or (velocity and not uses(axis)):
            return Verdict()
        return Verdict(f"set both to 1 {TOOL}")

    return judge


# -- velocities -------------------------------------------------------------------------------


def uses(axis: Axis) -> bool:
    """Return whether a velocity is sent to the drive, by its own mode or a move."""
    move = axis.node.move
    return axis.servo or (move is not None and move.mode == "pv")


def _velocity_word(read: Read) -> int | None:
    """Return the unit of velocities as a word, by 60A9h or else by edition 2's indices."""
    return read[o.VELOCITY_UNIT] or _old_word(read, o.VELOCITY_NOTATION, o.VELOCITY_DIMENSION)


def _velocity_unit(read: Read, axis: Axis) -> Verdict:
    """Judge 60A9h. It does not say whether it is at the motor or at the gear's output: both do."""
    increments = f"set it to increments per second (0x00B50300) {TOOL}"
    return _unit_of_velocity(axis, read[o.VELOCITY_UNIT], "60A9", increments)


def _old_velocity_unit(read: Read, axis: Axis) -> Verdict:
    word = _old_word(read, o.VELOCITY_NOTATION, o.VELOCITY_DIMENSION)
    return _unit_of_velocity(axis, word, "608B and 608C", f"set both to 0 {TOOL}")


def _unit_of_velocity(axis: Axis, word: int | None, named: str, increments: str) -> Verdict:
    if not word or not uses(axis):
        return Verdict()
    node, quantum = axis.node, axis.scale.encoder_quantum
    stated = axis.scale.velocity_quantum  # at the axis
    travel = quantum * node.counts_per_revolution  # of it, per motor turn
    unit = velocity_unit(word)
    if is_increments(word):
        meant = [quantum]
    elif unit is None:
        return Verdict(
            f"this driver does not know that unit; {increments}, with velocity_factor: 1 in the rig"
        )
    elif is_length(word):
        meant = [unit]
    else:
        meant = [unit * travel / math.tau, unit * travel * node.gear_ratio / math.tau]
    if not any(math.isclose(stated, each, rel_tol=1e-3) for each in meant):
        right = " or ".join(f"{each / quantum:.6g}" for each in dict.fromkeys(meant))
        return Verdict(
            f"one unit is {right} counts/s, but the rig states velocity_factor "
            f"{node.velocity_factor:g}; correct it"
        )
    return Verdict(note=f": {named} velocity unit {unit_text(word)}, as velocity_factor")


def _velocity_encoder(read: Read, axis: Axis) -> Verdict:
    held = _ratio(read, o.VELOCITY_INCREMENTS, o.VELOCITY_REVOLUTIONS)
    word = _velocity_word(read)
    stated = bool(word) and not is_increments(word or 0)  # whatever the encoder has
    if held is None or held == 1.0 or stated or not uses(axis):
        return Verdict()
    node = axis.node
    right = node.counts_per_revolution / node.velocity_factor
    if math.isclose(held, right, rel_tol=1e-3):
        return Verdict()
    factor = node.counts_per_revolution / held
    return Verdict(
        f"that makes {held:g} velocity units per motor turn and second, but the rig's "
        f"velocity_factor {node.velocity_factor:g} makes {right:g}; state velocity_factor: "
        f"{factor:.6g}, or set 6090h {TOOL}"
    )


# -- torques ----------------------------------------------------------------------------------


def rated_unit(axis: Axis) -> tuple[str, float]:
    """Return the unit of 6076h by name, and in N m: mN m by the standard, uN m on maxon's."""
    stated = axis.node.rated_torque_unit
    if stated is None:
        stated = "uN m" if axis.identity.get("vendor") == f"0x{MAXON:X}" else "mN m"
    return stated, {"uN m": MICRO, "mA": MILLI * (axis.node.torque_constant or 1.0)}.get(
        stated, MILLI
    )


def _rated_torque(read: Read, axis: Axis) -> Verdict:
    rated, stated = read[o.RATED_TORQUE], axis.node.rated_torque
    if rated is None:
        return Verdict(note=f" has no 6076:00: rated torque {stated:g} N m is not checked")
    if rated == 0:
        name, unit = rated_unit(axis)
        return Verdict(
            f"the drive has no motor data; set it to {round(stated / unit)} ({name}, as the "
            f"rig's rated_torque {stated:g} N m) {TOOL}, with the motor's other data"
        )
    name, unit = rated_unit(axis)
    if abs(rated * unit - stated) <= max(0.5 * unit, 1e-3 * stated):
        return Verdict(
            note=f": 6076:00 rated torque {rated} {name} is {stated:g} N m, as in the rig"
        )
    return Verdict(
        f"that is {rated * unit:g} N m, counted in {name}, but the rig states {stated:g} N m; "
        f"state rated_torque: {rated * unit:g} in the rig if that is the motor's, or "
        "rated_torque_unit (mN m, uN m, or mA with the motor's torque_constant) if the drive "
        "counts in another, or "
        f"set 6076h to {round(stated / unit)} {TOOL}"
    )


def _rated_current(read: Read, axis: Axis) -> Verdict:
    if read[o.RATED_CURRENT] == 0 and read[o.RATED_TORQUE] is not None:
        return Verdict(f"the drive has no motor data; set its rated current in mA {TOOL}")
    return Verdict()


# -- limits below those of the rig ------------------------------------------------------------


def wanted_torque(axis: Axis) -> int:
    """Return the rig's effort_limit as the least per mille of rated torque that allows it."""
    step = axis.scale.effort_quantum
    return min(0xFFFF, math.ceil(axis.spec.effort_limit / step - 1e-9))


def _torque_cap(entry: Entry) -> Callable[[Read, Axis], Verdict]:
    def judge(read: Read, axis: Axis) -> Verdict:
        held, step = read[entry], axis.scale.effort_quantum
        if axis.servo:
            return Verdict()
        if held is None:
            unlimited = entry == o.MAX_TORQUE
            sentence = f" has no {entry.address}: only this program limits its torque"
            return Verdict(note=sentence if unlimited else "")
        if entry == o.NEGATIVE_TORQUE_LIMIT and (held < 0 or 0x8000 < held < 0xFFFF):
            held = abs(held) if held < 0 else 0x10000 - held  # drives that count it downwards
        if held >= wanted_torque(axis):
            return Verdict()
        return Verdict(
            f"{held} per mille is {held * step:.4g}, below the rig's effort_limit "
            f"{axis.spec.effort_limit:g}; lower effort_limit, or set it to at least "
            f"{wanted_torque(axis)} {TOOL} if motor and mechanics allow it"
        )

    return judge


def _speed_cap(read: Read, axis: Axis) -> Verdict:
    held = read[o.MAX_MOTOR_SPEED]
    travel = axis.scale.encoder_quantum * axis.node.counts_per_revolution  # per motor turn
    wanted = axis.spec.velocity_limit / travel * 60.0
    if held is None or wanted == math.inf or held >= wanted * (1.0 - RATIO_TOLERANCE):
        return Verdict()
    return Verdict(
        f"{held} rpm of the motor is {held / 60.0 * travel:.4g} at the axis, below the rig's "
        f"velocity_limit {axis.spec.velocity_limit:g}; lower velocity_limit, or set it to at least "
        f"{math.ceil(wanted)} {TOOL} if motor and mechanics allow it"
    )


def _profile_cap(read: Read, axis: Axis) -> Verdict:
    """Judge 607Fh: of profile modes by the standard, but some drives cap CSV by it too."""
    held, step, node = read[o.MAX_PROFILE_VELOCITY], axis.scale.velocity_quantum, axis.node
    fastest = axis.spec.velocity_limit if axis.servo else node.move.velocity if node.move else 0.0
    wanted = fastest / step if uses(axis) else 0.0
    if held is None or wanted == math.inf or held >= wanted * (1.0 - RATIO_TOLERANCE):
        return Verdict()
    what = "velocity_limit" if axis.servo else "velocity of move"
    return Verdict(
        f"that is {held * step:.4g} at the axis, below the rig's {what} {fastest:g}; lower that, "
        f"or set it to at least {math.ceil(wanted)} {TOOL} if motor and mechanics allow it"
    )


TABLE = (
    Row((o.POLARITY,), "the signs of 6064h, 606Ch and 60FFh", "0 alone", _polarity),
    Row((o.HOME_OFFSET,), "the zero of 6064h", "home_offset of the rig", _home_offset),
    Row(
        (o.MIN_WRAP, o.MAX_WRAP),
        "where 6064h wraps",
        "equal, 32 bits, or far outside position_range",
        _wrap,
    ),
    Row((o.POSITION_UNIT,), "6064h and 607Ah", "increments, or the rig's counts", _position_unit),
    Row(
        (o.POSITION_NOTATION, o.POSITION_DIMENSION),
        "6064h and 607Ah",
        "0 and 0, or the rig's counts",
        _old_position_unit,
    ),
    Row(
        (o.GEAR_MOTOR, o.GEAR_SHAFT, o.FEED, o.FEED_REVOLUTIONS),
        "6064h and 607Ah",
        "1/1, feed 1, or the rig's counts",
        _factors,
    ),
    Row(
        (o.ENCODER_INCREMENTS, o.ENCODER_REVOLUTIONS),
        "6064h and 607Ah",
        "1/1, or the rig's counts",
        _encoder,
    ),
    Row(
        (o.POSITION_FACTOR, o.POSITION_DIVISOR),
        "6064h and 607Ah",
        "1/1",
        _one(o.POSITION_FACTOR, o.POSITION_DIVISOR, velocity=False),
    ),
    Row((o.VELOCITY_UNIT,), "606Ch and 60FFh", "0, or velocity_factor", _velocity_unit),
    Row(
        (o.VELOCITY_NOTATION, o.VELOCITY_DIMENSION),
        "606Ch and 60FFh",
        "0 and 0, or velocity_factor",
        _old_velocity_unit,
    ),
    Row(
        (o.VELOCITY_INCREMENTS, o.VELOCITY_REVOLUTIONS),
        "606Ch and 60FFh",
        "1/1, or velocity_factor",
        _velocity_encoder,
    ),
    *(
        Row(pair, "606Ch and 60FFh", "1/1", _one(*pair, velocity=True))
        for pair in (
            (o.VELOCITY_ENCODER_FACTOR, o.VELOCITY_ENCODER_DIVISOR),
            (o.VELOCITY_FACTOR_1, o.VELOCITY_DIVISOR_1),
            (o.VELOCITY_FACTOR, o.VELOCITY_DIVISOR),
        )
    ),
    Row((o.RATED_TORQUE,), "6071h, 6072h and 6077h", "rated_torque of the rig", _rated_torque),
    Row((o.RATED_CURRENT,), "6077h on drives that take it from current", "not 0", _rated_current),
    Row(
        (o.MAX_TORQUE,),
        "the maximum of 6071h",
        "effort_limit",
        _torque_cap(o.MAX_TORQUE),
        True,
    ),
    *(
        Row((entry,), "the maximum of 6071h", "effort_limit", _torque_cap(entry), True)
        for entry in (o.MAX_CURRENT, o.POSITIVE_TORQUE_LIMIT, o.NEGATIVE_TORQUE_LIMIT)
    ),
    Row(
        (o.MAX_PROFILE_VELOCITY,),
        "the maximum of 60FFh on some drives",
        "velocity_limit",
        _profile_cap,
        True,
    ),
    Row((o.MAX_MOTOR_SPEED,), "the maximum of 606Ch", "velocity_limit", _speed_cap, True),
)
ENTRIES = tuple(entry for row in TABLE for entry in row.entries)
