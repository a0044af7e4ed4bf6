"""`arm` of a side: its axes as the joints of a serial chain, from base to tip, and what it weighs.

The simulated truth of an arm has the same keys.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import Block, Name, NonNegative
from tautwave.config.keys.load import REFLECTED
from tautwave.models.chain.build import is_inertia

Point = tuple[float, float, float]
NOWHERE: Point = (0.0, 0.0, 0.0)
Moments = tuple[float, float, float, float, float, float]


def _check_inertia(moments: Moments) -> Moments:
    if not is_inertia(*moments):
        raise PydanticCustomError("inertia", "not physically possible for a rigid body")
    return moments


class DhRow(Block):
    """One joint and its link by Denavit and Hartenberg's classic parameters.

    A turn about z by `theta` and the joint's position, a shift along z by `d`, one along x by `a`,
    a turn about x by `alpha`. Masses are given in the frame that these lead to.
    """

    kind: Literal["revolute", "prismatic"] = Field(
        default="revolute", description="For prismatic joints, the position adds to `d`."
    )
    theta: float = Field(default=0.0, description="[rad] Rotation about z at position 0.")
    d: float = Field(default=0.0, description="[m] Shift along z.")
    a: float = Field(default=0.0, description="[m] Shift along x.")
    alpha: float = Field(default=0.0, description="[rad] Turn about x.")
    mass: NonNegative = Field(default=0.0, description="[kg] Of the link.")
    centre: Point = Field(default=NOWHERE, description="[m] Centre of mass.")
    inertia: Annotated[Moments, AfterValidator(_check_inertia)] = Field(
        default=(0.0,) * 6,
        description="[kg m^2] About the centre of mass: xx, yy, zz, xy, xz, yz.",
    )


class Payload(Block):
    """A load held at the tip."""

    mass: NonNegative = Field(description="[kg]")
    centre: Point = Field(default=NOWHERE, description="[m] In the tip's frame.")


class Chain(Block):
    """A serial chain, whose joints are a side's axes: by their names, or in a stated order."""

    urdf: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="URDF file with the chain; a relative path is resolved against "
        "the rig file's directory. "
        "Either this or `dh`.",
    )
    tip: str | None = Field(
        default=None,
        description="URDF link of the tip; default: the link after the last moving joint, in a "
        "file without branches. What moves beside the path to it is held.",
    )
    base: str | None = Field(
        default=None, description="URDF link that the chain stands on; default: the file's root."
    )
    held: dict[str, float] = Field(
        default_factory=dict,
        description="[rad | m] Where joints of the URDF beside the chain are held; default: 0.",
    )
    order: Literal["base_to_tip"] | None = Field(
        default=None,
        description="The axes are listed in the order of the URDF's joints, from base to tip. "
        "Default: an axis is the joint that its `joint` names, or that of its own name.",
    )
    dh: tuple[DhRow, ...] | None = Field(
        default=None,
        description="The chain as rows of classic Denavit-Hartenberg parameters, a row for each "
        "axis in their order, from base to tip.",
    )
    gravity: Point = Field(
        default=(0.0, 0.0, -9.80665), description="[m/s^2] In the base frame of the chain."
    )
    payload: Payload | None = Field(default=None, description="Payload at the tip; default: none.")

    def __hash__(self) -> int:
        """Return a hash, by which what was made of a chain is found again; a mapping has none."""
        return hash((self.urdf, self.tip, self.base, self.dh, self.gravity, self.payload))

    @model_validator(mode="after")
    def _check_source(self) -> Self:
        if (self.urdf is None) == (not self.dh):
            raise PydanticCustomError("order", "give either urdf, or dh with one row for each axis")
        if self.tip is not None and self.urdf is None:
            raise PydanticCustomError("order", "tip applies to a URDF only; remove it")
        if (self.base is not None or self.held) and self.urdf is None:
            raise PydanticCustomError("order", "base and held apply to a URDF only; remove them")
        if self.order is not None and self.urdf is None:
            raise PydanticCustomError("order", "rows of dh are in that order anyway; remove order")
        return self


class Arm(Chain):
    """A side's axes as the joints of an arm, and what is assumed about its weight."""

    compensate: bool = Field(
        default=True,
        description="Compensate for the arm's weight outside the coupling; false: the coupling "
        "carries it.",
    )
    reflect_load: bool = Field(default=False, description=REFLECTED)
    payloads: dict[Name, Payload] = Field(
        default_factory=dict,
        description="Payloads that the command `payload NAME` of an operated rig selects instead "
        "of `payload` while the arm is at rest.",
    )


class SideArm(NamedTuple):
    """One arm of a rig.

    Attributes
    ----------
    name : str
        `master` or `slave`, or of several arms of that side its full name, such as `master.left`.
    keys : Arm
        Its own.
    axes : tuple of str
        Full names of its joints' axes, from base to tip.
    """

    name: str
    keys: Arm
    axes: tuple[str, ...]


def axis_prefix(arm: str) -> str:
    """Return what the names of all axes of one of several arms begin with: `left_` for `left`."""
    return f"{arm}_"


def axes_of_arm(arm: str, axes: Iterable[str]) -> tuple[str, ...]:
    """Return those of a side's axes, by name, that are joints of one of its several arms."""
    return tuple(name for name in axes if name.startswith(axis_prefix(arm)))
