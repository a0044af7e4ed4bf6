"""Which mesh files the tissues of a scene name."""

from __future__ import annotations

from tautwave.config.inputs.recordings import find_recording
from tautwave.config.text.document import Document


def name_meshes(document: Document) -> None:
    """Make the paths of mesh files absolute; relative ones start at the rig file."""
    tissues = document.get(("scene", "tissues"))
    for name, keys in tissues.items() if isinstance(tissues, dict) else ():
        file = keys.get("mesh") if isinstance(keys, dict) else None
        if isinstance(file, str):
            absolute = find_recording(document, ("scene", "tissues", name, "mesh"), file)
            keys["mesh"] = str(absolute or (document.folder / file).resolve())
