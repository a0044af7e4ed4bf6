"""`scene` with `dimension: 3`: a network of points with links along the line between their ends.

The keys are those of `tautwave_scenes.config.keys`, with vectors [x, y, z] where a number was one
coordinate; z points upwards. Groups may have rows, which makes a net of them.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import Block, Name, NonNegative, Positive
from tautwave.config.keys.control import ControlKeys
from tautwave.errors import ConfigError
from tautwave_scenes.config.keys import (
    ContactLink,
    DamperLink,
    FadeIn,
    FadeOut,
    HoldLimit,
    NoiseForce,
    OtherLink,
    Scene,
    SceneOutput,
    SineForce,
    SoundForce,
    SpringLink,
    TapForce,
)
from tautwave_scenes.config.mesh_files import read_mesh
from tautwave_scenes.config.solid_files import read_solid
from tautwave_scenes.models.solid import Solid, placed_solid
from tautwave_scenes.models.tissue.mesh import CELL, MAX_TETRAHEDRA, Mesh, block, on_faces, placed

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
Count = Annotated[int, Field(ge=1, le=1000)]


class Mass3d(Block):
    """A point with a mass, a row of them, or a net of rows."""

    mass: Positive = Field(description="[kg] Mass of each.")
    count: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=1, description="Number in a row: NAME1, NAME2, ... if more than one in all."
    )
    rows: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=1, description="Number of rows; numbering continues from row to row."
    )
    position: Vector = Field(default=ZERO, description="[m] Start position of the first.")
    spacing: Vector = Field(
        default=ZERO, description="[m] Offset from each to the next in its row."
    )
    row_spacing: Vector = Field(default=ZERO, description="[m] Offset from each row to the next.")
    velocity: Vector = Field(default=ZERO, description="[m/s] Start velocity.")
    damping: NonNegative = Field(default=0.0, description="[N s/m] Damping of each to ground.")
    clamped: bool = Field(
        default=False, description="The rim is fixed: both ends of a row, all four sides of a net."
    )


class Cells(Block):
    """A box cut into cells, each of five tetrahedra."""

    size: tuple[Positive, Positive, Positive] = Field(description="[m] Edges along x, y and z.")
    cells: tuple[Count, Count, Count] = Field(description="Number of cells along each edge.")

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        count = CELL * math.prod(self.cells)
        if count > MAX_TETRAHEDRA:
            raise PydanticCustomError(
                "count",
                "{count} tetrahedra; {most} are the limit",
                {"count": count, "most": MAX_TETRAHEDRA},
            )
        return self


class Branch(Block):
    """A spring in series with a damper, beside the tissue's own spring."""

    share: Positive = Field(description="Its moduli, as a share of the tissue's own.")
    time_s: Positive = Field(description="[s] Time in which its stress falls to 1/e.")


class Inclusion(Block):
    """A part of a tissue that is of another material; what it does not state is the tissue's."""

    young: Positive = Field(description="[Pa] Young's modulus, once all branches have relaxed.")
    poisson: Annotated[float, Field(ge=0.0, le=0.49)] | None = Field(
        default=None, description="Poisson's ratio."
    )
    density: Positive | None = Field(default=None, description="[kg/m^3] Density.")


class Tissue3d(Block):
    """A soft body of tetrahedra that turn with their motion; its nodes are NAME1, NAME2, ..."""

    block: Cells | None = Field(default=None, description="A box; or give `mesh`.")
    mesh: str | None = Field(
        default=None,
        description="Gmsh (.msh) or VTK (.vtk, .vtu) file of tetrahedra; or give `block`. All but "
        "Gmsh 2.2 in ASCII need meshio (`tautwave[meshes]`).",
    )
    scale: Positive = Field(default=1.0, description="[m] Length of the mesh file's unit.")
    position: Vector = Field(default=ZERO, description="[m] Where the mesh's origin is.")
    young: Positive = Field(description="[Pa] Young's modulus, once all branches have relaxed.")
    poisson: Annotated[float, Field(ge=0.0, le=0.49)] = Field(description="Poisson's ratio.")
    density: Positive = Field(description="[kg/m^3] Density.")
    viscous_s: NonNegative = Field(
        default=0.0, description="[s] Damping inside, as a share of the stiffness."
    )
    branches: list[Branch] = Field(
        default_factory=list, description="Relaxation: one for Kelvin and Boltzmann's solid."
    )
    damping: NonNegative = Field(
        default=0.0, description="[1/s] Damping to ground, as a share of the mass."
    )
    inclusions: dict[str, Inclusion] = Field(
        default_factory=dict,
        description="Parts of another material, such as a tumour: physical groups of tetrahedra of "
        "its mesh file, by name.",
    )
    clamped: list[str] = Field(
        default_factory=list,
        description="Whose nodes are fixed: faces of the box around it (-x, +x, -y ...), or "
        "physical groups of its mesh file by name.",
    )


