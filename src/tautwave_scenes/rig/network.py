"""From a rig's `scene` keys to its network, its external forces, and its controller."""

from __future__ import annotations

import math
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautwave.config import Axis, Rig
from tautwave.controller.records import PIPE
from tautwave.errors import ConfigError
from tautwave.files import make_directory, write_bytes
from tautwave.laws.wave_filter import filter_gain
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.controller import (
    axis_names,
    bare_site,
    controlled_axis,
    run_params,
)
from tautwave.streams import SEED_WORD
from tautwave.types import CommandDelay
from tautwave_scenes.config.keys import Scene, SceneLink, SoundForce
from tautwave_scenes.config.keys3d import Scene3d
from tautwave_scenes.config.sounds import read_sound
from tautwave_scenes.models.link_kinds import is_active
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import GROUND, Link, Mass, Network, String
from tautwave_scenes.networks.pruning import Pruned, prune
from tautwave_scenes.networks.schemes.choice import SceneChoice, choose_scene_scheme
from tautwave_scenes.networks.signals import force_signal, sound_signal
from tautwave_scenes.rig.with_device import tuned_scene
from tautwave_scenes.runtime.axes import MAX_NODES, SceneControl, SceneRun, guarded
from tautwave_scenes.runtime.hold import HoldAccount

if TYPE_CHECKING:  # a one-dimensional scene loads no 3D code
    from tautwave_scenes.networks3d.live import Model3d

COUPLING = "coupling"
"""Name of a port's own spring: `coupling of NAME`."""

HOLD_SPEED = 0.1
"""Share of the velocity limit whose kinetic energy held efforts may create."""

HOLD_J = 0.01
"""[J] Most that they may create by default, an axis: 0.1 kg at 0.45 m/s."""


def keys_of(rig: Rig) -> Scene | Scene3d:
    """Return the scene of a rig that has one, as in the file."""
    assert isinstance(rig.scene, Scene | Scene3d)
    return rig.scene


def scene_of(rig: Rig) -> Scene:
    """Return the scene of a rig that has one, with the scheme that runs it."""
    scene = _given(rig)
    if scene.scheme != "auto":
        return scene
    return scene.model_copy(update={"scheme": scheme_choice(rig).scheme})


def _given(rig: Rig) -> Scene:
    """Return the scene as in the file."""
    assert isinstance(rig.scene, Scene)
    return rig.scene


def scheme_choice(rig: Rig) -> SceneChoice:
    """Return the choice of `scheme: auto`, at the velocity limit of the fastest port."""
    scene = _given(rig)
    speed = max(
        (
            abs(port.position_scale) * top_speed(rig.axes[f"master.{name}"])
            for name, port in scene.ports.items()
        ),
        default=0.0,
    )
    return choose_scene_scheme(pruned_network(rig).network, rig.period_s, speed)


def top_speed(axis: Axis) -> float:
    """Return an axis' velocity limit; without one, the speed reached at full effort in 0.1 s."""
    assert axis.inertia is not None
    if axis.velocity_limit is not None:
        return axis.velocity_limit
    return 0.1 * (axis.effort_limit or math.inf) / axis.inertia.lower


def coupling_springs(scene: Scene | Scene3d) -> Iterator[Link]:
    """Yield the springs between ports and what they are coupled to, with every group expanded."""
    for name, port in scene.ports.items():
        if port.to is not None and port.stiffness is not None:
            ends = scene.nodes_of(port.to)
            for end in ends:
                yield Link(
                    f"{COUPLING} of {name}" if len(ends) == 1 else f"{COUPLING} of {name} to {end}",
                    "spring",
                    name,
                    end,
                    stiffness=port.stiffness,
                    damping=port.damping,
                )


