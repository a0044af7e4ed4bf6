"""From a rig's `scene` keys to its network, its outside forces, and what runs it."""

from __future__ import annotations

import math
import shutil
import zlib
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, Scene, SceneLink
from tautwave.config.keys.scene import SoundForce
from tautwave.config.sounds import read_sound
from tautwave.errors import ConfigError
from tautwave.laws.admittance import admittance_params
from tautwave.laws.port import port_params, sensor_allowance
from tautwave.laws.site import SiteParams
from tautwave.laws.wave import filter_gain
from tautwave.rig.controller import NO_WALL, limit_params, velocity_gain
from tautwave.rig.truth import SEED_WORD
from tautwave.runtime.hold import HoldAccount
from tautwave.runtime.loop import LoopPair
from tautwave.runtime.scene import MOST_NODES, SceneAxis, ScenePort, SceneRow, SceneRun
from tautwave.runtime.site import SiteAxis
from tautwave.scene.live import SceneModel
from tautwave.scene.network import ACTIVE, GROUND, Link, Mass, Network, String
from tautwave.scene.pruning import Pruned, prune
from tautwave.scene.signals import force_signal, sound_signal
from tautwave.types import CommandDelay

COUPLING = "coupling"
"""What a port's own spring is called: `coupling of NAME`."""

HOLD_SPEED = 0.1
"""Of its velocity limit: by the energy of a device that fast a scene may be overdrawn."""


def scene_of(rig: Rig) -> Scene:
    """Return the scene of a rig that has one."""
    assert isinstance(rig.scene, Scene)
    return rig.scene


def whole_network(rig: Rig) -> Network:
    """Return a rig's network with every group spelled out, nothing left out."""
    scene = scene_of(rig)
    masses = [
        Mass(node, keys.mass, keys.position + at * keys.spacing, keys.velocity, keys.damping)
        for name, keys in scene.masses.items()
        for at, node in enumerate(scene.nodes_of(name))
    ]
    links = [link for name, keys in scene.links.items() for link in _links(scene, name, keys)]
    for name, port in scene.ports.items():
        if port.to is not None and port.stiffness is not None:
            ends = scene.nodes_of(port.to)
            links += [
                Link(
                    f"{COUPLING} of {name}" if len(ends) == 1 else f"{COUPLING} of {name} to {end}",
                    "spring",
                    name,
                    end,
                    stiffness=port.stiffness,
                    damping=port.damping,
                )
                for end in ends
            ]
    forced = dict.fromkeys(
        node for force in scene.forces.values() for node in scene.nodes_of(force.on)
    )
    return Network(
        masses=tuple(masses),
        links=tuple(links),
        ports=tuple(scene.ports),
        grounds=((GROUND, 0.0), *scene.grounds.items()),
        forced=tuple(forced),
        recorded=tuple(node for name in scene.record for node in scene.nodes_of(name)),
        gravity=scene.gravity,
        strings=tuple(_strings(rig)),
    )


def pruned_network(rig: Rig) -> Pruned:
    """Return the network as it runs, and what was left out of it."""
    return prune(whole_network(rig))


