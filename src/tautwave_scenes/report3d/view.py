"""A recorded 3D scene as the report sees it, and its projection."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.errors import TautwaveError
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run
from tautwave_scenes.networks3d.network import Network3d, unit
from tautwave_scenes.report.view import ENERGIES
from tautwave_scenes.rig.network3d import axis_scales, pruned_network3d

AZIMUTH, ELEVATION = math.radians(-62.0), math.radians(24.0)


class View3d(NamedTuple):
    """A 3D scene over time.

    Attributes
    ----------
    network : Network3d
        As it ran.
    rig : Rig
        The resolved rig.
    time : (rows,)
        [s]
    at : dict of str to (rows, 3)
        Position of every recorded node over time [m], ports and grounds included.
    efforts : dict of str to (rows,)
        Resisting effort on each axis of a port [N or N m].
    energies : dict of str to (rows,)
        Energies of the ledger [J], and `hold`.
    """

    network: Network3d
    rig: Rig
    time: Floats
    at: dict[str, Floats]
    efforts: dict[str, Floats]
    energies: dict[str, Floats]

    @property
    def moving(self) -> list[str]:
        """Names of the recorded masses."""
        return [mass.name for mass in self.network.masses if mass.name in self.at]


def view_scene3d(run: Run) -> View3d | None:
    """Return the scene of a run, None if nothing of it was recorded."""
    if "scene" not in run.rig or run.rows == 0:
        return None
    try:
        rig = run.checked_rig
    except TautwaveError:
        return None
    network = pruned_network3d(rig).network
    time = run.read("time_s")["time_s"]
    at: dict[str, Floats] = {}
    for mass in network.masses:
        parts = [run.read(name).get(name) for name in (f"scene.at.{mass.name}.{c}" for c in "xyz")]
        known = [part for part in parts if part is not None]
        if len(known) == len(parts):
            at[mass.name] = np.stack(known, axis=1)
    for name, place in network.grounds:
        at[name] = np.tile(np.array(place), (len(time), 1))
    efforts: dict[str, Floats] = {}
    moved = np.zeros((len(time), len(network.axes)))
    for which, (axis, scale) in enumerate(zip(network.axes, axis_scales(rig), strict=True)):
        for values in run.read(f"master.{axis}.position").values():
            moved[:, which] = scale * values
        for values in run.read(f"master.{axis}.port_effort").values():
            efforts[axis] = values
    if network.tools:
        carried = network.carried()
        moved = np.array([carried.spread(row) for row in moved.tolist()])
    columns = iter(moved.T)
    for port in network.ports:
        where = np.tile(np.array(port.offset), (len(time), 1))
        for _, way in zip(port.axes, port.directions, strict=False):
            where += np.outer(next(columns), unit(way))
        at[port.name] = where
    energies = {
        name: values
        for name in (*ENERGIES, "hold", "residual", "numeric")
        for values in run.read(f"scene.{name}").values()
    }
    return View3d(network, rig, time, at, efforts, energies)


def project(places: Floats) -> Floats:
    """Return (..., 3) as seen obliquely from above: right, up, and nearness [m]."""
    x, y, z = places[..., 0], places[..., 1], places[..., 2]
    across = math.cos(AZIMUTH) * y - math.sin(AZIMUTH) * x
    near = math.cos(AZIMUTH) * x + math.sin(AZIMUTH) * y
    high = math.cos(ELEVATION) * z - math.sin(ELEVATION) * near
    return np.stack([across, high, math.cos(ELEVATION) * near + math.sin(ELEVATION) * z], axis=-1)
