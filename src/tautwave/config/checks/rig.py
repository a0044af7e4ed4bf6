"""Cross-checks between the keys of a rig file: devices and coupling."""

from __future__ import annotations

import math
from typing import Any

from tautwave import registry
from tautwave.config.checks.arms import check_arms
from tautwave.config.checks.link import check_link
from tautwave.config.checks.operate import check_operate
from tautwave.config.checks.simulation import check_simulation
from tautwave.config.checks.sites import check_sites
from tautwave.config.hooks import hooks_of
from tautwave.config.keys.coupling import Pair, Wall
from tautwave.config.keys.devices import Axis, Compensation
from tautwave.config.keys.rig import Rig
from tautwave.config.pieces import SIDES, Parts
from tautwave.config.text.document import Document, nearest, show_path, show_value
from tautwave.contracts import CouplingPlugin, DriverPlugin

HARDWARE_LIMITS = ("effort_rate_limit", "velocity_limit", "position_range")


def check_parts(document: Document, parts: Parts) -> None:
    """Note keys that are valid on their own but do not fit the others."""
    _check_timing(document, parts)
    _check_buses(document, parts)
    _check_ids(document, parts)
    for side, name, axis in parts.axes():
        _check_axis(document, parts, side, name, axis)
    _check_presence(document)
    hooks = hooks_of(document)
    if hooks is not None:
        hooks.check(document, parts)
    _check_coupling(document, parts)
    check_link(document, parts, _law(parts))
    _check_names(document, parts)
    for name, pair in (parts.pairs or {}).items():
        if pair is not None:
            _check_pair(document, parts, name, pair)
    check_arms(document, parts)
    check_operate(document, parts)
    check_simulation(document, parts)
    check_sites(document, parts, _law(parts))


def _check_presence(document: Document) -> None:
    """Note a rig that has neither scene nor slave, or both."""
    value = document.value
    if value.get("scene") is not None:
        for key in ("slave", "coupling"):
            if key in value:
                document.report(
                    (key,), "not allowed in a rig with a scene; remove this block or the scene"
                )
        return
    unknown = [str(key) for key in value if key not in Rig.model_fields]
    for key in ("slave", "coupling"):
        misspelt = any(nearest(word, [key]) for word in unknown)
        if key not in value and not misspelt:
            document.report((key,), "required key is missing")


def _check_timing(document: Document, parts: Parts) -> None:
    if parts.rate_hz and parts.duration_s and parts.duration_s * parts.rate_hz < 1.0:
        document.report(
            ("duration_s",),
            f"shorter than one cycle of {1.0 / parts.rate_hz:g} s (got {parts.duration_s:g})",
        )


def _check_buses(document: Document, parts: Parts) -> None:
    if not parts.buses:
        return
    used: set[Any] = set()
    for side, axes in parts.sides.items():
        for name in axes:
            path = (side, "axes", name, "bus")
            bus = document.get(path)
            used.add(bus if isinstance(bus, str) else None)
            if isinstance(bus, str) and bus not in parts.buses:
                known = ", ".join(parts.buses)
                hint = nearest(bus, list(parts.buses)) or "."
                document.report(path, f"unknown bus {bus!r}{hint} Buses: {known}")
    scene = document.get(("scene",)) is not None
    if scene and document.get(("loop", "engine")) == "compiled":
        document.report(
            ("loop", "engine"), "applies to couplings only; for a scene use scene.engine"
        )
    sides = 1 if scene else len(SIDES)
    whole = len(parts.sides) == sides and used <= set(parts.buses)
    for name, bus in parts.buses.items():
        if whole and name not in used:
            document.report(("buses", name), "no axis uses this bus; remove it")
        if bus is not None and bus.divisor > 1:
            _check_divisor(document, parts, name, bus.divisor)


