"""The inputs of a scene, from the recording of a run; and its network, of either dimension."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.controller.stops import ARM_SHARE
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run
from tautwave_scenes.models.link_kinds import is_linear
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Network, String
from tautwave_scenes.networks.schemes.exact import MOST
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.rig.network import keys_of, pruned_network, scene_forces, scene_of
from tautwave_scenes.rig.network3d import axis_scales, forces3d, pruned_network3d, scene3d_of

Model = SceneModel | Model3d


class Stage(NamedTuple):
    """The network of a rig, and how the axes of the master are its ports.

    `names` of the axes, `scales` and `offsets` of their positions in the scene; `oracle` is the
    scheme of the oracle.
    """

    network: Network | Network3d
    scheme: str
    oracle: str
    names: Sequence[str]
    scales: Sequence[float]
    offsets: Sequence[float]

    @property
    def strings(self) -> tuple[String, ...]:
        """The strings, of which a scene of three dimensions has none."""
        return self.network.strings if isinstance(self.network, Network) else ()

    def model(self, scheme: str, period: float) -> Model:
        """Return the network at run time."""
        if isinstance(self.network, Network):
            return SceneModel(self.network, scheme, period)
        return Model3d(self.network, scheme, period)

    def forces(self, rig: Rig, cycles: int) -> list[Sequence[float]]:
        """Return the external forces over a run [N], in the order of `network.forced`."""
        if isinstance(self.network, Network):
            return scene_forces(rig, self.network, cycles)
        return forces3d(rig, self.network, cycles)


def stage_of(rig: Rig) -> Stage:
    """Return the network of a rig with a scene, and its ports."""
    if keys_of(rig).dimension == 3:
        spatial = pruned_network3d(rig).network
        scales = axis_scales(rig)
        # Exact gradients of links that turn cost ten steps of the symplectic scheme.
        scheme = scene3d_of(rig).scheme
        return Stage(spatial, scheme, scheme, spatial.axes, scales, [0.0] * len(scales))
    network = pruned_network(rig).network
    scene = scene_of(rig)
    linear = all(is_linear(link.kind) for link in network.links)
    exact = linear and not network.strings and len(network.masses) <= MOST
    return Stage(
        network,
        scene.scheme,
        "exact" if exact else "discrete_gradient",
        network.ports,
        [scene.ports[name].position_scale for name in network.ports],
        [scene.ports[name].offset for name in network.ports],
    )


class Inputs(NamedTuple):
    """The inputs of a scene, at each slot of the loop from its first on.

    `ports` (slots, p) positions of the ports [m]; `pushes` (slots, f) external forces [N]; `asked`
    (slots, p) recorded efforts [N] of the scene, NaN in skipped slots.
    """

    ports: Floats
    pushes: Floats
    asked: Floats

    def part(self, first: int, last: int) -> Inputs:
        """Return the slots from `first` to `last`."""
        return Inputs(*(values[first:last] for values in self))


def inputs_of(run: Run, rig: Rig, stage: Stage) -> Inputs | None:
    """Return the inputs of a run's scene; None if they were not recorded."""
    names = list(stage.names)
    wanted = [f"master.{n}.{leaf}" for n in names for leaf in ("position", "valid")]
    wanted += [f"scene.asked.{name}" for name in names]
    read = run.read("skipped_slots", *wanted)
    if len(read) <= len(wanted):
        return None
    scales, offsets = np.array(stage.scales), np.array(stage.offsets)
    places = np.stack([read[f"master.{name}.position"] for name in names], axis=1)
    asked = np.stack([read[f"scene.asked.{name}"] for name in names], axis=1) / scales
    valid = np.stack([read[f"master.{name}.valid"] for name in names], axis=1) > 0.5
    first = armed_row(rig, stage, scales * places + offsets, valid)
    if first is None:
        return None
    places, asked, valid = places[first:], asked[first:], valid[first:]
    for port in range(len(names)):  # a missing sample leaves the port where it was
        row = np.maximum.accumulate(np.where(valid[:, port], np.arange(len(valid)), 0))
        places[:, port] = places[row, port]
    passed = 1 + np.nan_to_num(read["skipped_slots"][first:]).astype(np.int64)
    passed[0] = 1
    # Skipped slots are made up with the next measurement.
    ports = np.repeat(scales * places + offsets, passed, axis=0)
    known = np.full_like(ports, np.nan)
    known[np.cumsum(passed) - 1] = asked
    return Inputs(ports, _pushes(run, rig, stage, len(ports)), known)


def armed_row(rig: Rig, stage: Stage, ports: Floats, valid: Any) -> int | None:
    """Return the row in which the scene began, by the loop's own rule."""
    limits = [rig.axes[f"master.{name}"].effort_limit or math.inf for name in stage.names]
    model = stage.model(stage.scheme, rig.period_s)
    for row in np.flatnonzero(valid.all(axis=1)):
        model.reset(ports[row].tolist())
        rest = model.resting_efforts()
        if all(
            abs(scale * effort) <= ARM_SHARE * limit
            for scale, effort, limit in zip(stage.scales, rest, limits, strict=True)
        ):
            return int(row)
    return None


def _pushes(run: Run, rig: Rig, stage: Stage, slots: int) -> Floats:
    """Return the external forces of a run, zero after their end, shape (slots, f)."""
    asked = run.result.asked_s
    seconds = rig.duration_s if asked is None else asked
    cycles = max(round(seconds * rig.rate_hz), 1)
    pushes = np.zeros((slots, len(stage.network.forced)))
    for at, force in enumerate(stage.forces(rig, cycles)):
        given = np.asarray(force)[:slots]
        pushes[: len(given), at] = given
    return pushes
