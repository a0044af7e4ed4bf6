"""Cross-checks between the keys of a rig file: arms and their axes."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave import registry
from tautwave.config.inputs.arm_places import ArmPlace, arm_places
from tautwave.config.inputs.chains import chain_links, weighs
from tautwave.config.keys.arm import Arm, Chain
from tautwave.config.keys.devices import Axis
from tautwave.config.keys.load import TrueLoad
from tautwave.config.keys.simulation import Free, SolidWall, Spring
from tautwave.config.messages import salvage
from tautwave.config.pieces import SIDES, Parts
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError
from tautwave.types import UNDO_PAYLOAD

KINDS = {"turns": "rotary", "slides": "linear"}


def check_arms(document: Document, parts: Parts) -> None:
    """Note arms whose chain cannot be read, or does not fit the axes."""
    places = tuple(arm_places(document))
    for place in places:
        _check_arm(document, parts, place, place.path, Arm)
        _check_arm(document, parts, place, place.truth, Chain)
        if parts.simulated:
            _check_simulated(document, parts, place)
        _check_payloads(document, place)
    _check_names(document, places)
    _check_reflected(document, parts, places)
    for side, name, axis in parts.axes():
        if axis.load is not None:
            _check_load(document, parts, side, axis, axis.load, (side, "axes", name, "load"))
        truth = parts.truths.get(f"{side}.{name}")
        if truth is not None and truth.load is not None:
            path = ("simulation", "axes", f"{side}.{name}", "load")
            _check_load(document, parts, side, axis, truth.load, path)


def _check_names(document: Document, places: Sequence[ArmPlace]) -> None:
    """Note axes that are joints of none of a side's several arms, or of two, and spare truths."""
    for side in SIDES:
        own = [place for place in places if place.side == side and place.prefix]
        axes = document.get((side, "axes"))
        for name in axes if own and isinstance(axes, dict) else ():
            arms = [place.prefix for place in own if name in place.axes]
            if len(arms) != 1:
                begin = " or ".join(place.prefix for place in own)
                document.report(
                    (side, "axes", name),
                    f"begins with the names of two arms, {' and '.join(arms)}; rename one of them"
                    if arms
                    else f"is a joint of none of the {side}'s arms; begin its name with {begin}",
                )
    known = {place.name for place in places}
    truths = document.get(("simulation", "arms"))
    for name in truths if isinstance(truths, dict) else ():
        if name not in known and name.partition(".")[0] in SIDES:
            document.report(
                ("simulation", "arms", name),
                f"the rig has no such arm; use {', '.join(sorted(known))}",
            )


def _check_reflected(document: Document, parts: Parts, places: Sequence[ArmPlace]) -> None:
    """Note loads that the hand cannot feel."""
    felt: dict[tuple[str, str], KeyPath] = {}
    for side in SIDES:
        for place in places:
            arm: Arm | None = salvage(Arm, document.get(place.path))
            if place.side == side and arm is not None and arm.reflect_load:
                felt.update({(side, name): place.path for name in place.axes})
                _check_together(document, place, places)
        for name, axis in (parts.sides.get(side) or {}).items():
            if axis is not None and axis.load is not None and axis.load.reflect_load:
                felt[side, name] = (side, "axes", name, "load")
    powers = set()
    for (side, name), path in felt.items():
        pair, axis = (parts.pairs or {}).get(name), parts.axis("master", name)
        if side == "master":
            document.report(
                (*path, "reflect_load"),
                "only for slave axes: the hand feels its own device anyway; remove it",
            )
            return
        if document.get((*path, "compensate")) is False:
            document.report(
                (*path, "reflect_load"),
                "the coupling carries this load, so the hand feels it anyway; remove it",
            )
            return
        if pair is not None and pair.offset == "at_engage":
            document.report(
                ("coupling", "pairs", name, "offset"),
                f"the hand feels what {side}.{name} weighs (reflect_load) at the place that the "
                "master's stands for; give the offset as a number",
            )
        if axis is not None and (axis.causality != "impedance" or divided(parts, axis)):
            document.report(
                (*path, "reflect_load"),
                f"master.{name} must be effort-controlled and served in every "
                "cycle for the hand to feel a load",
            )
        if pair is not None:
            powers.add(pair.effective_force_scale * pair.position_scale)
    if felt and document.get(("operate", "scales")):
        document.report(
            ("operate", "scales"),
            "the hand feels what the slave weighs (reflect_load) at the rig's own scale; remove it",
        )
    if powers and max(powers) - min(powers) > 1e-9 * max(powers):
        document.report(
            next(iter(felt.values())),
            "the pairs scale power differently, so the load felt by the hand would not be "
            "conservative; give them the same force_scale times position_scale",
        )


def _check_together(document: Document, place: ArmPlace, places: Sequence[ArmPlace]) -> None:
    """Note an arm that is felt by hands at several: its joints' loads depend on each other."""
    if place.side == "slave":
        own = set(place.axes)
        holding = [one for one in places if one.side == "master" and own & set(one.axes)]
        if len(holding) > 1:
            document.report(
                (*place.path, "reflect_load"),
                f"the joints of this arm are led by {len(holding)} arms of the master, of which "
                "each would feel its weight; state the same `arms` on both sides, or remove it",
            )


