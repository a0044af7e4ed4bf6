"""Keys of walls in space, and the surfaces that they describe."""

from __future__ import annotations

import itertools
import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from tautwave.config.keys.arm import Point
from tautwave.config.keys.common import Block, NonNegative, Positive
from tautwave.laws.space.proxy import Surface, convex, cylinder, mesh, path, plane, sphere
from tautwave.models.chain.build import roll_pitch_yaw, turned

Plane4 = tuple[float, float, float, float]
Corner = Annotated[int, Field(ge=0)]


class ArmWall(Block):
    """A wall for the tip: a body that it cannot enter, or a path that it is led along."""

    shape: Literal["plane", "sphere", "cylinder", "box", "convex", "mesh", "path"] = Field(
        description="plane, sphere, cylinder, box, convex (planes), mesh (triangles): bodies; "
        "path: a line that the tip is led along."
    )
    stiffness: Positive = Field(description="[N/m]")
    damping: NonNegative = Field(
        default=0.0, description="[N s/m] Along the normal; the wall never pulls."
    )
    friction: NonNegative = Field(
        default=0.0, description="Coulomb coefficient on the surface; the tip sticks, then slides."
    )
    guard: bool = Field(
        default=False,
        description="A forbidden region that only keeps the tip out: nothing bounces off it.",
    )
    force_limit: Positive = Field(default=30.0, description="[N] Greatest force.")
    centre: Point = Field(
        default=(0.0, 0.0, 0.0), description="[m] A point of the plane or axis; the middle."
    )
    normal: Point | None = Field(default=None, description="plane: out of the body.")
    axis: Point | None = Field(default=None, description="cylinder: along it.")
    radius: Positive | None = Field(
        default=None,
        description="[m] sphere, cylinder; path: radius within which the tip moves freely.",
    )
    length: Positive | None = Field(default=None, description="[m] cylinder: default endless.")
    hollow: bool = Field(
        default=False, description="sphere, endless cylinder: the tip is kept inside."
    )
    size: tuple[Positive, Positive, Positive] | None = Field(
        default=None, description="[m] box: its edges."
    )
    turn: Point = Field(default=(0.0, 0.0, 0.0), description="[rad] box: roll, pitch, yaw.")
    planes: tuple[Plane4, ...] | None = Field(
        default=None, description="convex: normal out of the body and distance from 0, by face."
    )
    points: tuple[Point, ...] | None = Field(
        default=None, description="[m] mesh: corners; path: stations."
    )
    triangles: tuple[tuple[Corner, Corner, Corner], ...] | None = Field(
        default=None, description="mesh: corners of each, counted from 0, either way round."
    )

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        given = {key for key in OWN if getattr(self, key) is not None}
        needed = NEEDS[self.shape]
        lacking = [key for key in needed if key not in given]
        if lacking:
            raise PydanticCustomError(
                "shape",
                "{shape} needs {keys}",
                {"shape": self.shape, "keys": " and ".join(lacking)},
            )
        spare = given - set(needed) - set(MAY.get(self.shape, ()))
        if spare:
            raise PydanticCustomError(
                "shape",
                "{keys} does not apply to {shape}; remove it",
                {"shape": self.shape, "keys": ", ".join(sorted(spare))},
            )
        if self.shape == "path" and (self.friction or self.guard):
            raise PydanticCustomError("shape", "a path has neither friction nor guard")
        if self.hollow and (self.shape not in ("sphere", "cylinder") or self.length):
            raise PydanticCustomError("shape", "only a sphere or an endless cylinder is hollow")
        points = self.points or ()
        if any(corner >= len(points) for face in self.triangles or () for corner in face):
            raise PydanticCustomError("shape", "a triangle names a point that is not given")
        for shape, parts, what in (
            ("convex", self.planes, "a plane"),
            ("mesh", self.triangles, "a triangle"),
            ("path", points[1:], "two points"),
        ):
            if self.shape == shape and not parts:
                raise PydanticCustomError("shape", f"{shape} needs at least {what}")
        if self.shape == "path" and any(a == b for a, b in itertools.pairwise(points)):
            raise PydanticCustomError("shape", "two consecutive points of a path are identical")
        for number, face in enumerate(self.triangles or ()):
            if _is_flat(*(points[corner] for corner in face)):
                raise PydanticCustomError(
                    "shape", "triangle {number} has no area", {"number": number}
                )
        for vector in (self.normal, self.axis, *(face[:3] for face in self.planes or ())):
            if vector is not None and not any(vector):
                raise PydanticCustomError("shape", "a direction of length 0")
        return self

    def surface(self) -> Surface:
        """Return the surface as a law takes it."""
        if self.shape == "plane" and self.normal is not None:
            return plane(self.centre, self.normal)
        if self.shape == "sphere" and self.radius is not None:
            return sphere(self.centre, self.radius, hollow=self.hollow)
        if self.shape == "cylinder" and self.axis is not None and self.radius is not None:
            return cylinder(
                self.centre, self.axis, self.radius, self.length or 0.0, hollow=self.hollow
            )
        if self.shape == "box" and self.size is not None:
            turn = roll_pitch_yaw(*self.turn)
            faces = []
            for k in range(3):
                for sign in (1.0, -1.0):
                    unit = tuple(sign if i == k else 0.0 for i in range(3))
                    normal = turned(turn, unit)  # type: ignore[arg-type]
                    at = sum(n * c for n, c in zip(normal, self.centre, strict=True))
                    faces.append((*normal, at + 0.5 * self.size[k]))
            return convex(faces)
        if self.shape == "convex":
            return convex(self.planes or ())
        if self.shape == "mesh":
            return mesh(self.points or (), self.triangles or ())
        return path(self.points or (), self.radius or 0.0)


def _is_flat(a: Point, b: Point, c: Point) -> bool:
    """Return whether three corners are in a line."""
    ux, uy, uz = (p - q for p, q in zip(b, a, strict=True))
    vx, vy, vz = (p - q for p, q in zip(c, a, strict=True))
    across = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
    return math.hypot(*across) <= 1e-9 * math.hypot(ux, uy, uz) * math.hypot(vx, vy, vz)


OWN = ("normal", "axis", "radius", "length", "size", "planes", "points", "triangles")
NEEDS = {
    "plane": ("normal",),
    "sphere": ("radius",),
    "cylinder": ("axis", "radius"),
    "box": ("size",),
    "convex": ("planes",),
    "mesh": ("points", "triangles"),
    "path": ("points",),
}
MAY = {"cylinder": ("length",), "path": ("radius",)}
