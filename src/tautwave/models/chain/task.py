"""The tip of a serial chain as six coordinates: where it is and how it is turned; SI units.

x, y and z are its way from home along the axes of a frame; rx, ry and rz the rotation vector, in
that frame, that leads from its orientation at home to the present one. Both are functions of the
joints' positions alone, so that nothing drifts, and an effort on a coordinate is held by the
joints' efforts J^T F, J its derivative. Only half turns from home are singular; where the chain is,
an effort in a lost direction is not felt.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tautwave.models.chain.kinematics import chain_frames, fill_jacobian, tip_pose
from tautwave.models.chain.params import ChainParams

COORDINATES = 6
SMALL = 1e-4
"""Angle [rad] below which series take the place of quotients."""


class TaskParams(NamedTuple):
    """A chain, and the axes of the coordinates and of the tip at home, in base axes [1]."""

    chain: ChainParams
    frame: tuple[float, ...]
    """The axes x, y, z of the coordinates, 9 floats."""

    home: tuple[float, ...]
    """The tip's position, x, y and z axis at home, 12 floats."""


def at_home(chain: ChainParams, frame: tuple[float, ...], home: Any) -> TaskParams:
    """Return the constants of a tip; `frame` are three axes, 9 floats, `home` joint positions."""
    pose = tip_pose(chain, chain_frames(chain, home))
    return TaskParams(chain, frame, pose)


def task_place(c: TaskParams, q: Any, out: Any) -> tuple[float, float, float, float, float, float]:
    """Return the coordinates at the joint positions `q`; fill `out` with their derivatives.

    `out` has six floats per joint: what each coordinate changes by per unit of its motion.
    """
    frames = chain_frames(c.chain, q)
    pose = tip_pose(c.chain, frames)
    fill_jacobian(frames, pose, out)
    px, py, pz, ax, ay, az, bx, by, bz, cx, cy, cz = pose
    xx, xy, xz, yx, yy, yz, zx, zy, zz = c.frame
    hx, hy, hz, hax, hay, haz, hbx, hby, hbz, hcx, hcy, hcz = c.home
    px = px - hx
    py = py - hy
    pz = pz - hz
    # Twice the sine times the axis of R R_home^T, and its trace.
    sx = (az * hay - ay * haz) + (bz * hby - by * hbz) + (cz * hcy - cy * hcz)
    sy = (ax * haz - az * hax) + (bx * hbz - bz * hbx) + (cx * hcz - cz * hcx)
    sz = (ay * hax - ax * hay) + (by * hbx - bx * hby) + (cy * hcx - cx * hcy)
    trace = ax * hax + ay * hay + az * haz
    trace = trace + bx * hbx + by * hby + bz * hbz
    trace = trace + cx * hcx + cy * hcy + cz * hcz
    sine = 0.5 * math.sqrt(sx * sx + sy * sy + sz * sz)
    angle = math.atan2(sine, 0.5 * (trace - 1.0))
    half = 0.5
    bend = 1.0 / 12.0
    if angle > SMALL and sine > 0.0:
        half = 0.5 * angle / sine
        bend = (1.0 - 0.5 * angle * sine / (1.0 - 0.5 * (trace - 1.0))) / (angle * angle)
    tx = half * sx
    ty = half * sy
    tz = half * sz
    for k in range(0, COORDINATES * len(c.chain.joints), COORDINATES):
        vx = out[k]
        vy = out[k + 1]
        vz = out[k + 2]
        wx = out[k + 3]
        wy = out[k + 4]
        wz = out[k + 5]
        # Inverse of the left Jacobian of the rotation group, on the angular velocity.
        ux = ty * wz - tz * wy
        uy = tz * wx - tx * wz
        uz = tx * wy - ty * wx
        wx = wx - 0.5 * ux + bend * (ty * uz - tz * uy)
        wy = wy - 0.5 * uy + bend * (tz * ux - tx * uz)
        wz = wz - 0.5 * uz + bend * (tx * uy - ty * ux)
        out[k] = xx * vx + xy * vy + xz * vz
        out[k + 1] = yx * vx + yy * vy + yz * vz
        out[k + 2] = zx * vx + zy * vy + zz * vz
        out[k + 3] = xx * wx + xy * wy + xz * wz
        out[k + 4] = yx * wx + yy * wy + yz * wz
        out[k + 5] = zx * wx + zy * wy + zz * wz
    return (
        xx * px + xy * py + xz * pz,
        yx * px + yy * py + yz * pz,
        zx * px + zy * py + zz * pz,
        xx * tx + xy * ty + xz * tz,
        yx * tx + yy * ty + yz * tz,
        zx * tx + zy * ty + zz * tz,
    )


def joint_efforts(jacobian: Any, efforts: Any, out: Any) -> None:
    """Fill `out` with the joints' efforts J^T F that hold six efforts on the coordinates."""
    for j in range(len(out)):
        k = COORDINATES * j
        total = 0.0
        for i in range(COORDINATES):
            total = total + jacobian[k + i] * efforts[i]
        out[j] = total


def home_place(c: TaskParams) -> tuple[float, float, float]:
    """Return where home is from the base's origin, along the axes of the coordinates [m]."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = c.frame
    px, py, pz = c.home[:3]
    return (
        xx * px + xy * py + xz * pz,
        yx * px + yy * py + yz * pz,
        zx * px + zy * py + zz * pz,
    )
