"""The section of the page on a scene."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tautwave.report.html import folded, image, sound, table
from tautwave.report.run.parts import File, Part, Picture, Still
from tautwave.report.run.rundir import Run
from tautwave.report.units import plural
from tautwave.summary.markup import Markup
from tautwave_scenes.report.books import scene_table
from tautwave_scenes.report.files import shown

FOLDED = 15
"""Rows above which a scene's account is folded."""


def scene_parts(run: Run) -> Iterator[Part]:
    """Yield the figure of a scene, a still, its animation and sound, and its account."""
    yield Markup('<h2 id="scene">Scene</h2>')
    seen = shown(run)
    if seen is None:
        yield Markup('<p class="note">The scene was not recorded.</p>')
        return
    yield Markup('<p class="soft">{}</p>').format(seen.summary)
    yield Picture("scene", seen.figure(), "positions, efforts and energies of the scene")
    caption = "The scene at the largest force on the device."
    yield Still("scene-still", seen.still(False), seen.still(True), "the scene, drawn", caption)
    yield from _files(run.directory)
    account = scene_table(run)
    if len(account.rows) > FOLDED:
        title = f"{account.title}: {plural(len(account.rows), 'element')}"
        yield from folded(title, [table(account._replace(title=""))])
    else:
        yield table(account)


def _files(directory: Path) -> Iterator[Part]:
    moving, heard = directory / "scene.gif", directory / "output.wav"
    if moving.is_file():
        alt = "the scene, moving"
        yield Markup("<details><summary>The scene, moving</summary>")
        yield File(moving, lambda data: image(data, "gif", alt), "The scene, moving")
        yield Markup("</details>")
    if heard.is_file():
        label = "Sound: the force on the device, high-passed"
        yield File(heard, lambda data: sound(data, label), label)