def _links(scene: Scene, name: str, keys: SceneLink) -> list[Link]:
    one, two = (scene.nodes_of(end) for end in keys.between)
    if keys.chain:
        pairs = list(zip(one[1:], one[:-1], strict=True))
    else:
        count = max(len(one), len(two))
        pairs = list(zip(one * (count // len(one)), two * (count // len(two)), strict=True))
    laws = _law(keys)
    return [
        Link(name if len(pairs) == 1 else f"{name}{at + 1}", keys.type, a, b, **laws)
        for at, (a, b) in enumerate(pairs)
    ]


def _law(keys: SceneLink) -> dict[str, Any]:
    """Return the constants of a link by the names of `scene.network.Link`."""
    renamed = {"yield_force": "limit", "force": "limit", "power": "limit", "speed": "scale"}
    renamed |= {"gap": "rest"}
    values = keys.model_dump(exclude={"type", "between", "chain"})
    return {renamed.get(name, name): value for name, value in values.items()}


def _strings(rig: Rig) -> list[String]:
    """Return the strings with their halves in samples; the round trip is 2 (near + far) + 4."""
    found = []
    for name, keys in scene_of(rig).strings.items():
        half = max(round(0.5 * rig.rate_hz / keys.frequency_hz), 4)
        near = min(max(round(keys.position * half) - 1, 1), half - 3)
        smoothing = 1.0
        if keys.brightness_hz is not None:
            smoothing = filter_gain(keys.brightness_hz, rig.period_s)
        found.append(
            String(name, keys.impedance, near, half - 2 - near, keys.reflection, smoothing)
        )
    return found


def scene_forces(rig: Rig, network: Network, cycles: int) -> list[Sequence[float]]:
    """Return the outside force on each of `network.forced` over a run [N], packed."""
    scene = scene_of(rig)
    total: dict[str, Any] = {}
    sounds = {
        name: sound_force(keys, rig.rate_hz, cycles)
        for name, keys in scene.forces.items()
        if keys.type == "sound"
    }
    for name, keys in scene.forces.items():
        for node in scene.nodes_of(keys.on):
            if node not in network.forced:
                continue
            if name in sounds:
                signal = sounds[name]
            else:
                # By name, not by place: another force in the rig shifts no stream.
                seed = (rig.seed % SEED_WORD, zlib.crc32(f"{name} on {node}".encode()))
                signal = force_signal(keys.model_dump(), rig.rate_hz, cycles, seed)
            total[node] = total[node] + signal if node in total else signal
    return [array("d", total[node].tobytes()) for node in network.forced]


def sound_force(keys: SoundForce, rate_hz: float, cycles: int) -> Any:
    """Return the force of a sound over a run [N].

    Raises
    ------
    ConfigError
        The file has gone, or is another one, since the rig was read.
    """
    path = Path(keys.file)
    try:
        sound = read_sound(path)
    except ConfigError as err:
        raise ConfigError(f"{path}: {err}") from err
    return sound_signal(keys.model_dump(), sound.samples, sound.rate_hz, rate_hz, cycles)


def keep_sounds(rig: Rig, directory: Path) -> Rig:
    """Copy a rig's sounds into `directory`/sounds; return the rig that names the copies.

    Their paths are relative, so that the directory can go anywhere and its rig.yaml still runs.
    """
    if rig.scene is None or not any(f.type == "sound" for f in rig.scene.forces.values()):
        return rig
    forces = dict(rig.scene.forces)
    for name, keys in rig.scene.forces.items():
        if keys.type != "sound":
            continue
        folder = directory / "sounds"
        folder.mkdir(exist_ok=True)
        shutil.copyfile(keys.file, folder / f"{name}.wav")
        forces[name] = keys.model_copy(update={"file": f"sounds/{name}.wav"})
    return rig.model_copy(update={"scene": rig.scene.model_copy(update={"forces": forces})})


def scene_site(rig: Rig, axis_name: str, delay: CommandDelay) -> SceneAxis:
    """Return an axis of the controller that renders a scene."""
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    gain = velocity_gain(rig, axis)
    allowance = sensor_allowance(rig.period_s, 1.0, gain, axis.encoder_quantum, axis.position_noise)
    params = SiteParams(
        port=port_params(rig.period_s, 1.0, axis.inertia.lower, False, 0.05, allowance),
        admittance=admittance_params(rig.period_s, 1.0, 0.0, delay.periods),
        wall=NO_WALL,
        limit=limit_params(rig, axis),
        gain=gain,
        stiffness=0.0,
        damping=0.0,
        velocity_quantum=0.0,
        has_wall=False,
    )
    return SceneAxis(
        params,
        delay_periods=delay.periods,
        coupled_by_wave=False,
        late_share=delay.remainder_s / rig.period_s,
    )


class BuiltScene(NamedTuple):
    """A scene in the loop: its run, its ports as the loop's pairs, its row."""

    run: SceneRun
    pairs: Sequence[LoopPair]
    row: SceneRow


def hold_account(
    rig: Rig, links: Sequence[Link], names: Sequence[str], axes: Sequence[SceneAxis], scheme: str
) -> HoldAccount | None:
    """Return what bounds the energy that held efforts create; None for instruments that feed.

    `names` are those of the axes on the master. The allowance is the energy of all devices at
    `HOLD_SPEED` of their velocity limits.
    """
    if any(link.kind in ACTIVE for link in links):
        return None  # nothing is certified of these, and their energy has no bound to keep
    keys = [rig.axes[f"master.{name}"] for name in names]
    allowance = 0.0
    for axis in keys:
        assert axis.inertia is not None
        mass = axis.inertia.lower
        speed = axis.velocity_limit
        if speed is None:
            speed = 0.1 * (axis.effort_limit or math.inf) / mass
        allowance += 0.5 * mass * (HOLD_SPEED * speed) ** 2
    return HoldAccount(
        axes,
        [axis.command_delay for axis in axes],
        [axis.damping.lower for axis in keys],
        rig.period_s,
        allowance,
        holds_forces=scheme == "symplectic",
    )


def build_scene(
    rig: Rig, sites: Mapping[str, SiteAxis], order: Sequence[str], cycles: int
) -> BuiltScene:
    """Build the scene of a rig around its axes.

    Raises
    ------
    ConfigError
        The scheme cannot do this network.
    """
    scene = scene_of(rig)
    network = pruned_network(rig).network
    model = SceneModel(network, scene.scheme, rig.period_s, keep_books=True)
    found = [sites[f"master.{name}"] for name in network.ports]
    axes = [axis for axis in found if isinstance(axis, SceneAxis)]
    run = SceneRun(
        model,
        axes,
        [scene.ports[name].position_scale for name in network.ports],
        [scene.ports[name].offset for name in network.ports],
        scene_forces(rig, network, cycles),
        hold_account(rig, network.links, network.ports, axes, scene.scheme),
    )
    pairs = []
    for port, name in enumerate(network.ports):
        at = order.index(f"master.{name}")
        pairs.append(LoopPair(ScenePort(name, run, port), at, at, None, math.inf))
    row = SceneRow(run, network.ports, model.compiled.masses[:MOST_NODES])
    return BuiltScene(run, pairs, row)