def _check_divisor(document: Document, parts: Parts, name: str, divisor: int) -> None:
    path = ("buses", name, "divisor")
    part = _law(parts)
    if part is not None and not part.divisors:
        document.report(
            path,
            f"{_word(parts)} needs both sides at the same rate; use law wave, or remove this and "
            f"lower rate_hz (got {divisor})",
        )
    rate = parts.rate_hz
    if rate is not None and divisor * round(1e9 / rate) != round(1e9 * divisor / rate):
        # The loop's grid and the bus' would drift apart.
        document.report(
            path,
            f"rate_hz: {rate!r} has no period in whole ns, so {divisor} of them are not one period "
            "of the bus; use a rounder rate",
        )


def _check_ids(document: Document, parts: Parts) -> None:
    seen: dict[tuple[str, int], tuple[str, ...]] = {}
    for side, axes in parts.sides.items():
        for name in axes:
            path = (side, "axes", name)
            bus, number = document.get((*path, "bus")), document.get((*path, "id"))
            if not isinstance(bus, str) or type(number) is not int:
                continue
            first = seen.setdefault((bus, number), path)
            if first != path:
                document.report(
                    (*path, "id"),
                    f"id {number} on bus {bus!r} is taken by {show_path(first)} "
                    f"({document.where((*first, 'id'))})",
                )


def _law(parts: Parts) -> CouplingPlugin | None:
    """Return what the law declares, None if it is invalid."""
    return None if parts.coupling is None else registry.load_coupling(parts.coupling.law)


def _word(parts: Parts) -> str:
    return "" if parts.coupling is None else f"law {parts.coupling.law}"


def _check_axis(document: Document, parts: Parts, side: str, name: str, axis: Axis) -> None:
    path = (side, "axes", name)
    part = _law(parts)
    if part is not None and axis.causality not in part.causalities:
        takes = "effort" if axis.causality == "admittance" else "velocity"
        kind = " or ".join(part.causalities)
        document.report(
            (*path, "causality"),
            f"{_word(parts)} drives axes that take {takes} only; use law wave, or an {kind} axis",
        )
    if part is not None and part.observes and axis.velocity_filter_s > 0.0:
        _check_filter(document, parts, side, name, axis)
    if axis.position_noise_autocorrelation and axis.position_noise == 0.0:
        document.report(
            (*path, "position_noise_autocorrelation"),
            "needs a nonzero position_noise; give it, or remove this",
        )
    if axis.causality == "impedance":
        _check_effort_step(document, parts, path, axis)
        if axis.inertia is None:
            document.report((*path, "inertia"), "required key is missing (impedance axis)")
        if axis.environment_stiffness_upper is not None:
            document.report(
                (*path, "environment_stiffness_upper"), "only for admittance axes; remove it"
            )
        if axis.compensation is not None and document.get(("scene",)) is not None:
            document.report(
                (*path, "compensation"),
                "acts beside a coupling, and a rig with a scene has none; remove it",
            )
        elif axis.compensation is not None:
            _check_spending(document, (*path, "compensation"), axis, axis.compensation)
        if axis.follower is not None:
            document.report(
                (*path, "follower"), "only for admittance axes; make it causality: admittance"
            )
    else:
        if axis.inertia is not None:
            document.report((*path, "inertia"), "not used by an admittance axis; remove it")
        if axis.compensation is not None:
            document.report((*path, "compensation"), "only for impedance axes; remove it")
        if axis.effort_sensor is not None:
            document.report(
                (*path, "effort_sensor"),
                "a velocity-controlled axis measures effort anyway; remove it",
            )
        for key in ("damping", "coulomb"):
            if getattr(axis, key).value > 0.0:
                document.report((*path, key), "not used by an admittance axis; remove it")
        if axis.velocity_limit is None:
            # Its command is a velocity: without a limit there is nothing for the ramps to scale.
            document.report((*path, "velocity_limit"), "required key is missing (admittance axis)")
    _check_stall(document, parts, path, axis)
    plugin = parts.plugins.get(axis.bus)
    if axis.follower is not None:
        _check_follower(document, path, axis, plugin)
    if plugin is not None and plugin.hardware:
        for key in HARDWARE_LIMITS:
            if getattr(axis, key) is None:
                document.report(
                    (*path, key),
                    f"required key is missing (bus {axis.bus!r} moves motors, so every limit is "
                    "required)",
                )


