"""Which mesh files the tissues and solids of a scene name."""

from __future__ import annotations

from tautwave.config.inputs.recordings import find_recording
from tautwave.config.text.document import Document


def name_meshes(document: Document) -> None:
    """Make the paths of mesh files absolute; relative ones start at the rig file."""
    for kind in ("tissues", "solids"):
        bodies = document.get(("scene", kind))
        for name, keys in bodies.items() if isinstance(bodies, dict) else ():
            file = keys.get("mesh") if isinstance(keys, dict) else None
            if isinstance(file, str):
                absolute = find_recording(document, ("scene", kind, name, "mesh"), file)
                keys["mesh"] = str(absolute or (document.folder / file).resolve())
