"""Constants of a serial chain: turning and sliding joints, the bodies between them; SI units.

Every joint has a frame whose z axis is the joint's; its x axis is chosen so that the next joint's
frame follows by a shift, one fixed turn about x and the joint's own turn about z. So a joint costs
two plane rotations, whatever its origin and axis are in the file it comes from.
"""

from __future__ import annotations

from typing import NamedTuple


class JointParams(NamedTuple):
    """One joint and the body that it moves.

    From the frame before: shift by `x, y, z` [m], turn about x by the angle whose cosine and sine
    are `ca, sa`, then about z by `offset` [rad], plus the joint's position where `turns`; else the
    joint slides along z. The body has `mass` [kg], first moments `mx, my, mz` [kg m] in the
    joint's frame, and the inertia about that frame's origin [kg m^2], `ixy` and so on as in the
    matrix: minus the second moment.
    """

    ca: float
    sa: float
    x: float
    y: float
    z: float
    offset: float
    turns: bool
    mass: float
    mx: float
    my: float
    mz: float
    ixx: float
    iyy: float
    izz: float
    ixy: float
    ixz: float
    iyz: float


class TipParams(NamedTuple):
    """From the last joint's frame to the tip: shift, turn about x, turn about z (cosine, sine)."""

    ca: float
    sa: float
    x: float
    y: float
    z: float
    cz: float
    sz: float


class ChainParams(NamedTuple):
    """A serial chain: x axis of the frame before the first joint, gravity [m/s^2], joints, tip.

    That frame lies in the base: `cb, sb` are cosine and sine of its turn about the base's z.

    `carried` are the augmented bodies: each joint's own with the mass of all bodies beyond at the
    origin of the next joint, a sliding one at 0. Ten floats in the joint's frame: that mass with
    its own [kg], first moments x, y, z [kg m], inertia xx, yy, zz, xy, xz, yz [kg m^2].
    """

    cb: float
    sb: float
    gx: float
    gy: float
    gz: float
    joints: tuple[JointParams, ...]
    carried: tuple[tuple[float, ...], ...]
    tip: TipParams