def _check_stall(document: Document, parts: Parts, path: tuple[str, ...], axis: Axis) -> None:
    """Refuse end stops inside of the range, and a bound on the effort where it means nothing."""
    if axis.mechanical_range is not None and axis.position_range is not None:
        (low, high), (least, most) = axis.mechanical_range, axis.position_range
        if least < low or most > high:
            document.report(
                (*path, "mechanical_range"),
                f"its end stops are inside position_range [{least:g}, {most:g}]; measure them, or "
                "narrow that",
            )
    if axis.stall_energy_j is None:
        return
    part, key = _law(parts), (*path, "stall_energy_j")
    if axis.causality != "impedance":
        document.report(key, "only for impedance axes; remove it")
    elif axis.velocity_limit is None:
        document.report(key, "needs velocity_limit, for which the bound is computed; give it")
    elif part is None:
        document.report(key, "only beside a coupling, and a rig with a scene has none; remove it")
    elif not part.claim and parts.coupling is not None and parts.coupling.account is None:
        document.report(
            key,
            f"{_word(parts)} relies on the efforts that it asks for; give it coupling.account, or "
            "remove this",
        )


def _check_spending(
    document: Document, path: tuple[str, ...], axis: Axis, keys: Compensation
) -> None:
    """Refuse friction that is spent twice, and inertia that nothing bounds."""
    both = keys.coulomb + keys.inertia_coulomb
    if both > 1.0:
        document.report(
            (*path, "inertia_coulomb"),
            f"exceeds coulomb.lower: together with coulomb it uses {both:g} times that; their sum "
            "must be at most 1",
        )
    if keys.inertia > 0.0 and axis.velocity_limit is None:
        document.report(
            (*path, "inertia"),
            "without velocity_limit its energy output is unbounded; give velocity_limit",
        )


def _check_follower(
    document: Document, path: tuple[str, ...], axis: Axis, plugin: DriverPlugin | None
) -> None:
    """Refuse what is not for an axis whose device takes positions."""
    if plugin is not None and not plugin.positions:
        document.report(
            (*path, "follower"),
            f"the driver of bus {axis.bus!r} does not command positions; use a velocity- or "
            "effort-controlled device there, or put this one on a bus whose driver does "
            "(loopback, dynamixel)",
        )
    assert axis.follower is not None
    if axis.follower.stiffness * axis.encoder_quantum > axis.effort_limit:
        document.report(
            (*path, "follower", "stiffness"),
            "one encoder step would exceed effort_limit, so the goal could not leave the device; "
            f"use at most {axis.effort_limit / axis.encoder_quantum:.3g}",
        )
    if axis.environment_stiffness_upper is not None:
        document.report(
            (*path, "environment_stiffness_upper"),
            "the follower's own spring is in series with the environment; remove it",
        )
    for key in ("effort_quantum", "velocity_quantum"):
        if getattr(axis, key) > 0.0:
            document.report(
                (*path, key), "a follower neither measures effort nor takes velocity; remove it"
            )


def _check_effort_step(document: Document, parts: Parts, path: tuple[str, ...], axis: Axis) -> None:
    """Refuse steps of the effort that no command could ever take."""
    step, limit, bus = axis.effort_quantum, axis.effort_limit, parts.buses.get(axis.bus)
    if step >= limit:
        document.report(
            (*path, "effort_quantum"),
            f"must be below effort_limit {limit:g}, or every effort would be 0 (got {step:g})",
        )
    elif axis.effort_rate_limit is not None and bus is not None and parts.rate_hz is not None:
        rate = parts.rate_hz / bus.divisor
        if axis.effort_rate_limit < step * rate:
            document.report(
                (*path, "effort_rate_limit"),
                f"allows less than one effort_quantum ({step:g}) per period, so the effort would "
                f"stay 0; give {step * rate:.4g} or more (got {axis.effort_rate_limit:g})",
            )


