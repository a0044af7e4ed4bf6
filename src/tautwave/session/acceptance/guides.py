"""The stages of an acceptance in which a person acts, in rising risk."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence

from tautwave.config import Axis, Rig
from tautwave.session.acceptance.document import Check
from tautwave.session.acceptance.motion import take_back
from tautwave.session.acceptance.sensors import rest_now, sensor_checks
from tautwave.session.calibration.by_hand import LEAST, mean_positions
from tautwave.session.guided.answers import number
from tautwave.session.guided.control import GuidedControl

SCALE_ERROR = 0.05
REST_S = 2.0
NOISE_STEPS = 2.0
"""Standard deviation at rest that is allowed, in encoder steps or declared noise."""

STEP_SHARES, STEP_S, PAUSE_S = (0.1, 0.2, 0.4), 0.06, 0.5
BRAKED = 0.5
"""Of the impulse of a step, taken back: friction takes some, and the bus may be slow."""
STEP_SEEN = 4.0
"""Encoder steps by which a device has to have moved to have answered."""

EFFORT_SHARES = (0.1, 0.2)
EFFORT_ERROR = 0.2
SETTLE_S = 1.0
BACK_S = 0.2
DEGREES = ["degrees", "degree", "deg", "°"]

Checks = Generator[None, None, list[Check]]


def sign_and_scale(rig: Rig, axes: Sequence[str], control: GuidedControl) -> Checks:
    """Positive is positive, and a known angle is that angle; no torque."""
    checks = []
    for name in axes:
        unit = _unit(rig, name)
        before = yield from mean_positions([name], control)
        known_as, units = "a known angle and hold it; type it in degrees", DEGREES
        if unit == "m":
            known_as, units = "a known distance and hold it; type it in mm", ["mm"]
        typed = yield from control.ask(
            f"{name}: move it in the positive direction by {known_as}", number(*units)
        )
        now = yield from mean_positions([name], control)
        moved = now[name] - before[name]
        known = typed * (math.pi / 180.0 if unit == "rad" else 1e-3)
        checks.append(
            Check("sign", name, {f"moved_{unit}": moved}, "positive",
                  moved >= LEAST[rig.axes[name].kind])
        )  # fmt: skip
        ratio = moved / known if known else math.nan
        numbers: dict[str, float | str] = {
            f"moved_{unit}": moved, f"known_{unit}": known, "ratio": ratio
        }  # fmt: skip
        good = abs(ratio - 1.0) <= SCALE_ERROR
        checks.append(Check("scale", name, numbers, f"1 within {SCALE_ERROR:g}", good))
    return checks


def ranges(rig: Rig, axes: Sequence[str], control: GuidedControl) -> Checks:
    """The position range of the rig is inside what the device can reach; no torque."""
    ends = {name: [control.position(name)] * 2 for name in axes}
    for _ in control.ask("move every axis to both ends of its position_range; then press Enter"):
        for name, pair in ends.items():
            at = control.position(name)
            pair[0], pair[1] = min(pair[0], at), max(pair[1], at)
        yield
    checks = []
    for name, (low, high) in ends.items():
        allowed = rig.axes[name].position_range or (-math.inf, math.inf)
        slack = 0.05 * (allowed[1] - allowed[0]) if math.isfinite(allowed[1]) else 0.0
        good = low <= allowed[0] + slack and high >= allowed[1] - slack
        numbers: dict[str, float | str] = {"lowest": low, "highest": high}
        expected = f"reaches {allowed[0]:.4g} to {allowed[1]:.4g}"
        checks.append(Check("limits", name, numbers, expected, good))
    return checks


def noise(rig: Rig, axes: Sequence[str], control: GuidedControl) -> Checks:
    """Devices that stand still are as quiet as the rig states; torque is on, without effort."""
    yield from control.ask(
        "the drives are enabled with zero effort: take your hands off, then press Enter"
    )
    slots = max(2, round(REST_S * 1e9 / control.run.period_ns))
    kept: dict[str, list[float]] = {name: [] for name in axes}
    for _ in range(slots):
        yield
        for name in axes:
            kept[name].append(control.position(name))
    checks = []
    for name in axes:
        rests = yield from rest_now(rig, name, 0.0, control)
        checks += sensor_checks(rig, name, "noise", rests)
    for name, values in kept.items():
        mean = sum(values) / len(values)
        spread = math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))
        axis = rig.axes[name]
        most = NOISE_STEPS * max(axis.encoder_quantum, axis.position_noise)
        numbers: dict[str, float | str] = {"deviation": spread, "drift": values[-1] - values[0]}
        checks.append(Check("noise", name, numbers, f"at most {most:.3g}", spread <= most))
    return checks


def delays(rig: Rig, axes: Sequence[str], control: GuidedControl) -> Checks:
    """A small step of effort moves the device its way, soon enough; dry friction gets more."""
    yield from control.ask(
        f"each axis gets a tenth of its effort limit until it answers, at most for {STEP_S:g} s, "
        f"and up to {STEP_SHARES[-1]:g} of it if it does not move; keep clear, then press Enter"
    )
    checks = []
    for name in axes:
        if rig.axes[name].causality != "impedance":
            continue
        numbers: dict[str, float | str] = {}
        for share in STEP_SHARES:
            seen, moved = yield from _step(rig.axes[name], name, share, control)
            numbers = {"share": share, "answered_after_s": seen, "moved": moved}
            if math.isfinite(seen):
                break
        checks.append(Check("delay", name, numbers, "moves the positive way", moved > 0.0))
    return checks


def _step(
    axis: Axis, name: str, share: float, control: GuidedControl
) -> Generator[None, None, tuple[float, float]]:
    """Give an axis a step until it answers; return when [s], NaN if never, and how far it was."""
    yield from _wait(control, PAUSE_S)
    start, begun, effort = control.position(name), control.now_ns, share * axis.effort_limit
    control.push(name, effort)
    seen, answer = math.nan, 0.0
    threshold = STEP_SEEN * max(axis.encoder_quantum, axis.position_noise, 1e-9)
    while control.now_ns - begun < 1e9 * (STEP_S + PAUSE_S):
        yield
        passed_s = (control.now_ns - begun) * 1e-9
        moved = control.position(name) - start
        if math.isnan(seen) and abs(moved) > threshold:
            seen, answer = passed_s, moved
            impulse = BRAKED * effort * min(passed_s, STEP_S)
            yield from take_back(name, effort, impulse, start, control)
        elif passed_s >= STEP_S:
            control.push(name, 0.0)
    return seen, answer


def efforts(rig: Rig, axes: Sequence[str], control: GuidedControl) -> Checks:
    """What a spring scale reads is what was commanded."""
    checks = []
    for name in axes:
        axis = rig.axes[name]
        if axis.causality != "impedance":
            continue
        unit = "N m" if axis.kind == "rotary" else "N"
        rests = []
        for share in EFFORT_SHARES:
            effort = share * axis.effort_limit
            yield from control.ask(
                f"{name}: attach the spring scale and keep clear; press Enter, and it pulls with "
                f"{effort:.3g} {unit}"
            )
            control.push(name, effort)
            yield from _wait(control, SETTLE_S)
            rests += yield from rest_now(rig, name, effort, control)
            read = yield from control.ask(f"{name}: scale reading in {unit}:", number(unit))
            control.push(name, 0.0)
            numbers: dict[str, float | str] = {
                "commanded": effort, "read": read, "ratio": read / effort
            }  # fmt: skip
            good = abs(read / effort - 1.0) <= EFFORT_ERROR
            checks.append(Check("effort", name, numbers, f"1 within {EFFORT_ERROR:g}", good))
        checks += sensor_checks(rig, name, "effort", rests)
    return checks


def unplugging(control: GuidedControl) -> Generator[None, None, None]:
    """Wait for the cable to be pulled: the loss of its devices ends this."""
    for _ in control.ask("the drives are enabled with zero effort: unplug the bus cable now"):
        yield


def coming_back(control: GuidedControl) -> Generator[None, None, None]:
    """Look whether devices are there."""
    yield from _wait(control, BACK_S)


def _wait(control: GuidedControl, seconds: float) -> Generator[None, None, None]:
    until = control.now_ns + 1e9 * seconds
    while control.now_ns < until:
        yield


def _unit(rig: Rig, name: str) -> str:
    return "rad" if rig.axes[name].kind == "rotary" else "m"