class Solid3d(Block):
    """A solid that does not move, a wall of any shape: links of type contact end at it."""

    mesh: str = Field(
        description="STL (ASCII, binary) or OBJ file of its surface, which has to be closed."
    )
    scale: Positive = Field(
        default=1.0, description="[m] Length of the mesh file's unit: 0.001 for mm."
    )
    turn: Vector = Field(
        default=ZERO, description="[rad] Rotation vector by which the file's shape is turned first."
    )
    position: Vector = Field(default=ZERO, description="[m] Where the mesh's origin is.")


class ContactLink3d(ContactLink):
    """A contact of two spheres, or of a point and a plane or a solid, that only pushes."""

    gap: float = Field(
        default=0.0, description="[m] Contact begins below this distance: the sum of both radii."
    )
    normal: Vector | None = Field(
        default=None, description="The second end is a plane; direction of its outward normal."
    )


Link3d = Annotated[SpringLink | DamperLink | ContactLink3d | OtherLink, Field(discriminator="type")]


class Port3d(Block):
    """A point that one to three axes move; `to` couples it by a spring.

    With `points` it is a rigid tool, which `turns` turn as well.
    """

    axes: Annotated[list[Name], Field(min_length=1, max_length=3)] | None = Field(
        default=None, description="Axes of the master that move it; default: that of its name."
    )
    directions: Annotated[list[Vector], Field(min_length=1, max_length=3)] | None = Field(
        default=None,
        description="Direction in which each axis moves it, of any length; default: x, y and z.",
    )
    turns: Annotated[dict[Name, Vector], Field(min_length=1, max_length=3)] | None = Field(
        default=None,
        description="Rotary axes of the master that turn it, each with the direction of its part "
        "of the rotation vector; needs `points`.",
    )
    points: Annotated[list[Vector], Field(min_length=1, max_length=100)] | None = Field(
        default=None,
        description="[m] Points of a rigid tool, in its own axes: nodes NAME1, NAME2, ...",
    )
    to: Name | None = Field(default=None, description="Node the coupling spring ends at.")
    stiffness: Positive | None = Field(
        default=None, description="[N/m] Coupling spring k_c; required with `to`."
    )
    damping: NonNegative = Field(default=0.0, description="[N s/m] Beside k_c.")
    position_scale: Positive = Field(
        default=1.0, description="Motion in the scene per motion of the axes; power is kept."
    )
    offset: Vector = Field(
        default=ZERO, description="[m] Position in the scene that corresponds to axes at 0."
    )


class Sine3d(SineForce):
    """A tone along a direction."""

    direction: Vector = Field(
        default=(0.0, 0.0, 1.0), description="Direction; its length does not matter."
    )


class Noise3d(NoiseForce):
    """Noise along a direction."""

    direction: Vector = Field(
        default=(0.0, 0.0, 1.0), description="Direction; its length does not matter."
    )


class Taps3d(TapForce):
    """Taps along a direction."""

    direction: Vector = Field(
        default=(0.0, 0.0, 1.0), description="Direction; its length does not matter."
    )


class Sound3d(SoundForce):
    """A sound along a direction."""

    direction: Vector = Field(
        default=(0.0, 0.0, 1.0), description="Direction; its length does not matter."
    )


Force3d = Annotated[Sine3d | Noise3d | Taps3d | Sound3d, Field(discriminator="type")]


