"""The motion check: a small known effort both ways against the signs of all that a device reports.

What is commanded, the position, and velocity and motor effort where the device measures them, must
agree. A drive whose positions alone are turned would make a coupling push away from its goal.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import NamedTuple

from tautwave.config import Axis, Rig
from tautwave.session.acceptance.document import Check
from tautwave.session.guided.control import GuidedControl

MAX_SHARE, GROW_S = 0.2, 2.0
"""Of the effort limit at most, reached after this time: dry friction is overcome on the way."""
FAR = {"rotary": math.radians(1.0), "linear": 1e-3}
"""[rad or m] How far an axis is pushed."""
TOO_FAR = {"rotary": math.radians(5.0), "linear": 5e-3}
STEPS_SEEN = 4.0
"""Encoder steps that a motion has at least."""
AT_REST = 0.05
"""Share of its fastest velocity below which an axis counts as stopped."""
PAUSE_S = 0.3
SEEN = 0.1
"""Share of the commanded effort below which a motor's own reading has no sign."""

TAKES_VELOCITY = "no, it takes velocity"
INSTEAD = "stage hand for the sign of its position, stage gentle for that of its velocity"


class Pushed(NamedTuple):
    """A push one way: how far, how fast, and with what effort it went, along the push [SI].

    `share` of the effort limit was commanded at its end; `travel` is the farthest from the start
    [rad or m], braking included.
    """

    moved: float
    velocity: float
    effort: float
    share: float
    travel: float


def motions(
    rig: Rig, axes: Sequence[str], control: GuidedControl
) -> Generator[None, None, list[Check]]:
    """Push each axis both ways by at most 5 degrees (5 mm); compare all signs with the push.

    One that takes velocity cannot be pushed, and its check says what looks at its signs instead.
    """
    if any(rig.axes[name].causality == "impedance" for name in axes):
        yield from control.ask(
            "each axis that takes effort is pushed both ways by a degree or two (1 mm), with at "
            f"most {MAX_SHARE:g} of its effort limit; keep clear, then press Enter"
        )
    checks = []
    for name in axes:
        if rig.axes[name].causality != "impedance":
            numbers: dict[str, float | str] = {"pushed": TAKES_VELOCITY, "instead": INSTEAD}
            checks.append(Check("motion", name, numbers, "no push", True))
            continue
        for way, word in ((1.0, "forward"), (-1.0, "back")):
            pushed = yield from _push(rig.axes[name], name, way, control)
            checks.append(judged(f"{name} {word}", pushed, rig.axes[name]))
    return checks


def judged(what: str, pushed: Pushed, axis: Axis) -> Check:
    """Return whether everything that was seen went the way of the push."""
    numbers: dict[str, float | str] = {"share": pushed.share, "moved": pushed.moved}
    wrong = []
    if not pushed.moved > 0.0:
        wrong.append("position")
    if math.isfinite(pushed.velocity):
        numbers["velocity"] = pushed.velocity
        wrong += ["velocity"] if pushed.velocity <= 0.0 else []
    if math.isfinite(pushed.effort):
        numbers["motor_effort"] = pushed.effort
        least = SEEN * pushed.share * axis.effort_limit
        wrong += ["motor effort"] if pushed.effort < -least else []
    if pushed.travel > TOO_FAR[axis.kind]:
        wrong.append("travel")
    if wrong:
        numbers["against the push"] = ", ".join(wrong)
    return Check("motion", what, numbers, "all along the push, at most 5 deg or 5 mm",
                 not wrong)  # fmt: skip


def _push(
    axis: Axis, name: str, way: float, control: GuidedControl
) -> Generator[None, None, Pushed]:
    """Push with an effort that grows until the axis has moved, then take the impulse back."""
    period = 1e-9 * control.run.period_ns
    far = max(FAR[axis.kind], STEPS_SEEN * max(axis.encoder_quantum, axis.position_noise))
    yield from _wait(control, PAUSE_S)
    start, begun = control.position(name), control.now_ns
    impulse = share = moved = 0.0
    velocities: list[float] = []
    efforts: list[float] = []
    while abs(moved) < far and control.now_ns - begun < 1e9 * GROW_S:
        share = MAX_SHARE * max(control.now_ns - begun, 0) / (1e9 * GROW_S)
        control.push(name, way * share * axis.effort_limit)
        yield
        impulse += share * axis.effort_limit * period
        moved = control.position(name) - start
        seen = control.witness(name)
        velocities.append(way * seen[0])
        efforts.append(way * seen[1])
    travel = abs(moved)
    # Effort against the push, whatever the sign of what is measured; no longer than the push took.
    first = control.velocity(name)
    fastest = abs(first)
    while impulse > 0.0:
        control.push(name, -way * share * axis.effort_limit)
        yield
        impulse -= share * axis.effort_limit * period
        travel = max(travel, abs(control.position(name) - start))
        velocity = control.velocity(name)
        fastest = max(fastest, abs(velocity))
        if velocity * first <= 0.0 or abs(velocity) < AT_REST * fastest:
            break
    control.push(name, 0.0)
    yield
    return Pushed(way * moved, _last(velocities), _mean(efforts), share, travel)


def _last(values: Sequence[float]) -> float:
    """Return the mean of the last readings, NaN without one."""
    return _mean([value for value in values if math.isfinite(value)][-3:])


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else math.nan


def _wait(control: GuidedControl, seconds: float) -> Generator[None, None, None]:
    until = control.now_ns + 1e9 * seconds
    while control.now_ns < until:
        yield
