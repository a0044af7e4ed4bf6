"""Before anything gets torque: axes off their ends, and pairs together; it asks, and waits."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence

from tautwave.config import Rig
from tautwave.rig.scales import slave_offset
from tautwave.session.acceptance.document import Check
from tautwave.session.acceptance.motion import TOO_FAR
from tautwave.session.guided.control import GuidedControl

MIN_ROOM, MAX_ROOM = 0.1, 0.4
"""Share of its position range by which an axis stays off each end: at least, and at most."""
TOGETHER = 0.8
"""Share of `engage_tolerance` within which a pair is brought together."""
STILL_S, WAIT_S = 0.3, 300.0
"""How long they are to stand there, and how long somebody is waited for."""


def middles(rig: Rig, axes: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return where each axis with a range may begin [rad or m]: it is pushed from there."""
    ranges = {}
    for name in axes:
        axis = rig.axes[name]
        if axis.position_range is not None:
            low, high = axis.position_range
            span = high - low
            room = min(max(MIN_ROOM * span, TOO_FAR[axis.kind]), MAX_ROOM * span)
            ranges[name] = (low + room, high - room)
    return ranges


def apart(rig: Rig, at: Mapping[str, float]) -> dict[str, float]:
    """Return by how much the slave of each pair is off its place [rad or m], where that matters.

    Only of pairs that do not engage there: with an `engage_tolerance`, and a rig that does not
    align its slaves itself.
    """
    gaps = {}
    for name, keys in rig.coupling.pairs.items() if rig.scene is None else ():
        offset, tolerance = slave_offset(keys)
        if rig.operate is None and offset is not None and math.isfinite(tolerance):
            goal = keys.sign * keys.position_scale * at[f"master.{name}"] + offset
            gap = at[f"slave.{name}"] - goal
            if abs(gap) > TOGETHER * tolerance:
                gaps[name] = gap
    return gaps


def wait_for_place(
    rig: Rig, axes: Sequence[str], control: GuidedControl, *, coupled: bool
) -> Generator[None, None, list[Check]]:
    """Wait until each axis stands where the stage may begin; say once what is to be moved where.

    Returns
    -------
    list of Check
        Empty: everything is in its place. Otherwise nobody moved it in time.
    """
    ranges = middles(rig, axes)
    asked: set[str] = set()
    begun = since = control.now_ns
    while True:
        wrong = _wrong(rig, ranges, control, coupled=coupled)
        for what, (sentence, _) in wrong.items():
            if what not in asked:
                asked.add(what)
                control.say(f"  waiting: {sentence}")
        lines = "\n".join(f"  {line}" for _, line in wrong.values())
        control.show(lines.__str__)
        if wrong:
            since = control.now_ns
        if not wrong and (not asked or control.now_ns - since >= 1e9 * STILL_S):
            return []
        if control.now_ns - begun > 1e9 * WAIT_S:
            return [
                Check("place", what, {"said": sentence}, f"in its place within {WAIT_S:g} s", False)
                for what, (sentence, _) in wrong.items()
            ]
        yield


def _wrong(
    rig: Rig,
    ranges: Mapping[str, tuple[float, float]],
    control: GuidedControl,
    *,
    coupled: bool,
) -> dict[str, tuple[str, str]]:
    """Return what is not in its place: a sentence, and a line of numbers."""
    wrong = {}
    for name, (low, high) in ranges.items():
        at = control.position(name)
        if not low <= at <= high:
            unit = "rad" if rig.axes[name].kind == "rotary" else "m"
            wrong[name] = (
                f"move {name} towards the middle, between {low:.3g} and {high:.3g} {unit}; it is "
                f"at {at:.3g}",
                f"{name} {at:+.3f} {unit}, to {low:+.3f} .. {high:+.3f}",
            )
    if coupled:
        for name, gap in apart(rig, {key: control.position(key) for key in rig.axes}).items():
            unit = "rad" if rig.axes[f"slave.{name}"].kind == "rotary" else "m"
            wrong[f"pair {name}"] = (
                f"bring master.{name} and slave.{name} together; the slave is {gap:+.3g} {unit} "
                "off its place",
                f"pair {name} {gap:+.3f} {unit} apart",
            )
    return wrong