def _check_filter(document: Document, parts: Parts, side: str, name: str, axis: Axis) -> None:
    """Note a velocity filter that nothing uses."""
    pair = (parts.pairs or {}).get(name)
    wall = None if pair is None else getattr(pair, f"wall_{side}")
    reads = wall is not None and (wall.damping > 0.0 or wall.passivity_control)
    if reads and axis.causality == "impedance":
        return
    document.report(
        (side, "axes", name, "velocity_filter_s"),
        f"not used here: the ports of {_word(parts)} observe the velocity themselves, "
        f"see coupling.pairs.{name}.pole_{side}; remove it",
    )


def _check_coupling(document: Document, parts: Parts) -> None:
    coupling, rate = parts.coupling, parts.rate_hz
    if parts.pairs is not None and not parts.pairs:
        document.report(("coupling", "pairs"), "at least one pair is required")
    if coupling is None:
        return
    if rate is None:
        return
    for key, text in coupling.problems(rate):
        document.report(("coupling", key), text)
    samples = coupling.delay_s * rate
    if abs(samples - round(samples)) > 1e-6:
        low, high = math.floor(samples) / rate, math.ceil(samples) / rate
        document.report(
            ("coupling", "delay_s"),
            f"must be a whole number of samples at {rate:g} Hz; nearest: {low:.12g} or "
            f"{high:.12g} (got {show_value(coupling.delay_s)})",
        )


def _check_names(document: Document, parts: Parts) -> None:
    """Note pairs that lack an axis, and axes that lack a pair."""
    if not parts.pairs or len(parts.sides) < len(SIDES):
        return
    for name in parts.pairs:
        lacking = [side for side in SIDES if name not in parts.sides[side]]
        if lacking:
            known = list(dict.fromkeys(axis for side in lacking for axis in parts.sides[side]))
            document.report(
                ("coupling", "pairs", name),
                f"there is no {' and no '.join(lacking)} axis {name!r}"
                f"{nearest(name, known) or '.'} Axes: {', '.join(known) or 'none'}",
            )
    for side in SIDES:
        for name in parts.sides[side]:
            if name not in parts.pairs and not _meant_by_a_pair(parts, side, name):
                document.report(
                    (side, "axes", name),
                    f"not coupled; add coupling.pairs.{name} or remove the axis",
                )


def _meant_by_a_pair(parts: Parts, side: str, name: str) -> bool:
    """Return whether the message about a pair without an axis already suggested this one."""
    lacking = [pair for pair in parts.pairs or {} if pair not in parts.sides[side]]
    return any(repr(name) in nearest(pair, list(parts.sides[side])) for pair in lacking)


def _check_pair(document: Document, parts: Parts, name: str, pair: Pair) -> None:
    path = ("coupling", "pairs", name)
    for key, text in () if parts.rate_hz is None else pair.problems(parts.rate_hz):
        document.report((*path, key), text)
    master, slave = parts.axis("master", name), parts.axis("slave", name)
    if (
        master is not None
        and slave is not None
        and master.kind != slave.kind
        and "position_scale" not in pair.model_fields_set
    ):
        units = {"rotary": "rad", "linear": "m"}
        document.report(
            (*path, "position_scale"),
            f"required key is missing: {master.kind} master, {slave.kind} slave "
            f"[{units[slave.kind]}/{units[master.kind]}]",
        )
    if pair.offset != "at_engage" and pair.engage_tolerance is None:
        document.report(
            (*path, "engage_tolerance"), "required key is missing when offset is a number"
        )
    for side, axis, wall in (
        ("master", master, pair.wall_master),
        ("slave", slave, pair.wall_slave),
    ):
        if axis is not None and wall is not None:
            _check_wall(document, name, side, axis, wall)


def _check_wall(document: Document, name: str, side: str, axis: Axis, wall: Wall) -> None:
    if wall.derate and axis.causality == "admittance":
        document.report(
            ("coupling", "pairs", name, f"wall_{side}", "derate"),
            f"no stiffness can be certified on an admittance axis ({side}.axes.{name}); remove it",
        )
    if axis.position_range is None:
        return
    lowest, highest = axis.position_range
    if not lowest <= wall.position <= highest:
        document.report(
            ("coupling", "pairs", name, f"wall_{side}", "position"),
            f"should be inside position_range [{lowest:g}, {highest:g}] of {side}.axes.{name} "
            f"(got {wall.position:g})",
        )
