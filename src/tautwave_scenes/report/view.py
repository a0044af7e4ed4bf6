"""A recorded scene as the report sees it: network from the rig, motion from the recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.errors import TautwaveError
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run
from tautwave_scenes.networks.network import Network
from tautwave_scenes.rig.network import pruned_network, scene_of

ENERGIES = ("kinetic", "stored", "lifted", "lost", "made", "port_work", "pumped")


class SceneView(NamedTuple):
    """A scene over time.

    Attributes
    ----------
    network : Network
        As it ran.
    rig : Rig
        The resolved rig.
    time : (rows,)
        [s]
    at : dict of str to (rows,)
        Position of every recorded node over time [m], ports and grounds included.
    efforts : dict of str to (rows,)
        Resisting force of each port on its device [N].
    energies : dict of str to (rows,)
        Energies of the ledger [J], and `hold`.
    """

    network: Network
    rig: Rig
    time: Floats
    at: dict[str, Floats]
    efforts: dict[str, Floats]
    energies: dict[str, Floats]


def view_scene(run: Run) -> SceneView | None:
    """Return the scene of a run, None if it had none or nothing of it was recorded."""
    if "scene" not in run.rig or run.rows == 0:
        return None
    try:
        rig = run.checked_rig
    except TautwaveError:
        return None
    network = pruned_network(rig).network
    time = run.read("time_s")["time_s"]
    at: dict[str, Floats] = {}
    efforts: dict[str, Floats] = {}
    for node in network.nodes():
        for values in run.read(f"scene.at.{node}").values():
            at[node] = values
    for name, place in network.grounds:
        at[name] = np.full(len(time), place)
    for name, port in scene_of(rig).ports.items():
        for values in run.read(f"master.{name}.position").values():
            at[name] = port.position_scale * values + port.offset
        for values in run.read(f"master.{name}.port_effort").values():
            efforts[name] = values
    energies = {
        name: values
        for name in (*ENERGIES, "hold", "residual", "numeric")
        for values in run.read(f"scene.{name}").values()
    }
    return SceneView(network, rig, time, at, efforts, energies)