def _check_payloads(document: Document, place: ArmPlace) -> None:
    """Note payloads that no command can take up."""
    path = (*place.path, "payloads")
    arm: Arm | None = salvage(Arm, document.get(place.path))
    if arm is None or not arm.payloads:
        return
    why = ""
    if document.get(("operate",)) is None:
        why = "payloads are selected with the command `payload`; add `operate: {}`"
    elif not arm.compensate:
        why = "the coupling carries this arm (compensate: false), whatever it holds; remove it"
    elif UNDO_PAYLOAD in arm.payloads:
        why = f"`payload {UNDO_PAYLOAD}` undoes the last change; choose another name"
    elif arm.reflect_load:
        why = "payloads and reflect_load cannot be combined; remove one of them"
    if why:
        document.report(path, why)


def _check_simulated(document: Document, parts: Parts, place: ArmPlace) -> None:
    """Note what the simulation of an arm cannot do."""
    paths = (place.truth, place.path)
    path = next((path for path in paths if document.get(path) is not None), None)
    if path is None:
        return
    side = place.side
    axes = [axis for name in place.axes if (axis := parts.axis(side, name)) is not None]
    drivers = {document.get(("buses", axis.bus, "driver")) for axis in axes}
    if len({axis.bus for axis in axes}) > 1 or not all(map(_moves_arms, drivers)):
        document.report(
            path, "a simulated arm needs all of its axes on one bus, of loopback or feetech; "
            "remove the simulation block to run hardware"
        )  # fmt: skip
    if document.get(("simulation", "integrator")) is not None:
        document.report(("simulation", "integrator"), "an arm has its own; remove it")
    for name in place.axes:
        keys = parts.environments.get(name)
        if side == "slave" and not isinstance(keys, Free | Spring | SolidWall | None):
            document.report(
                ("simulation", "environment", name),
                "the joints of an arm support free, spring or wall environments only",
            )


def _moves_arms(driver: str) -> bool:
    """Return whether the simulated devices of a driver may be joints of an arm."""
    try:
        return registry.load_simulator(driver).arms
    except ConfigError:
        return False  # said where the bus is checked


def divided(parts: Parts, axis: Axis) -> bool:
    """Return whether an axis is on a slow bus."""
    bus = parts.buses.get(axis.bus)
    return bus is not None and bus.divisor > 1


def _check_load(
    document: Document, parts: Parts, side: str, axis: Axis, load: TrueLoad, path: KeyPath
) -> None:
    """Note a load where a chain has it already, or nothing can carry it."""
    arms = (
        place
        for place in arm_places(document)
        if place.side == side
        and any(document.get(at) is not None for at in (place.path, place.truth))
    )
    if (arm := next(arms, None)) is not None:
        document.report(path, f"the chain of {arm.said} already defines the weight; remove it")
    elif axis.causality != "impedance":
        document.report(
            path, "the drive of an admittance axis compensates for the load itself; remove it"
        )
    elif divided(parts, axis):
        document.report(path, "load compensation needs every cycle; remove the divisor of its bus")
    elif document.get(("scene",)) is not None:
        document.report(path, "load compensation needs a coupling, and a rig with a scene has none")
    elif axis.kind == "linear" and (load.cosine or load.sine):
        document.report(path, "cosine and sine are for rotary axes; a linear one takes constant")


def _check_arm(
    document: Document, parts: Parts, place: ArmPlace, path: KeyPath, model: type[Chain]
) -> None:
    side = place.side
    keys: Chain | None = salvage(model, document.get(path))
    if keys is None:
        return
    at = (*path, "urdf" if keys.urdf is not None else "dh")
    try:
        links, _ = chain_links(keys)
    except ConfigError as err:
        document.report(at, str(err))
        return
    joints = [link for link in links if link.kind != "fixed"]
    if parts.sides.get(side) is None:
        return
    axes = {name: parts.axis(side, name) for name in place.axes}
    if len(joints) != len(axes):
        document.report(
            at,
            f"{len(joints)} joints ({', '.join(link.name for link in joints)}) for {len(axes)} "
            f"axes ({', '.join(axes)}); each axis of the side{place.which} is a joint",
        )
        return
    if isinstance(keys, Arm) and keys.compensate and any(keys.gravity) and not weighs(keys):
        document.report(
            at,
            "no moving link or payload has a mass, so there is no weight to compensate for; give "
            "masses, or state `compensate: false`",
        )
    for link, (name, axis) in zip(joints, axes.items(), strict=True):
        if axis is None:
            continue
        if axis.kind != KINDS[link.kind]:
            document.report(
                (side, "axes", name, "kind"),
                f"joint {link.name!r} of the arm {link.kind}, so this should be "
                f"{KINDS[link.kind]} (got {axis.kind})",
            )
        if divided(parts, axis):
            document.report(
                ("buses", axis.bus, "divisor"), "an arm is served in every cycle; remove it"
            )
        if axis.causality != "impedance":
            document.report(
                (side, "axes", name, "causality"),
                "the axes of an arm take effort: impedance (got admittance)",
            )
