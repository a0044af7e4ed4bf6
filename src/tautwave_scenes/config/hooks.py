"""`scene` in the rig file: what `tautwave.config.hooks` asks for."""

from __future__ import annotations

from typing import Any

from tautwave.config.inputs.recordings import find_recording
from tautwave.config.keys.control import ControlKeys
from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document
from tautwave_scenes.config.checks import check_scene
from tautwave_scenes.config.checks3d import check_dimension, check_scene3d
from tautwave_scenes.config.keys import Scene
from tautwave_scenes.config.keys3d import AnyScene, Scene3d, scene_kind
from tautwave_scenes.config.sounds import complete_sound

__all__ = ["blocks", "check", "complete", "model_for", "name_files"]


def model_for(value: Any) -> type[ControlKeys]:
    """Return the block for a value of the file: by its dimension."""
    return Scene3d if scene_kind(value) == Scene3d.__name__ else Scene


def blocks() -> Any:
    """Return the type of the key."""
    return AnyScene


def check(document: Document, parts: Parts) -> None:
    """Note mistakes in a scene that is valid block by block."""
    check_dimension(document)
    if isinstance(parts.scene, Scene):
        check_scene(document, parts, parts.scene)
    if isinstance(parts.scene, Scene3d):
        check_scene3d(document, parts, parts.scene)


def complete(document: Document, keys: ControlKeys) -> ControlKeys:
    """Return a scene with its output's port, and the paths and hashes of its sounds."""
    assert isinstance(keys, Scene | Scene3d)
    axes = keys.axes() if isinstance(keys, Scene3d) else list(keys.ports)
    port = keys.output.port or axes[0]
    forces = {
        name: complete_sound(document, name, force) if force.type == "sound" else force
        for name, force in keys.forces.items()
    }
    output = keys.output.model_copy(update={"port": port})
    return keys.model_copy(update={"output": output, "forces": forces})


def name_files(document: Document) -> None:
    """Make the paths of mesh files absolute; relative ones start at the rig file."""
    for kind in ("tissues", "solids"):
        bodies = document.get(("scene", kind))
        for name, keys in bodies.items() if isinstance(bodies, dict) else ():
            file = keys.get("mesh") if isinstance(keys, dict) else None
            if isinstance(file, str):
                absolute = find_recording(document, ("scene", kind, name, "mesh"), file)
                keys["mesh"] = str(absolute or (document.folder / file).resolve())