def whole_network(rig: Rig) -> Network:
    """Return a rig's network with every group expanded, nothing left out."""
    scene = _given(rig)
    masses = [
        Mass(node, keys.mass, keys.position + at * keys.spacing, keys.velocity, keys.damping)
        for name, keys in scene.masses.items()
        for at, node in enumerate(scene.nodes_of(name))
    ]
    links = [link for name, keys in scene.links.items() for link in _links(scene, name, keys)]
    links += coupling_springs(scene)
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
    """Return the network as it runs, and the elements left out."""
    pruned = prune(whole_network(rig))
    tuned = tuned_scene(rig, pruned.network)
    return pruned if tuned is None else pruned._replace(network=tuned.network)


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
    """Return the constants of a link by the names of `networks.network.Link`."""
    renamed = {"yield_force": "limit", "force": "limit", "power": "limit", "speed": "scale"}
    renamed |= {"gap": "rest"}
    values = keys.model_dump(exclude={"type", "between", "chain"})
    return {renamed.get(name, name): value for name, value in values.items()}


def _strings(rig: Rig) -> list[String]:
    """Return the strings with their halves in samples; the round trip is 2 (near + far) + 4."""
    strings = []
    for name, keys in _given(rig).strings.items():
        half = max(round(0.5 * rig.rate_hz / keys.frequency_hz), 4)
        near = min(max(round(keys.position * half) - 1, 1), half - 3)
        smoothing = 1.0
        if keys.brightness_hz is not None:
            smoothing = filter_gain(keys.brightness_hz, rig.period_s)
        strings.append(
            String(name, keys.impedance, near, half - 2 - near, keys.reflection, smoothing)
        )
    return strings


def scene_forces(rig: Rig, network: Network, cycles: int) -> list[Sequence[float]]:
    """Return the external force on each of `network.forced` over a run [N], packed."""
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
                # Seeded by name, not position: adding a force does not shift other streams.
                seed = (rig.seed % SEED_WORD, zlib.crc32(f"{name} on {node}".encode()))
                signal = force_signal(keys.model_dump(), rig.rate_hz, cycles, seed)
            total[node] = total[node] + signal if node in total else signal
    return [array("d", total[node].tobytes()) for node in network.forced]


def sound_force(keys: SoundForce, rate_hz: float, cycles: int) -> Any:
    """Return the force of a sound over a run [N].

    Raises
    ------
    ConfigError
        The file is missing, or has changed since the rig was read.
    """
    path = Path(keys.file)
    try:
        sound = read_sound(path)
    except ConfigError as err:
        raise ConfigError(f"{path}: {err}") from err
    return sound_signal(keys.model_dump(), sound.samples, sound.rate_hz, rate_hz, cycles)


def keep_sounds(rig: Rig, directory: Path) -> Rig:
    """Copy a rig's sounds into `directory`/sounds; return the rig that names the copies.

    Their paths are relative, so the directory can be moved and its rig.yaml still runs.
    """
    scene = keys_of(rig)
    if not any(force.type == "sound" for force in scene.forces.values()):
        return rig
    forces: dict[str, Any] = dict(scene.forces)
    for name, keys in scene.forces.items():
        if keys.type != "sound":
            continue
        folder = directory / "sounds"
        make_directory(folder)
        write_bytes(folder / f"{name}.wav", Path(keys.file).read_bytes())
        forces[name] = keys.model_copy(update={"file": f"sounds/{name}.wav"})
    return rig.model_copy(update={"scene": scene.model_copy(update={"forces": forces})})


def scene_control(
    rig: Rig,
    delays: Mapping[str, CommandDelay],
    cycles: int,
    ports: Sequence[str],
    nodes: Sequence[str],
) -> SceneControl:
    """Return the controller for a scene, without the scene; `ports` are axes of the master."""
    axes = tuple(delays)
    scene = keys_of(rig)
    run = run_params(rig, cycles, len(axes))._replace(
        engage_cycles=round(scene.engage_ramp_s * rig.rate_hz),
        release_cycles=round(scene.release_ramp_s * rig.rate_hz),
    )
    params = []
    at = 0
    for name in axes:
        delay = delays[name]
        blind = rig.loop.missing_limit
        params.append(
            controlled_axis(rig, name, delay, bare_site(rig, name, delay), at, blind=blind)
        )
        at += PIPE * delay.periods
    return SceneControl(
        run,
        axis_names(rig, axes),
        params,
        [axes.index(f"master.{name}") for name in ports],
        ports,
        nodes,
        [0.0] * at,
    )


