"""The output of a run with a scene: figure, still, animation, sound; in one dimension and three."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tautwave.report.run.rundir import Run, block
from tautwave.report.units import count, plural

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tautwave_scenes.report.view import SceneView
    from tautwave_scenes.report3d.view import View3d


class Shown(NamedTuple):
    """A recorded scene: one line about it, and the functions that draw it.

    `still` takes whether the background is dark, `animate` a path.
    """

    view: SceneView | View3d
    summary: str
    figure: Callable[[], Figure]
    still: Callable[[bool], bytes]
    animate: Callable[[Path], None]


def shown(run: Run) -> Shown | None:
    """Return a run's recorded scene, None if nothing was recorded."""
    return _scene3d(run) if block(run.rig, "scene").get("dimension") == 3 else _line(run)


def _line(run: Run) -> Shown | None:
    from tautwave_scenes.report import drawing, figure
    from tautwave_scenes.report.view import view_scene

    view = view_scene(run)
    if view is None:
        return None
    network = view.network
    parts = _parts(len(network.masses), len(network.strings), len(network.links))
    text = f"{parts} under {', '.join(network.ports)}."
    return Shown(
        view,
        text,
        partial(figure.scene_figure, view),
        partial(drawing.still, view),
        partial(drawing.write_animation, view),
    )


def _scene3d(run: Run) -> Shown | None:
    from tautwave_scenes.report3d import drawing, figure
    from tautwave_scenes.report3d.view import view_scene3d

    view = view_scene3d(run)
    if view is None:
        return None
    network = view.network
    ports = ", ".join(f"{name} ({', '.join(axes)})" for name, axes in network.grips)
    text = f"{_parts(len(network.masses), 0, len(network.links))} in space under {ports}."
    return Shown(
        view,
        text,
        partial(figure.figure3d, view),
        partial(drawing.still3d, view),
        partial(drawing.write_animation3d, view),
    )


def _parts(masses: int, strings: int, links: int) -> str:
    mass = "mass" if masses == 1 else "masses"
    nodes = [f"{count(masses)} {mass}"] if masses else []
    nodes += [plural(strings, "string")] if strings else []
    return " and ".join(
        [", ".join(nodes), plural(links, "link")] if nodes else [plural(links, "link")]
    )


def write_scene(run: Run) -> None:
    """Write scene.gif and output.wav into the directory of a run that had a scene."""
    from tautwave_scenes.report.sound import write_sound

    seen = shown(run)
    if seen is None or not seen.view.efforts or len(seen.view.time) < 2:
        return
    write_sound(seen.view, run.directory / "output.wav")
    seen.animate(run.directory / "scene.gif")
