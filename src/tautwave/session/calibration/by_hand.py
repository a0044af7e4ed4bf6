"""Zero by a pose, direction and range by hand: no device has torque, a person moves them."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.session.guided.control import GuidedControl

ZERO, DIRECTION, RANGE, IDENTIFY = "zero", "direction", "range", "identify"

STEADY_S = 0.2
"""Over which a pose is averaged."""

LEAST = {"rotary": 0.1, "linear": 0.01}
"""[rad, m] By which a hand has to move an axis."""

MARGIN = 0.02
"""Of a range, which its ends are moved inwards."""


class Measured(NamedTuple):
    """Of one axis, in device coordinates [rad or m]; None: not measured."""

    pose: float | None = None
    direction: int | None = None
    low: float | None = None
    high: float | None = None


Found = dict[str, Measured]
Steps = Generator[None, None, Found]


def measure_by_hand(
    rig: Rig, axes: Sequence[str], steps: Sequence[str], control: GuidedControl
) -> Steps:
    """Measure what the steps ask for, side by side."""
    measured: Found = dict.fromkeys(axes, Measured())
    for side in ("master", "slave"):
        own = [name for name in axes if name.startswith(f"{side}.")]
        if own:
            yield from _side(rig, side, own, steps, control, measured)
    return measured


def _side(
    rig: Rig,
    side: str,
    own: Sequence[str],
    steps: Sequence[str],
    control: GuidedControl,
    found: Found,
) -> Generator[None, None, None]:
    if ZERO in steps or DIRECTION in steps:
        yield from control.ask(
            f"{side}: move {_listed(own)} to the zero pose and hold; then press Enter"
        )
        poses = yield from mean_positions(own, control)
        for name, pose in poses.items():
            found[name] = found[name]._replace(pose=pose)
            control.say(f"  {name}: {pose:+.4f} {_unit(rig, name)} in device coordinates")
    if DIRECTION in steps:
        for at, name in enumerate(own):
            # What was shown before may be on its way back.
            yield from _direction(rig, name, own[at:], control, found)
    if RANGE in steps:
        yield from _ranges(rig, side, own, control, found)


def mean_positions(
    names: Sequence[str], control: GuidedControl
) -> Generator[None, None, Mapping[str, float]]:
    """Return where axes are, averaged over a moment [rad or m]."""
    slots = max(1, round(STEADY_S * 1e9 / control.run.period_ns))
    sums = dict.fromkeys(names, 0.0)
    for _ in range(slots):
        yield
        for name in names:
            sums[name] += control.position(name)
    return {name: total / slots for name, total in sums.items()}


def _direction(
    rig: Rig, name: str, own: Sequence[str], control: GuidedControl, found: Found
) -> Generator[None, None, None]:
    """Ask until the axis that was asked for has moved, and more than any other."""
    least = {one: LEAST[rig.axes[one].kind] for one in own}
    before = yield from mean_positions(own, control)
    why = ""
    while True:
        yield from control.ask(
            f"{why}{name}: move it in its positive direction and hold; then press Enter"
        )
        now = yield from mean_positions(own, control)
        moved = {one: now[one] - before[one] for one in own}
        most = max(own, key=lambda one: abs(moved[one]) / least[one])
        if abs(moved[most]) < least[most]:
            why = f"nothing moved by at least {least[name]:g} {_unit(rig, name)}; try again: "
        elif most != name:
            why = f"that was {most}; try again: "
        else:
            break
    direction = 1 if moved[name] > 0.0 else -1
    found[name] = found[name]._replace(direction=direction)
    words = "as its device counts" if direction > 0 else "opposite to its device's counting"
    control.say(f"  {name}: moved by {moved[name]:+.4f} {_unit(rig, name)}, so positive is {words}")


def _ranges(
    rig: Rig, side: str, own: Sequence[str], control: GuidedControl, found: Found
) -> Generator[None, None, None]:
    ends = {name: [control.position(name)] * 2 for name in own}
    wide = max(map(len, own))

    def numbers() -> str:
        return "\n".join(
            f"  {name:<{wide}}  {low:+.3f} to {high:+.3f} {_unit(rig, name)}, "
            f"now {control.position(name):+.3f}"
            for name, (low, high) in ends.items()
        )

    why = ""
    while True:
        question = (
            f"{why}{side}: move {_listed(own)} to both ends of the allowed range; then press Enter"
        )
        for _ in control.ask(question):
            for name, pair in ends.items():
                at = control.position(name)
                pair[0], pair[1] = min(pair[0], at), max(pair[1], at)
            control.show(numbers)
            yield
        short = [name for name, (a, b) in ends.items() if b - a < LEAST[rig.axes[name].kind]]
        if not short:
            break
        why = f"{_listed(short)} hardly moved; "
    for name, (low, high) in ends.items():
        margin = MARGIN * (high - low)
        low, high = low + margin, high - margin
        found[name] = found[name]._replace(low=low, high=high)
        control.say(f"  {name}: {low:+.4f} to {high:+.4f} {_unit(rig, name)} in device coordinates")


def _listed(names: Sequence[str]) -> str:
    """Return axes of one side without it."""
    return ", ".join(name.partition(".")[2] for name in names)


def _unit(rig: Rig, name: str) -> str:
    return "rad" if rig.axes[name].kind == "rotary" else "m"
