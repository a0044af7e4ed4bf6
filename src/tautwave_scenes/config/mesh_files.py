"""Mesh files of tissues: Gmsh 2.2 in ASCII by our own reader, other Gmsh and VTK files by meshio.

Physical groups of Gmsh come along by name, a group without one by its number.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from tautwave.errors import ConfigError
from tautwave.reading import read_file
from tautwave_scenes.models.tissue.gmsh import gmsh_mesh, numbered_mesh
from tautwave_scenes.models.tissue.mesh import Mesh

LARGEST_MESH = 64 * 1024 * 1024
"""[bytes] A million tetrahedra, many more than a run can step."""
ROOMS = {".msh": "gmsh", ".vtk": "vtk", ".vtu": "vtu"}
TETRAHEDRON = "tetra"
BOUNDARY = ("vertex", "line", "triangle")
PHYSICAL = "gmsh:physical"


def read_mesh(path: Path) -> Mesh:
    """Return the mesh in a file, in its own unit of length.

    Raises
    ------
    OSError
        It cannot be read.
    ConfigError
        meshio is needed, and not installed.
    ValueError
        It is damaged, or holds anything but linear tetrahedra.
    """
    data = read_file(path, LARGEST_MESH)
    room = ROOMS.get(path.suffix.lower())
    if room is None:
        known = ", ".join(ROOMS)
        raise ValueError(f"{path.name}: meshes are {known} files; convert it with meshio or Gmsh")
    head = data[:64].replace(b"\r\n", b"\n").split()
    if room == "gmsh" and head[1:2] and head[1].startswith(b"2") and head[2:3] == [b"0"]:
        return gmsh_mesh(data.decode("ascii"), path.name)
    return _by_meshio(path, room)


def _by_meshio(path: Path, room: str) -> Mesh:
    try:
        reader = importlib.import_module(f"meshio.{room}")
    except ImportError as err:
        raise ConfigError(
            f"{path.name} needs meshio: pip install 'tautwave[meshes]'; or save it from Gmsh as "
            "version 2 ASCII"
        ) from err
    try:
        read = reader.read(str(path))
    except Exception as err:  # whatever a foreign reader trips over in a damaged file
        reason = str(err) or type(err).__name__
        raise ValueError(f"{path.name} is damaged, or no mesh that meshio reads: {reason}") from err
    places = {
        at: (float(row[0]), float(row[1]), float(row[2]) if len(row) > 2 else 0.0)
        for at, row in enumerate(read.points.tolist())
    }
    names = {(int(tag), int(size)): name for name, (tag, size) in _named(read).items()}
    tags = read.cell_data.get(PHYSICAL, [()] * len(read.cells))
    tetrahedra: list[tuple[int, ...]] = []
    groups: dict[str, set[int]] = {}
    bodies: dict[str, list[int]] = {}
    for cells, own in zip(read.cells, tags, strict=True):
        corners = cells.data.tolist()
        begin = len(tetrahedra)
        if cells.type == TETRAHEDRON:
            tetrahedra += [tuple(one) for one in corners]
        elif cells.type not in BOUNDARY:
            raise ValueError(
                f"{path.name} holds {cells.type} cells: only linear tetrahedra are supported"
            )
        for number, (one, tag) in enumerate(zip(corners, own, strict=False)):
            if int(tag):
                name = names.get((int(tag), cells.dim), str(int(tag)))
                groups.setdefault(name, set()).update(one)
                if cells.type == TETRAHEDRON:
                    bodies.setdefault(name, []).append(begin + number)
    return numbered_mesh(path.name, places, tetrahedra, groups, bodies)


def _named(found: Any) -> dict[str, Any]:
    return {name: value for name, value in found.field_data.items() if len(value) == 2}
