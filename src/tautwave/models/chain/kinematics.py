"""Where the joints and the tip of a serial chain are, and how they move; SI units, base frame."""

from __future__ import annotations

import math
from typing import Any

from tautwave.models.chain.params import ChainParams


def chain_frames(c: ChainParams, q: Any) -> Any:
    """Return the frame of every joint at the positions `q` [rad or m].

    Returns
    -------
    list of tuple
        Per joint cosine and sine of its turn about z, its x, y and z axis and its origin [m], 14
        floats, and whether it turns.
    """
    xx = c.cb
    xy = c.sb
    xz = 0.0
    yx = -c.sb
    yy = c.cb
    yz = 0.0
    zx = 0.0
    zy = 0.0
    zz = 1.0
    px = 0.0
    py = 0.0
    pz = 0.0
    frames = []
    i = 0
    for joint in c.joints:
        ca, sa, ox, oy, oz, angle, turns = joint[:7]
        px = px + xx * ox + yx * oy + zx * oz
        py = py + xy * ox + yy * oy + zy * oz
        pz = pz + xz * ox + yz * oy + zz * oz
        ux = ca * yx + sa * zx
        uy = ca * yy + sa * zy
        uz = ca * yz + sa * zz
        zx = ca * zx - sa * yx
        zy = ca * zy - sa * yy
        zz = ca * zz - sa * yz
        at = q[i]
        if turns:
            angle = angle + at
        else:
            px = px + at * zx
            py = py + at * zy
            pz = pz + at * zz
        cq = math.cos(angle)
        sq = math.sin(angle)
        yx = cq * ux - sq * xx
        yy = cq * uy - sq * xy
        yz = cq * uz - sq * xz
        xx = cq * xx + sq * ux
        xy = cq * xy + sq * uy
        xz = cq * xz + sq * uz
        frames.append((cq, sq, xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz, turns))
        i = i + 1
    return frames


def tip_pose(c: ChainParams, frames: Any) -> tuple[float, ...]:
    """Return the tip's position [m], then its x, y and z axis, 12 floats."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz, _ = frames[-1][2:]
    ca, sa, ox, oy, oz, cq, sq = c.tip
    ux = ca * yx + sa * zx
    uy = ca * yy + sa * zy
    uz = ca * yz + sa * zz
    return (
        px + xx * ox + yx * oy + zx * oz,
        py + xy * ox + yy * oy + zy * oz,
        pz + xz * ox + yz * oy + zz * oz,
        cq * xx + sq * ux,
        cq * xy + sq * uy,
        cq * xz + sq * uz,
        cq * ux - sq * xx,
        cq * uy - sq * xy,
        cq * uz - sq * xz,
        ca * zx - sa * yx,
        ca * zy - sa * yy,
        ca * zz - sa * yz,
    )


def chain_jacobian(c: ChainParams, q: Any, out: Any) -> tuple[float, ...]:
    """Fill `out` with the tip's Jacobian at `q`; return its pose as `tip_pose` does.

    `out` has six floats per joint: the tip's velocity [m/s] and its angular velocity [rad/s], in
    base axes, per unit speed of the joint.
    """
    frames = chain_frames(c, q)
    pose = tip_pose(c, frames)
    fill_jacobian(frames, pose, out)
    return pose


def fill_jacobian(frames: Any, pose: Any, out: Any) -> Any:
    """Fill `out` with the Jacobian of a tip at `pose`, see `chain_jacobian` [m and 1].

    Returns it as screws about the tip, see `chain_screws`.
    """
    qx = pose[0]
    qy = pose[1]
    qz = pose[2]
    screws = []
    k = 0
    for _, _, _, _, _, _, _, _, zx, zy, zz, px, py, pz, turns in frames:
        if turns:
            px = qx - px
            py = qy - py
            pz = qz - pz
            vx = zy * pz - zz * py
            vy = zz * px - zx * pz
            vz = zx * py - zy * px
            out[k] = vx
            out[k + 1] = vy
            out[k + 2] = vz
            out[k + 3] = zx
            out[k + 4] = zy
            out[k + 5] = zz
            screws.append((zx, zy, zz, vx, vy, vz))
        else:
            out[k] = zx
            out[k + 1] = zy
            out[k + 2] = zz
            out[k + 3] = 0.0
            out[k + 4] = 0.0
            out[k + 5] = 0.0
            screws.append((0.0, 0.0, 0.0, zx, zy, zz))
        k = k + 6
    return screws
