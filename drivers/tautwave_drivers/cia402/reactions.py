"""What a drive does when something happens: option codes 6007h and 605Ah to 605Eh, as text.

Source: CiA 402-2, objects 6007h and 605Ah to 605Eh; negative values are the manufacturer's.
"""

from __future__ import annotations

_RAMPS = {
    1: "slows down on the deceleration ramp",
    2: "slows down on the quick stop ramp",
    3: "slows down at the current limit",
    4: "slows down at the voltage limit",
}
_FREE = "disables the power stage, the motor coasts"
_THEN_OFF = ", then SWITCH ON DISABLED"
_THEN_STAYS = ", then stays in QUICK STOP ACTIVE"

_QUICK_STOP = {0: _FREE}
_QUICK_STOP |= {value: text + _THEN_OFF for value, text in _RAMPS.items()}
_QUICK_STOP |= {value + 4: text + _THEN_STAYS for value, text in _RAMPS.items()}

REACTIONS: dict[int, tuple[str, dict[int, str]]] = {
    0x6007: (
        "loss of the bus",
        {
            0: "does nothing: keeps following the last command",
            1: "malfunction: fault reaction 605Eh",
            2: "disables voltage, the motor coasts",
            3: "quick stop by 605Ah",
        },
    ),
    0x605A: ("quick stop", _QUICK_STOP),
    0x605B: ("shutdown", {0: _FREE, 1: _RAMPS[1] + ", then disables the power stage"}),
    0x605C: ("disable operation", {0: _FREE, 1: _RAMPS[1] + ", then disables the function"}),
    0x605D: ("halt", {value: text + ", stays enabled" for value, text in _RAMPS.items()}),
    0x605E: ("fault", {0: _FREE, **_RAMPS}),
}
"""Option object to its occasion and the meaning of its values."""


def reaction_text(index: int, value: int) -> str:
    """Return what the drive does by option code `value` of object `index`."""
    if index not in REACTIONS:
        return f"{index:04X} = {value}: not an option code of CiA 402"
    occasion, values = REACTIONS[index]
    if value in values:
        return f"on {occasion} it {values[value]} ({index:04X} = {value})"
    whose = "the manufacturer's own" if value < 0 else "reserved"
    return f"on {occasion}: value {value} of {index:04X} is {whose}; see the drive's manual"


NEXT = {1: 0x605E, 3: 0x605A}
"""6007h to the option code that then says how the torque ends."""


def is_standard(index: int, value: int) -> bool:
    """Return whether CiA 402 defines `value` of an option code."""
    return index in REACTIONS and value in REACTIONS[index][1]


def acts_on_loss(value: int) -> bool:
    """Return whether 6007h = `value` surely ends the torque when the bus is lost."""
    return value in (1, 2, 3)


def stays_in_quick_stop(value: int | None) -> bool:
    """Return whether 605Ah = `value` lets a drive rest in QUICK STOP ACTIVE (5 to 8)."""
    return value is not None and 5 <= value <= 8


def leaves_quick_stop(value: int | None) -> bool:
    """Return whether 605Ah = `value` ends a quick stop in SWITCH ON DISABLED by itself (1 to 4)."""
    return value is not None and 1 <= value <= 4
