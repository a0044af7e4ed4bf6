"""Fill in the defaults of a valid rig that depend on other keys."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tautwave.config.hooks import config_hooks
from tautwave.config.inputs.recordings import find_recording
from tautwave.config.inputs.starts import recorded_starts
from tautwave.config.keys.arm import Chain
from tautwave.config.keys.coupling import Pair
from tautwave.config.keys.rig import (
    Rig,
    bus_spec,
    count_velocity,
    imposed_motions,
    simulation_of,
    true_arm,
)
from tautwave.config.keys.simulation import (
    AxisSimulation,
    Hand,
    HandPart,
    Intent,
    Recorded,
    Recording,
    Simulation,
)
from tautwave.config.text.document import Document, show_path
from tautwave.config.text.yaml12 import KeyPath
from tautwave.contracts import AxisFacts, DriverPlugin
from tautwave.errors import ConfigError
from tautwave.registry import load_coupling


def complete_rig(
    document: Document, rig: Rig, plugins: dict[str, DriverPlugin | None], path: Path
) -> Rig:
    """Return the rig with every default made explicit.

    Options of drivers are filled in by the driver's model, `force_scale` from `position_scale`,
    the truth of simulated axes from the belief; files get their whole path.
    """
    buses = {
        name: bus.model_copy(update={"options": _options(plugins[name], bus.options)})
        for name, bus in rig.buses.items()
    }
    pairs = {name: _complete_pair(pair) for name, pair in rig.coupling.pairs.items()}
    rig = rig.model_copy(
        update={"buses": buses, "coupling": rig.coupling.model_copy(update={"pairs": pairs})}
    )
    if rig.scene is not None:
        scene = config_hooks().complete(document, rig.scene)
        rig = rig.model_copy(update={"scene": scene})
    if rig.link is not None and rig.link.trace is not None:
        trace = find_recording(document, ("link", "trace"), rig.link.trace)
        rig = rig.model_copy(update={"link": rig.link.model_copy(update={"trace": str(trace)})})
    rig = _complete_quanta(document, rig, plugins)
    if rig.simulation is not None:
        simulation = _complete_simulation(document, rig, rig.simulation, plugins)
        rig = rig.model_copy(update={"simulation": simulation})
    _check_counts(document, rig)
    return rig.read_from(path)


def _options(plugin: DriverPlugin | None, given: dict[str, Any]) -> dict[str, Any]:
    if plugin is None:
        return given
    options = plugin.options.model_validate_json(json.dumps(given), strict=True)
    filled: dict[str, Any] = options.model_dump(mode="json", by_alias=True)
    return filled


def _complete_quanta(document: Document, rig: Rig, plugins: dict[str, DriverPlugin | None]) -> Rig:
    """Take the steps of sensors and commands from the options of a bus that state them.

    Raises
    ------
    ConfigError
        The axis says otherwise.
    """
    known = axis_facts(rig, plugins)
    problems = []
    sides = {}
    for side in ("master", "slave"):
        axes = {}
        for name, axis in getattr(rig, side).axes.items():
            facts = known.get(f"{side}.{name}", AxisFacts())._asdict()
            del facts["damper"]  # no key of an axis: the certificate asks the driver
            facts = {key: value for key, value in facts.items() if value > 0.0}
            for key, value in facts.items():
                given = getattr(axis, key)
                if given > 0.0 and abs(given - value) > 1e-3 * value:
                    path = (side, "axes", name, key)
                    problems.append(
                        f"{document.where(path)}: {show_path(path)}: the options of bus "
                        f"{axis.bus!r} set it to {value:.9g} (got {given:.9g}); remove it, or "
                        "correct one of them"
                    )
            axes[name] = axis.model_copy(update=facts)
        sides[side] = getattr(rig, side).model_copy(update={"axes": axes})
    if problems:
        raise ConfigError(problems)
    return rig.model_copy(update=sides)


def _check_counts(document: Document, rig: Rig) -> None:
    """Refuse encoders, believed or simulated, whose first count stops the run as too fast.

    It is not among the other checks because a driver's options may determine the step.

    Raises
    ------
    ConfigError
        Its message gives the velocity of one count, and what would be accepted.
    """
    problems = []
    for name, axis in rig.axes.items():
        side, short = name.split(".")
        truth = simulation_of(rig, name).encoder_quantum
        stated: list[tuple[KeyPath, float]] = [
            ((side, "axes", short, "encoder_quantum"), axis.encoder_quantum)
        ]
        if truth != axis.encoder_quantum:
            stated.append((("simulation", "axes", name, "encoder_quantum"), truth))
        for path, quantum in stated:
            reads = count_velocity(rig, name, quantum)
            if axis.velocity_limit is None or reads <= axis.velocity_limit:
                continue
            unit = "rad/s" if axis.kind == "rotary" else "m/s"
            period = rig.axis_period_s(name)
            remedy = "a slower rate or a finer encoder"
            observes = rig.scene is None and load_coupling(rig.coupling.law).observes
            if axis.causality == "impedance" and not observes:
                needed = quantum / axis.velocity_limit - period
                remedy = f"a velocity_filter_s of {1.01 * needed:.2g} s or more, {remedy}"
            problems.append(
                f"{document.where(path)}: {show_path(path)}: one count within a period of "
                f"{1e3 * period:.4g} ms reads as {reads:.4g} {unit}, beyond velocity_limit "
                f"{axis.velocity_limit:g}, so the first count would stop the run; use {remedy} "
                f"(got {quantum:.6g})"
            )
    if problems:
        raise ConfigError(problems)


def axis_facts(rig: Rig, plugins: dict[str, DriverPlugin | None]) -> dict[str, AxisFacts]:
    """Return what the options of its bus say of each axis, by full name."""
    known = {}
    for name, bus in rig.buses.items():
        plugin = plugins[name]
        if plugin is not None:
            spec = bus_spec(rig, name)
            facts = plugin.facts(plugin.options.model_validate(bus.options), spec)
            known.update({axis.name: fact for axis, fact in zip(spec.axes, facts, strict=True)})
    return known


def _complete_pair(pair: Pair) -> Pair:
    return pair.model_copy(update={"force_scale": pair.effective_force_scale})


def _complete_simulation(
    document: Document,
    rig: Rig,
    simulation: Simulation,
    plugins: Mapping[str, DriverPlugin | None],
) -> Simulation:
    hands = {name: _complete_hand(document, name, hand) for name, hand in simulation.hand.items()}
    environments = {
        name: _with_file(document, ("simulation", "environment", name), keys)
        if isinstance(keys, Recorded)
        else keys
        for name, keys in simulation.environment.items()
    }
    simulation = simulation.model_copy(update={"hand": hands, "environment": environments})
    motions = imposed_motions(rig, plugins)
    starts = recorded_starts(rig.coupling.pairs, simulation, motions)
    axes = {name: _complete_axis(rig, name, starts, name in motions) for name in rig.axes}
    true = dict(arm for axis in rig.axes if (arm := true_arm(rig, axis)) is not None)
    arms = {name: Chain(**_chain_of(arm)) for name, arm in true.items()}
    return simulation.model_copy(update={"axes": axes, "arms": arms})


def _chain_of(arm: Chain) -> dict[str, Any]:
    return {key: getattr(arm, key) for key in Chain.model_fields}


def _complete_axis(
    rig: Rig, name: str, starts: Mapping[str, float], imposed: bool
) -> AxisSimulation:
    truth = simulation_of(rig, name)._asdict()
    given = AxisSimulation() if rig.simulation is None else rig.simulation.axes.get(name)
    if given is None or given.start_position is None:
        truth["start_position"] = starts.get(name, 0.0)
    for key in ("encoder_quantum", "position_noise") if imposed else ():
        if given is None or getattr(given, key) is None:
            truth[key] = 0.0  # the recording has its own
    unused = ["servo_stiffness", "servo_damping"]
    if rig.axes[name].follower is not None:
        unused = ["velocity_time_constant_s"]
    elif rig.axes[name].causality == "impedance":
        unused += ["velocity_time_constant_s"]
    else:
        unused += ["inertia", "damping", "coulomb"]
    for key in unused:
        del truth[key]
    return AxisSimulation(**truth)


def _complete_hand(document: Document, name: str, hand: Hand | HandPart) -> Hand | HandPart:
    if isinstance(hand, HandPart):
        return hand
    reference = hand.reference
    if not isinstance(reference, Recording | Intent):
        return hand
    path = ("simulation", "hand", name, "reference")
    return hand.model_copy(update={"reference": _with_file(document, path, reference)})


def _with_file(document: Document, path: KeyPath, keys: Recording | Intent | Recorded) -> Any:
    located = find_recording(document, (*path, "file"), keys.file)
    return keys.model_copy(update={"file": str(located)})
