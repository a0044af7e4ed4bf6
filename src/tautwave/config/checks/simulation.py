"""Cross-checks between the keys of a rig file: the simulated truth."""

from __future__ import annotations

from collections.abc import Iterable

from tautwave.config.inputs.recordings import check_recording
from tautwave.config.keys.devices import Axis
from tautwave.config.keys.simulation import (
    AxisSimulation,
    Hand,
    HandPart,
    Intent,
    MinimumJerk,
    Multisine,
    Policy,
    Recorded,
    Recording,
    Reference,
)
from tautwave.config.pieces import SIDES, Parts
from tautwave.config.text.document import Document, nearest
from tautwave.config.text.yaml12 import KeyPath

_IMPEDANCE_ONLY = ("inertia", "damping", "coulomb")
_FOLLOWER_ONLY = ("servo_stiffness", "servo_damping")


def check_simulation(document: Document, parts: Parts) -> None:
    """Note mistakes between `simulation` and the rest of the rig."""
    if not parts.simulated:
        _check_needed(document, parts)
        return
    if len(parts.sides) == len(SIDES):
        _check_axis_names(document, parts)
    if parts.pairs:
        _check_pair_names(document, "hand", parts.hands, list(parts.pairs))
        _check_pair_names(document, "environment", parts.environments, list(parts.pairs))
    for side, name, axis in parts.axes():
        truth = parts.truths.get(f"{side}.{name}", AxisSimulation())
        if truth is not None:
            _check_truth(document, f"{side}.{name}", axis, truth, recorded=_recorded(parts, name))
    for name, hand in parts.hands.items():
        if hand is not None:
            _check_hand(document, parts, name, hand)
    for name, environment in parts.environments.items():
        if isinstance(environment, Recorded):
            path = ("simulation", "environment", name)
            check_recording(document, path, environment, ("effort", "position", "time_column"))


def _check_needed(document: Document, parts: Parts) -> None:
    """Note the first driver without hardware, for which the truth has to be simulated."""
    for bus, plugin in parts.plugins.items():
        if plugin is not None and not plugin.hardware:
            driver = document.get(("buses", bus, "driver"))
            document.report(
                ("buses", bus, "driver"),
                f"driver {driver!r} has no hardware and needs a 'simulation' block; "
                "'simulation: {}' simulates the rig's own parameters",
            )
            return


def _check_axis_names(document: Document, parts: Parts) -> None:
    known = [f"{side}.{name}" for side, axes in parts.sides.items() for name in axes]
    for full in parts.truths:
        side, _, name = full.partition(".")
        if full in known or side not in SIDES or not name:
            continue  # names that are not full names have been reported
        hint = nearest(name, list(parts.sides[side]), f"{side}.") or "."
        document.report(
            ("simulation", "axes", full), f"unknown axis {full!r}{hint} Axes: {', '.join(known)}"
        )


def _check_pair_names(document: Document, key: str, names: Iterable[str], known: list[str]) -> None:
    for name in names:
        if name not in known:
            document.report(
                ("simulation", key, name),
                f"unknown pair {name!r}{nearest(name, known) or '.'} Pairs: {', '.join(known)}",
            )


def _recorded(parts: Parts, name: str) -> bool:
    """Return whether a recording may say where the axes of a pair begin."""
    axes = [parts.axis(side, name) for side in SIDES]
    plugins = [parts.plugins.get(axis.bus) for axis in axes if axis is not None]
    hand = parts.hands.get(name)
    return (
        any(plugin is not None and plugin.imposed is not None for plugin in plugins)
        or isinstance(getattr(hand, "reference", None), Recording | Intent)
        or isinstance(parts.environments.get(name), Recorded)
    )


def _check_truth(
    document: Document, name: str, axis: Axis, truth: AxisSimulation, *, recorded: bool
) -> None:
    path = ("simulation", "axes", name)
    if truth.effort_sensor is not None and axis.effort_sensor is None:
        document.report((*path, "effort_sensor"), "the axis has none; remove it, or state it there")
    if axis.follower is None:
        for key in _FOLLOWER_ONLY:
            if getattr(truth, key) is not None:
                document.report((*path, key), "only for axes with a follower; remove it")
    if axis.follower is not None:
        if truth.inertia is None:
            document.report((*path, "inertia"), "required key is missing (simulated follower)")
        if truth.velocity_time_constant_s is not None:
            document.report(
                (*path, "velocity_time_constant_s"), "not used by a follower; remove it"
            )
    elif axis.causality == "admittance":
        for key in _IMPEDANCE_ONLY:
            if getattr(truth, key) is not None:
                document.report((*path, key), "not used by an admittance axis; remove it")
    elif truth.velocity_time_constant_s is not None:
        document.report(
            (*path, "velocity_time_constant_s"), "not used by an impedance axis; remove it"
        )
    if axis.position_range is not None:
        lowest, highest = axis.position_range
        start = truth.start_position
        if start is None and not recorded:
            start = 0.0
        if start is not None and not lowest <= start <= highest:
            document.report(
                (*path, "start_position"),
                f"should be inside position_range [{lowest:g}, {highest:g}] of {name} "
                f"(got {start:g})",
            )


def _check_hand(document: Document, parts: Parts, name: str, hand: Hand | HandPart) -> None:
    path = ("simulation", "hand", name)
    axis = parts.axis("master", name)
    if axis is not None and axis.kind == "rotary" and hand.lever_arm is None:
        document.report(
            (*path, "lever_arm"),
            "required key is missing: the hand's values are in N and m, the axis is rotary "
            "(1 if they are given in N m and rad)",
        )
    if axis is not None and axis.kind == "linear" and hand.lever_arm is not None:
        document.report((*path, "lever_arm"), "only for rotary axes, this is linear; remove it")
    if isinstance(hand, Hand):
        _check_reference(document, parts, (*path, "reference"), hand.reference)


def _check_reference(document: Document, parts: Parts, path: KeyPath, reference: Reference) -> None:
    if isinstance(reference, MinimumJerk):
        times = [time for time, _ in reference.waypoints]
        for index in range(1, len(times)):
            if times[index] <= times[index - 1]:
                document.report(
                    (*path, "waypoints", index),
                    f"times should increase: {times[index]:g} s comes after {times[index - 1]:g} s",
                )
    elif isinstance(reference, Multisine) and parts.rate_hz is not None:
        axis = parts.axis("master", str(path[2]))
        bus = None if axis is None else parts.buses.get(axis.bus)
        rate = parts.rate_hz / (1 if bus is None else bus.divisor)
        for index, (frequency, _, _) in enumerate(reference.components):
            if frequency >= rate / 2.0:
                document.report(
                    (*path, "components", index),
                    f"should be below half the rate, {rate / 2.0:g} Hz (got {frequency:g})",
                )
    elif isinstance(reference, Recording):
        check_recording(document, path, reference, ("column", "time_column"))
    elif isinstance(reference, Policy) and document.get(("operate",)) is None:
        document.report((*path, "type"), "a policy requires an `operate` block; add operate: {}")
    elif isinstance(reference, Intent):
        check_recording(document, path, reference, ("position", "effort", "time_column"))
