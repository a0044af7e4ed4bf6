"""What the bodies of a serial chain weigh on its joints; SI units."""

from __future__ import annotations

import math
from typing import Any

from tautwave.models.chain.params import ChainParams


def chain_gravity(c: ChainParams, frames: Any, out: Any) -> float:
    """Fill `out` with the effort that holds each joint against gravity [N m or N].

    `frames` are those of `chain_frames`. Returns the potential energy [J], 0 for a chain whose
    centre of mass lies in the base's origin; `out` is its gradient.
    """
    gx = c.gx
    gy = c.gy
    gz = c.gz
    mass = 0.0
    sx = 0.0
    sy = 0.0
    sz = 0.0
    i = len(c.joints)
    while i > 0:
        i = i - 1
        m, mx, my, mz = c.joints[i][7:11]
        xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz, turns = frames[i][2:]
        mass = mass + m
        sx = sx + m * px + xx * mx + yx * my + zx * mz
        sy = sy + m * py + xy * mx + yy * my + zy * mz
        sz = sz + m * pz + xz * mx + yz * my + zz * mz
        if turns:
            hx = sx - mass * px
            hy = sy - mass * py
            hz = sz - mass * pz
            out[i] = -(
                gx * (zy * hz - zz * hy) + gy * (zz * hx - zx * hz) + gz * (zx * hy - zy * hx)
            )
        else:
            out[i] = -mass * (gx * zx + gy * zy + gz * zz)
    return -(gx * sx + gy * sy + gz * sz)


def gravity_stiffness(c: ChainParams, slides: Any, out: Any) -> None:
    """Fill `out` with a bound of how fast each joint's weight changes, in any posture.

    A row sum of the potential's second derivatives, bounded: `g` times the first moment beyond the
    farther of two joints, with every link stretched [N m/rad, N/m and between]. `slides` is how far
    each joint may slide [m]; those that turn ignore it.
    """
    g = math.sqrt(c.gx * c.gx + c.gy * c.gy + c.gz * c.gz)
    count = len(c.joints)
    for i in range(count):
        out[i] = 0.0
    mass = 0.0
    moment = 0.0  # of all beyond joint i about its origin, stretched
    i = count
    while i > 0:
        i = i - 1
        joint = c.joints[i]
        mass = mass + joint.mass
        own = joint.mx * joint.mx + joint.my * joint.my + joint.mz * joint.mz
        moment = moment + math.sqrt(own)
        # Entry (i, j <= i) is at most g times the moment, or the mass where one of both slides.
        for j in range(i + 1):
            entry = g * moment
            if not c.joints[j].turns:
                entry = 0.0
            elif not joint.turns:
                entry = g * mass
            out[i] = out[i] + entry
            if j != i:
                out[j] = out[j] + entry
        shift = math.sqrt(joint.x * joint.x + joint.y * joint.y + joint.z * joint.z)
        if not joint.turns:
            shift = shift + slides[i]
        moment = moment + mass * shift
