"""Elements that a rig uses and leaves out, with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from tautwave.config import Axis, EnvironmentPart, Hand, HandPart, Rig, Wall
from tautwave.config import Pair as PairKeys
from tautwave.registry import driver_names
from tautwave.session.facts import coupling_messages
from tautwave.session.hooks import session_hooks
from tautwave.session.network import network_words, receiver_words

if TYPE_CHECKING:
    from tautwave.summary.model import Unused

NOT_IN_RIG = "not in the rig"


class PlanItem(NamedTuple):
    """One element: `state` is `in` or `left out`, `reason` says why."""

    element: str
    state: str
    reason: str


def rig_plan(rig: Rig, *, clock: str = "real") -> list[PlanItem]:
    """Return every element the framework knows for this rig, in or left out."""
    items = list(_coupling(rig) if rig.scene is None else _scene(rig))
    for name, keys in rig.coupling.pairs.items():
        items.extend(_pair(rig, name, keys))
    for name, axis in rig.own_axes.items():
        items.extend(_axis(rig, name, axis))
    items.extend(_simulation(rig, clock))
    used = {bus.driver for bus in rig.own_buses.values()}
    items.extend(
        _item(f"driver {name}", name in used, "a bus uses it", "no bus uses it")
        for name in driver_names()
    )
    return items


def left_out(plan: list[PlanItem]) -> tuple[Unused, ...]:
    """Return the left-out elements for the summary."""
    from tautwave.summary.model import Unused  # forty models that a check has no use for

    return tuple(
        Unused(element=item.element, reason=item.reason)
        for item in plan
        if item.state == "left out"
    )


def _item(element: str, used: bool, why: str, why_not: str = NOT_IN_RIG) -> PlanItem:
    return PlanItem(element, "in" if used else "left out", why if used else why_not)


def _coupling(rig: Rig) -> Iterator[PlanItem]:
    keys = rig.coupling
    samples = rig.delay_samples
    yield _item("delay line", samples > 0, f"{samples} samples each way", "no delay")
    if rig.link is not None:
        yield _item("network", True, network_words(rig))
        yield _item("receivers", True, receiver_words(rig))
    yield from (_item(*line) for line in coupling_messages(rig).plan(rig))
    yield _item("engage ramp", keys.engage_ramp_s > 0, f"{keys.engage_ramp_s:g} s", "its time is 0")
    yield _item(
        "release ramp", keys.release_ramp_s > 0, f"{keys.release_ramp_s:g} s", "its time is 0"
    )


def _scene(rig: Rig) -> Iterator[PlanItem]:
    yield from (_item(*line) for line in session_hooks().plan(rig))


def _pair(rig: Rig, name: str, keys: PairKeys) -> Iterator[PlanItem]:
    power = keys.effective_force_scale * keys.position_scale
    scaled = keys.position_scale != 1.0 or keys.sign != 1 or abs(power - 1.0) > 1e-12
    what = f"slave = {keys.sign * keys.position_scale:g} x master"
    if abs(power - 1.0) > 1e-12:
        what += f", power ratio {power:g}"
    yield _item(f"scaling of {name}", scaled, what, "scale 1, sign 1")
    yield from (_item(*line) for line in coupling_messages(rig).pair_plan(rig, name))
    for side, wall in (("master", keys.wall_master), ("slave", keys.wall_slave)):
        yield _item(f"wall of {side}.{name}", wall is not None, _wall(wall))
        if wall is not None:
            yield _item(
                f"passivity control of the wall of {side}.{name}",
                wall.passivity_control,
                "energy observer and controller",
            )


def _wall(wall: Wall | None) -> str:
    if wall is None:
        return ""
    return f"K {wall.stiffness:g}, B {wall.damping:g}, {wall.side} {wall.position:g}"


def _hand(hand: Hand | HandPart | None) -> str:
    if isinstance(hand, HandPart):
        return f"part {hand.part}"
    return "" if hand is None else hand.reference.type


def _axis(rig: Rig, name: str, axis: Axis) -> Iterator[PlanItem]:
    yield _item(
        f"effort rate limit of {name}",
        axis.effort_rate_limit is not None,
        f"{axis.effort_rate_limit} per s",
    )
    yield _item(
        f"velocity limit of {name}", axis.velocity_limit is not None, f"{axis.velocity_limit}"
    )
    yield _item(
        f"position range of {name}", axis.position_range is not None, f"{axis.position_range}"
    )
    filtered = axis.velocity_filter_s > 0.0
    yield _item(f"velocity filter of {name}", filtered, f"{axis.velocity_filter_s:g} s")


def _simulation(rig: Rig, clock: str) -> Iterator[PlanItem]:
    simulation = rig.simulation
    yield _item("simulation", simulation is not None, "devices, hand and environment are simulated")
    if simulation is None:
        return
    for name in rig.coupling.pairs or rig.master.axes:
        hand = simulation.hand.get(name)
        yield _item(f"hand on master.{name}", hand is not None, _hand(hand))
        if rig.scene is not None:
            continue
        environment = simulation.environment.get(name)
        kind = "free"
        if isinstance(environment, EnvironmentPart):
            kind = f"part {environment.part}, runs in Python: simulate and sweep do not compile it"
        elif environment is not None:
            kind = environment.type
        yield _item(f"environment of slave.{name}", kind != "free", kind, "free")
    keys = simulation.integrator
    if keys is not None:
        from tautwave.rig.truth import axis_integration

        for name, axis in rig.axes.items():
            part = isinstance(simulation.environment.get(name.split(".")[1]), EnvironmentPart)
            if axis.causality == "impedance" and not (part and name.startswith("slave.")):
                made = axis_integration(rig, name)
                yield _item(f"integrator of {name}", True, made.why)
    faults = simulation.faults
    missing = faults.missing_probability
    yield _item("missing samples", missing > 0.0, f"probability {missing:g}")
    overruns = faults.overrun_probability
    why_not = NOT_IN_RIG
    if overruns > 0.0 and clock == "real":
        why_not = "on the real clock only real overruns occur"
    yield _item(
        "seeded overruns",
        overruns > 0.0 and clock == "fake",
        f"probability {overruns:g}, {faults.overrun_slots} slots",
        why_not,
    )
