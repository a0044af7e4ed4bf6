"""The motion check: a small known effort both ways against the signs of all that a device reports.

What is commanded, the position, and velocity and motor effort where the device measures them, must
agree. A drive whose positions alone are turned would make a coupling push away from its goal. An
axis that takes velocity is driven instead, and goes as far as commanded if its units are right.
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

DRIVE_S, RAMP_S = 0.5, 0.1
"""How long an axis that takes velocity is driven one way, and how fast its velocity changes."""
MAX_SPEED = 0.1
"""Of the velocity limit at most."""
SCALE_ERROR = 0.2
"""By how much the way may differ from the commanded one, beside encoder steps and noise."""


class Driven(NamedTuple):
    """A motion at a commanded velocity: the way commanded and gone, both along it [rad or m].

    `velocity` is what the device reported of its own [rad/s or m/s], NaN if it does not; `travel`
    the farthest from the start.
    """

    commanded: float
    moved: float
    velocity: float
    travel: float


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
    """Push or drive each axis both ways by at most 5 degrees (5 mm), and compare all signs."""
    yield from control.ask(
        "each axis is moved both ways by a degree or two (1 mm), with at most "
        f"{MAX_SHARE:g} of its effort limit or {MAX_SPEED:g} of its velocity limit; keep clear, "
        "then press Enter"
    )
    checks = []
    for name in axes:
        axis = rig.axes[name]
        for way, word in ((1.0, "forward"), (-1.0, "back")):
            if axis.causality == "impedance":
                pushed = yield from push(axis, name, way, control)
                checks.append(judged(f"{name} {word}", pushed, axis))
            else:
                driven = yield from drive(axis, name, way, control)
                checks.append(judged_drive(f"{name} {word}", driven, axis))
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


def judged_drive(what: str, driven: Driven, axis: Axis) -> Check:
    """Return whether an axis went the way of its commanded velocity, and as far."""
    ratio = driven.moved / driven.commanded
    numbers: dict[str, float | str] = {
        "commanded": driven.commanded, "moved": driven.moved, "ratio": ratio
    }  # fmt: skip
    wrong = [] if driven.moved > 0.0 else ["position"]
    if math.isfinite(driven.velocity):
        numbers["velocity"] = driven.velocity
        wrong += ["velocity"] if driven.velocity <= 0.0 else []
    if driven.travel > TOO_FAR[axis.kind]:
        wrong.append("travel")
    if wrong:
        numbers["against the command"] = ", ".join(wrong)
    allowed = SCALE_ERROR + STEPS_SEEN * _step_of(axis) / driven.commanded
    return Check("motion", what, numbers, f"all along the command, ratio 1 within {allowed:.2g}",
                 not wrong and abs(ratio - 1.0) <= allowed)  # fmt: skip


def _step_of(axis: Axis) -> float:
    return max(axis.encoder_quantum, axis.position_noise)


def drive(
    axis: Axis, name: str, way: float, control: GuidedControl
) -> Generator[None, None, Driven]:
    """Command a small velocity until it should have gone far enough, or has gone too far."""
    period = 1e-9 * control.run.period_ns
    most = TOO_FAR[axis.kind]
    far = min(max(FAR[axis.kind], 5.0 * STEPS_SEEN * _step_of(axis)), 0.5 * most)
    speed = min(MAX_SPEED * (axis.velocity_limit or math.inf), far / DRIVE_S)
    yield from _wait(control, PAUSE_S)
    start = control.position(name)
    now = commanded = travel = 0.0
    velocities: list[float] = []
    going = True
    while going or now > 0.0:
        going = going and commanded < far
        change = speed * period / RAMP_S
        now = min(speed, now + change) if going else max(0.0, now - change)
        if travel > 0.5 * most:  # it goes farther than it was commanded: no ramp
            now, going = 0.0, False
        control.drive(name, way * now)
        yield
        commanded += now * period
        travel = max(travel, abs(control.position(name) - start))
        if now == speed:
            velocities.append(way * control.witness(name)[0])
    yield from _wait(control, PAUSE_S)
    moved = way * (control.position(name) - start)
    return Driven(commanded, moved, _last(velocities), max(travel, abs(moved)))


def push(
    axis: Axis, name: str, way: float, control: GuidedControl, most: float = MAX_SHARE
) -> Generator[None, None, Pushed]:
    """Push with an effort that grows until the axis has moved, then take the impulse back.

    `most` is the greatest share of the effort limit.
    """
    period = 1e-9 * control.run.period_ns
    far = max(FAR[axis.kind], STEPS_SEEN * _step_of(axis))
    yield from _wait(control, PAUSE_S)
    start, begun = control.position(name), control.now_ns
    impulse = share = moved = 0.0
    velocities: list[float] = []
    efforts: list[float] = []
    while abs(moved) < far and control.now_ns - begun < 1e9 * GROW_S:
        share = most * max(control.now_ns - begun, 0) / (1e9 * GROW_S)
        control.push(name, way * share * axis.effort_limit)
        yield
        impulse += share * axis.effort_limit * period
        moved = control.position(name) - start
        seen = control.witness(name)
        velocities.append(way * seen[0])
        efforts.append(way * seen[1])
    travel = abs(moved)
    farthest = yield from take_back(name, way * share * axis.effort_limit, impulse, start, control)
    travel = max(travel, farthest)
    return Pushed(way * moved, _last(velocities), _mean(efforts), share, travel)


def take_back(
    name: str, effort: float, impulse: float, start: float, control: GuidedControl
) -> Generator[None, None, float]:
    """Brake an axis that was pushed by `effort` [N m or N] with at most the impulse of the push.

    Against the push, whatever the sign of what is measured; no longer than the push took. Returns
    how far it was from `start` meanwhile [rad or m].
    """
    period = 1e-9 * control.run.period_ns
    first = control.velocity(name)
    fastest, farthest = abs(first), 0.0
    while impulse > 0.0:
        control.push(name, -effort)
        yield
        impulse -= abs(effort) * period
        farthest = max(farthest, abs(control.position(name) - start))
        velocity = control.velocity(name)
        fastest = max(fastest, abs(velocity))
        if velocity * first <= 0.0 or abs(velocity) < AT_REST * fastest:
            break
    control.push(name, 0.0)
    yield
    return farthest


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
