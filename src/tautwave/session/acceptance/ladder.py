"""What each stage of an acceptance does and has to show, and the first touch of an effort."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from tautwave.config import Rig
from tautwave.session.acceptance.document import Check
from tautwave.session.acceptance.motion import drive, push
from tautwave.session.guided.answers import one_of
from tautwave.session.guided.control import GuidedControl

SEEN = {
    "identity": "read only: every device is there, and is the one that the rig names",
    "hand": "no torque: the numbers follow your hand, by as much as you turn",
    "limits": "no torque: each axis reaches either end of its range freely",
    "noise": "torque on, no effort: the axes stand still, and can be moved by hand",
    "silence": "torque on, no effort: this host says nothing, and each axis lets go by itself",
    "watchdog": "torque on, no effort: without its cable each axis lets go by itself, and stays so",
    "touch": "one axis at a time, a twentieth of its effort: you feel it pull the positive way",
    "motion": "a degree or two (1 mm) both ways: each axis goes, stops, and comes back by itself",
    "delay": "a short push: each axis gives a small jerk the positive way, and nothing after it",
    "effort": "a tenth, then a fifth of the effort: the scale shows what is asked for",
    "gentle": "coupled without walls, at a tenth of every effort: the slave follows softly",
    "walls": "coupled with its walls, at a tenth of every effort: they can be felt, and are quiet",
    "full": "coupled, as the rig has it: the slave follows, nothing buzzes, walls are hard",
}
"""By stage, in rising risk: each stops by itself, and its numbers are kept."""

STAGES = tuple(SEEN)
FREE = frozenset({"identity", "hand", "limits"})
"""Nothing has torque. Up to `watchdog` nothing is commanded."""
COUPLED = frozenset({"gentle", "walls", "full"})

TOUCH = 0.05
"""Of the effort limit at most."""
FELT = ("+", "-", "0")


def touches(
    rig: Rig, axes: Sequence[str], control: GuidedControl
) -> Generator[None, None, list[Check]]:
    """Let each axis pull a hand a little the positive way; the person says which way it was.

    An axis that takes velocity goes a degree instead.
    """
    checks = []
    for name in axes:
        axis = rig.axes[name]
        yield from control.ask(
            f"{name}: hold it loosely; it goes the positive way, with at most {TOUCH:g} of its "
            "effort limit, and stops once it has moved a little; press Enter"
        )
        numbers: dict[str, float | str]
        if axis.causality == "impedance":
            pushed = yield from push(axis, name, 1.0, control, TOUCH)
            numbers = {"share": pushed.share, "moved": pushed.moved}
        else:
            driven = yield from drive(axis, name, 1.0, control)
            numbers = {"commanded": driven.commanded, "moved": driven.moved}
        felt = yield from control.ask(
            f"{name}: which way did it go? + or -, 0 where you felt nothing", one_of(*FELT)
        )
        numbers["felt"] = felt
        good = felt != "-" and float(numbers["moved"]) >= (0.0 if felt == "+" else -1e-9)
        checks.append(Check("touch", name, numbers, "felt + (or 0), and not moved back", good))
    return checks