def scene_run(
    control: SceneControl,
    model: SceneModel | Model3d,
    scales: Sequence[float],
    offsets: Sequence[float],
    forces: Sequence[Sequence[float]],
    account: HoldAccount | None,
) -> SceneControl:
    """Attach a scene to its controller, and return the controller."""
    axes = [control.axes[at] for at in control.ports]
    params = [control.params[at] for at in control.ports]
    control.scene = SceneRun(model, axes, params, scales, offsets, forces, account)
    if account is not None:
        control.law = guarded(account.allowance)
    return control


def hold_limit(rig: Rig, names: Sequence[str]) -> float:
    """Return the energy that held efforts may create before a run stops [J]; `names` of axes."""
    given = keys_of(rig).hold_limit_j
    if given is not None:
        return given
    limit = 0.0
    for axis in (rig.axes[f"master.{name}"] for name in names):
        assert axis.inertia is not None
        speed = math.inf if axis.velocity_limit is None else HOLD_SPEED * axis.velocity_limit
        limit += min(HOLD_J, 0.5 * axis.inertia.lower * speed**2)
    return limit


def hold_claim(rig: Rig, names: Sequence[str], delays: Mapping[str, CommandDelay]) -> float:
    """Return the most that held efforts give before a run has stopped [J]; inf without limits.

    That is `hold_limit`, and what the efforts that act until the stop do: one in a period and in
    each of the command delay, then the last one while its rate limit takes it down. Each works over
    the way at the velocity limit, and over no more than from one end stop to the other.
    """
    claim = hold_limit(rig, names)
    for name in (f"master.{name}" for name in names):
        has, delay = axis_allowance(rig, name, delays[name]), delays[name]
        stops = math.inf if has.mechanical_range is None else has.mechanical_range
        ramp = 0.5 * has.shared_effort / has.shared_rate
        for held in (*[rig.period_s] * (1 + delay.periods), delay.remainder_s, ramp):
            way = min(has.velocity * held, stops) if held > 0.0 else 0.0
            claim += has.shared_effort * way
    return claim


def press_energy(rig: Rig, names: Sequence[str]) -> float:
    """Return the energy that devices bring into a contact [J]: at top speed, and their limit."""
    energy = hold_limit(rig, names)
    for axis in (rig.axes[f"master.{name}"] for name in names):
        assert axis.inertia is not None
        energy += 0.5 * axis.inertia.value * top_speed(axis) ** 2
    return energy


def hold_account(
    rig: Rig,
    links: Sequence[Link],
    names: Sequence[str],
    delays: Mapping[str, CommandDelay],
    control: SceneControl,
    scheme: str,
) -> HoldAccount | None:
    """Return the bound on energy created by held efforts; None for scenes that feed energy.

    `names` are those of the axes on the master.
    """
    if any(is_active(link.kind) for link in links):
        return None  # these are not certified, and their energy has no bound
    axes = [f"master.{name}" for name in names]
    params = [control.params[at] for at in control.ports]
    return HoldAccount(
        [control.axes[at] for at in control.ports],
        [(p.delay, p.late) for p in params],
        [axis_allowance(rig, name, delays[name]).coupling_damping for name in axes],
        rig.period_s,
        hold_limit(rig, names),
        holds_forces=scheme == "symplectic",
    )


def build_scene(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> SceneControl:
    """Build the scene of a rig and the controller of its axes; `delays` in their order.

    Raises
    ------
    ConfigError
        The scheme does not support this network.
    """
    scene = scene_of(rig)
    network = pruned_network(rig).network
    model = SceneModel(network, scene.scheme, rig.period_s, keep_books=True)
    ports = network.ports
    control = scene_control(rig, delays, cycles, ports, model.compiled.masses[:MAX_NODES])
    return scene_run(
        control,
        model,
        [scene.ports[name].position_scale for name in ports],
        [scene.ports[name].offset for name in ports],
        scene_forces(rig, network, cycles),
        hold_account(rig, network.links, ports, delays, control, scene.scheme),
    )
