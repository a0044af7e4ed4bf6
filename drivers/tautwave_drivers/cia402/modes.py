"""Modes of operation (6060h): which a drive has, and the control and status bits of each.

Source: CiA 402-2 v3.0, objects 6060h, 6502h and the clause of each mode.
"""

from __future__ import annotations

import enum

from tautwave_drivers.cia402.states import HALT, MODE_BIT_12, MODE_BIT_13, TARGET_REACHED


class Mode(enum.IntEnum):
    """Mode of operation as 6060h and 6061h hold it."""

    NONE = 0
    PP = 1
    VL = 2
    PV = 3
    PT = 4
    HM = 6
    IP = 7
    CSP = 8
    CSV = 9
    CST = 10


MODE_NAMES = {
    0: "no mode",
    1: "PP profile position",
    2: "VL velocity",
    3: "PV profile velocity",
    4: "PT profile torque",
    6: "HM homing",
    7: "IP interpolated position",
    8: "CSP cyclic synchronous position",
    9: "CSV cyclic synchronous velocity",
    10: "CST cyclic synchronous torque",
}

CONTROL_BITS = {
    1: ((4, "new set-point"), (5, "change set immediately"), (6, "relative"), (9, "change on")),
    2: ((4, "enable ramp"), (5, "unlock ramp"), (6, "reference ramp")),
    3: (),
    4: (),
    6: ((4, "homing operation start"),),
    7: ((4, "enable interpolation"),),
    8: (),
    9: (),
    10: (),
}
"""Controlword bits that a mode adds to the common ones; halt (bit 8) is common."""

HOMING_START = 1 << 4
CYCLIC_MODES = frozenset((Mode.CSP, Mode.CSV, Mode.CST))

_MASKS = {mode: sum(1 << bit for bit, _ in bits) | HALT for mode, bits in CONTROL_BITS.items()}


def control_mask(mode: int) -> int:
    """Return the controlword bits that `mode` may set besides the state machine's."""
    return _MASKS.get(mode, HALT)


def mode_name(mode: int | None) -> str:
    """Return a mode as text."""
    if mode is None:
        return "nothing"
    return MODE_NAMES.get(mode, f"mode {mode} (the manufacturer's)" if mode < 0 else f"mode {mode}")


def supports(supported: int, mode: int) -> bool:
    """Return whether 6502h = `supported` has `mode`; bit n-1 stands for mode n."""
    return mode >= 1 and bool(supported >> (mode - 1) & 1)


def supported_modes(supported: int) -> tuple[int, ...]:
    """Return the standard modes that 6502h = `supported` names (its low word)."""
    return tuple(mode for mode in range(1, 17) if supports(supported, mode))


def supported_text(supported: int) -> str:
    """Return 6502h as text."""
    names = ", ".join(mode_name(mode) for mode in supported_modes(supported))
    return names or "no standard mode"


class Homing:
    """Runs the drive's homing: start (bit 4) until attained (12 and 10) or error (13).

    Non-blocking, one `step` per cycle while the mode in force is HM. Bit 4 is held at 1: taking it
    back would interrupt the search. Attained bits still set from an earlier homing do not
    count: they have to have been 0, or to stay for `settle_cycles` after the start.
    """

    def __init__(self, settle_cycles: int = 50) -> None:
        self._settle_cycles = settle_cycles
        self._cycles = 0
        self._started = False
        self._cleared = False
        self.done = False
        self.failed = False

    def step(self, statusword: int) -> int:
        """Return the controlword bits of this cycle, for `Machine.step(mode_bits=...)`."""
        if not self._started:
            self._started = True  # this cycle still 0: the drive needs a rising edge
            return 0
        self._cycles += 1
        attained = bool(statusword & MODE_BIT_12)
        if not attained:
            self._cleared = True
        fresh = self._cleared or self._cycles > self._settle_cycles
        self.failed = self.failed or (bool(statusword & MODE_BIT_13) and fresh)
        self.done = self.done or (
            attained and bool(statusword & TARGET_REACHED) and fresh and not self.failed
        )
        return 0 if self.failed else HOMING_START