class Scene3d(ControlKeys):
    """A network of points in three dimensions under the hand."""

    dimension: Literal[3] = Field(description="3: points in space; leave it out for one dimension.")
    scheme: Literal["symplectic", "discrete_gradient", "linearly_implicit"] = Field(
        default="discrete_gradient",
        description="symplectic: the standard one, w T < 2; discrete_gradient: keeps energy, "
        "momentum and angular momentum at any stiffness; linearly_implicit: the same with one "
        "linear solve a step, the energy that it creates is accounted for.",
    )
    engine: Literal["auto", "python", "compiled"] = Field(
        default="auto", description="Execution engine; results are bit-identical."
    )
    gravity: float | Vector = Field(
        default=0.0, description="[m/s^2] A number: downward, along -z; or a vector."
    )
    masses: dict[Name, Mass3d] = Field(default_factory=dict, description="By name.")
    tissues: dict[Name, Tissue3d] = Field(
        default_factory=dict, description="Soft bodies of tetrahedra, by name."
    )
    solids: dict[Name, Solid3d] = Field(
        default_factory=dict, description="Walls of any shape, by name."
    )
    grounds: dict[Name, Vector] = Field(
        default_factory=dict, description="[m] Fixed nodes by name; `ground` is at the origin."
    )
    links: dict[Name, Link3d] = Field(default_factory=dict, description="By name.")
    ports: Annotated[dict[Name, Port3d], Field(min_length=1)] = Field(
        description="Points that axes of the master move, by name."
    )
    forces: dict[Name, Force3d] = Field(
        default_factory=dict, description="External forces on masses, by name."
    )
    record: list[Name] = Field(
        default_factory=list,
        description="Masses to keep and record even if they affect no port.",
    )
    output: SceneOutput = Field(default_factory=SceneOutput, description="Audio output.")
    hold_limit_j: HoldLimit = None
    engage_ramp_s: FadeIn = 0.2
    release_ramp_s: FadeOut = 0.2

    def size_of(self, name: str) -> int:
        """Return how many nodes a name stands for."""
        if name in self.tissues:
            return len(mesh_of(self.tissues[name]).nodes)
        if name in self.ports:
            return len(self.ports[name].points or [ZERO])
        mass = self.masses.get(name)
        return 1 if mass is None else mass.count * mass.rows

    def group_of(self, name: str) -> str:
        """Return the block of masses that a node, such as knot25, belongs to; else the name."""
        bare = name.rstrip("0123456789")
        for end in range(len(name) - 1, len(bare) - 1, -1):  # a group's own name may end in digits
            group, number = name[:end], name[end:]
            size = self.size_of(group)
            if name not in self.masses and number[0] != "0" and 1 < size >= int(number):
                return group
        return name

    def nodes_of(self, name: str) -> list[str]:
        """Return the nodes a name stands for, row by row; a node stands for itself."""
        size = self.size_of(name)
        return [name] if size == 1 else [f"{name}{at + 1}" for at in range(size)]

    def rim_of(self, name: str) -> set[str]:
        """Return the nodes of a group, or of a node's group, that are clamped."""
        name = self.group_of(name)
        if name in self.tissues:
            keys_of = self.tissues[name]
            fixed = on_faces(mesh_of(keys_of), keys_of.clamped)
            return {f"{name}{node + 1}" for node in fixed}
        keys = self.masses.get(name)
        if keys is None or not keys.clamped:
            return set()
        across, down = keys.count, keys.rows
        return {
            node
            for at, node in enumerate(self.nodes_of(name))
            if (across > 1 and at % across in (0, across - 1))
            or (down > 1 and at // across in (0, down - 1))
            or across * down == 1
        }

    def movers_of(self, name: str) -> list[str]:
        """Return the axes that move a port."""
        return self.ports[name].axes or [name]

    def axes_of(self, name: str) -> list[str]:
        """Return the axes that move a port, then those that turn it."""
        return [*self.movers_of(name), *(self.ports[name].turns or {})]

    def axes(self) -> list[str]:
        """Return the axes of all ports."""
        return [axis for name in self.ports for axis in self.axes_of(name)]


def mesh_of(keys: Tissue3d) -> Mesh:
    """Return the mesh of a tissue in the scene, of which either `block` or `mesh` is given.

    Raises
    ------
    ConfigError
        The file cannot be read, or is no mesh of tetrahedra.
    """
    if keys.mesh is not None:
        path = Path(keys.mesh)
        try:
            mesh = _read_mesh(path, path.stat().st_mtime_ns)
        except OSError as err:
            raise ConfigError(f"{path.name} cannot be read: {err.strerror}") from err
        except UnicodeDecodeError as err:
            wanted = "save it from Gmsh as version 2 ASCII"
            raise ConfigError(f"{path.name} is not ASCII as it says; {wanted}") from err
        except ValueError as err:
            raise ConfigError(str(err)) from err
        return placed(mesh, keys.scale, keys.position)
    assert keys.block is not None
    return block(keys.block.size, keys.block.cells, keys.position)


def surface_keys(keys: Solid3d) -> Solid:
    """Return the surface of a solid in the scene.

    Raises
    ------
    ConfigError
        The file cannot be read, or encloses nothing.
    """
    path = Path(keys.mesh)
    try:
        solid = _read_solid(path, path.stat().st_mtime_ns)
    except OSError as err:
        raise ConfigError(f"{path.name} cannot be read: {err.strerror}") from err
    except ValueError as err:
        raise ConfigError(str(err)) from err
    return placed_solid(solid, keys.scale, keys.turn, keys.position)


@functools.lru_cache(maxsize=8)
def _read_solid(path: Path, _: int) -> Solid:
    return read_solid(path)


@functools.lru_cache(maxsize=8)
def _read_mesh(path: Path, _: int) -> Mesh:
    return read_mesh(path)


def scene_kind(value: Any) -> str:
    """Return which block a `scene` is: `Scene3d` if its dimension is 3, else `Scene`."""
    spatial = isinstance(value, dict) and value.get("dimension") == 3
    return "Scene3d" if spatial or isinstance(value, Scene3d) else "Scene"


AnyScene = Annotated[
    Annotated[Scene, Tag("Scene")] | Annotated[Scene3d, Tag("Scene3d")],
    Discriminator(scene_kind),
]
