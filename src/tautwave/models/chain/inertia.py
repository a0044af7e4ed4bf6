"""Inertia of a serial chain in motion; SI units.

A joint's screw is its angular velocity and the velocity of the body point in the base's origin per
unit speed, so that momentum and force of all bodies add up without being moved (Featherstone,
Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6: Coriolis efforts in coordinates of the base,
the mass matrix by composite bodies in those of the joints).
"""

from __future__ import annotations

from typing import Any

from tautwave.models.chain.params import ChainParams

BASE = (0.0, 0.0, 0.0)
"""The base's origin [m], about which `chain_screws` are."""


def chain_bodies(c: ChainParams, frames: Any) -> Any:
    """Return of every body, in base axes: mass, first moment, inertia about the base's origin.

    Ten floats each [kg, kg m, kg m^2]: m, x, y, z, then xx, yy, zz, xy, xz, yz.
    """
    bodies = []
    i = 0
    for frame in frames:
        xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz, _ = frame[2:]
        m, mx, my, mz, ia, ib, ic, iab, iac, ibc = c.joints[i][7:]
        ux = xx * mx + yx * my + zx * mz
        uy = xy * mx + yy * my + zy * mz
        uz = xz * mx + yz * my + zz * mz
        ax = ia * xx + iab * yx + iac * zx
        ay = ia * xy + iab * yy + iac * zy
        az = ia * xz + iab * yz + iac * zz
        bx = iab * xx + ib * yx + ibc * zx
        by = iab * xy + ib * yy + ibc * zy
        bz = iab * xz + ib * yz + ibc * zz
        dx = iac * xx + ibc * yx + ic * zx
        dy = iac * xy + ibc * yy + ic * zy
        dz = iac * xz + ibc * yz + ic * zz
        sx = ux + m * px
        sy = uy + m * py
        sz = uz + m * pz
        square = px * (ux + sx)
        other = py * (uy + sy)
        third = pz * (uz + sz)
        bodies.append(
            (
                m,
                sx,
                sy,
                sz,
                ax * xx + bx * yx + dx * zx + other + third,
                ay * xy + by * yy + dy * zy + square + third,
                az * xz + bz * yz + dz * zz + square + other,
                ax * xy + bx * yy + dx * zy - px * sy - ux * py,
                ax * xz + bx * yz + dx * zz - px * sz - ux * pz,
                ay * xz + by * yz + dy * zz - py * sz - uy * pz,
            )
        )
        i = i + 1
    return bodies


def chain_screws(frames: Any) -> Any:
    """Return every joint's angular velocity and velocity in the base's origin, six floats."""
    screws = []
    for frame in frames:
        zx, zy, zz, px, py, pz, turns = frame[8:]
        if turns:
            screws.append((zx, zy, zz, py * zz - pz * zy, pz * zx - px * zz, px * zy - py * zx))
        else:
            screws.append((0.0, 0.0, 0.0, zx, zy, zz))
    return screws


def mass_matrix(
    c: ChainParams, q: Any, frames: Any, screws: Any, about: Any, out: Any, weight: Any
) -> float:
    """Fill `out` with the mass matrix, row by row [kg m^2, kg and between].

    Parameters
    ----------
    c : ChainParams
        The chain.
    q : sequence of float
        Positions of the joints [rad or m].
    frames, screws : list of tuple
        Of `chain_frames` there, and of `chain_screws` about the base's origin or those that
        `fill_jacobian` returns, about the tip.
    about : sequence of float
        That point in base axes [m], in the first three.
    out, weight : sequence of float
        Filled: the matrix, and the effort that holds each joint against gravity [N m or N], as
        `chain_gravity` finds it: a by-product, like the potential.

    Returns
    -------
    float
        The potential energy [J].

    Notes
    -----
    All that a joint carries is one body in the joint's frame, taken from one joint to the next; row
    i is its momentum along every joint when joint i alone moves at unit speed. `c.carried` has the
    mass already where the next joint is, so that only moments travel.
    """
    gx = -c.gx
    gy = -c.gy
    gz = -c.gz
    rx = about[0]
    ry = about[1]
    rz = about[2]
    count = len(screws)
    left = list(screws)
    i = count - 1
    m, sx, sy, sz, xx, yy, zz, xy, xz, yz = c.carried[i]
    while True:
        cq, sq, ax, ay, az, ex, ey, ez, dx, dy, dz, px, py, pz, turns = frames[i]
        # Momentum in base axes.
        if turns:
            lx = sx * ex - sy * ax
            ly = sx * ey - sy * ay
            lz = sx * ez - sy * az
            out[i * count + i] = zz
        else:
            lx = m * dx
            ly = m * dy
            lz = m * dz
            out[i * count + i] = m
        weight[i] = gx * lx + gy * ly + gz * lz
        if i == 0:
            potential: float = (
                gx * (m * px + sx * ax + sy * ex + sz * dx)
                + gy * (m * py + sx * ay + sy * ey + sz * dy)
                + gz * (m * pz + sx * az + sy * ez + sz * dz)
            )
            return potential
        # Its moment, first about the joint's origin.
        if turns:
            hx = xz * ax + yz * ex + zz * dx
            hy = xz * ay + yz * ey + zz * dy
            hz = xz * az + yz * ez + zz * dz
        else:
            hx = sy * ax - sx * ex
            hy = sy * ay - sx * ey
            hz = sy * az - sx * ez
        px = px - rx
        py = py - ry
        pz = pz - rz
        hx = hx + py * lz - pz * ly
        hy = hy + pz * lx - px * lz
        hz = hz + px * ly - py * lx
        left.pop()
        row = i * count
        column = i
        for wx, wy, wz, vx, vy, vz in left:
            entry = wx * hx + wy * hy + wz * hz + vx * lx + vy * ly + vz * lz
            out[row] = entry
            out[column] = entry
            row = row + 1
            column = column + count
        # Back by the joint's turn about z, then about x; then the shift.
        ca, sa, ox, oy, oz, _, _, _, _, _, _, _, _, _, _, _, _ = c.joints[i]
        bm, bx, by, bz, bxx, byy, bzz, bxy, bxz, byz = c.carried[i - 1]
        if not turns:
            # The mass has slid from where `carried` has it.
            ty = -sa * q[i]
            tz = ca * q[i]
            ey = m * ty * (oy + oy + ty)
            ez = m * tz * (oz + oz + tz)
            bxx = bxx + ey + ez
            byy = byy + ez
            bzz = bzz + ey
            bxy = bxy - m * ty * ox
            bxz = bxz - m * tz * ox
            byz = byz - m * (ty * (oz + tz) + oy * tz)
            by = by + m * ty
            bz = bz + m * tz
            oy = oy + ty
            oz = oz + tz
        m = bm
        i = i - 1
        u = cq * sx - sq * sy
        sy = sq * sx + cq * sy
        sx = u
        u = ca * sy - sa * sz
        sz = sa * sy + ca * sz
        sy = u
        ex = (ox + ox) * sx
        ey = (oy + oy) * sy
        u = sq * (xx - yy) + (cq + cq) * xy
        w = sq * xz + cq * yz
        v = yy + sq * u
        t = sa * (v - zz) + (ca + ca) * w
        zz = zz + sa * t + ex + ey + bzz
        if i > 0:
            # The first joint has no use for these.
            ez = (oz + oz) * sz
            xx = xx - sq * u + ey + ez + bxx
            yy = v - sa * t + ex + ez + byy
            xy = cq * u - xy
            xz = cq * xz - sq * yz
            yz = ca * t - w - oy * sz - oz * sy + byz
            u = ca * xy - sa * xz - ox * sy - oy * sx + bxy
            xz = sa * xy + ca * xz - ox * sz - oz * sx + bxz
            xy = u
        sx = sx + bx
        sy = sy + by
        sz = sz + bz


def chain_coriolis(bodies: Any, screws: Any, v: Any, out: Any) -> None:
    """Fill `out` with the joint efforts that the speeds `v` alone ask for [N m or N].

    Centrifugal and Coriolis: the efforts under which no joint accelerates, without gravity.
    """
    wx = 0.0
    wy = 0.0
    wz = 0.0
    vx = 0.0
    vy = 0.0
    vz = 0.0
    ax = 0.0
    ay = 0.0
    az = 0.0
    bx = 0.0
    by = 0.0
    bz = 0.0
    forces = []
    i = 0
    for screw in screws:
        sx, sy, sz, tx, ty, tz = screw
        u = v[i]
        # Rate of the screw times its speed: the body before carries it along.
        ax = ax + u * (wy * sz - wz * sy)
        ay = ay + u * (wz * sx - wx * sz)
        az = az + u * (wx * sy - wy * sx)
        bx = bx + u * (wy * tz - wz * ty + vy * sz - vz * sy)
        by = by + u * (wz * tx - wx * tz + vz * sx - vx * sz)
        bz = bz + u * (wx * ty - wy * tx + vx * sy - vy * sx)
        wx = wx + u * sx
        wy = wy + u * sy
        wz = wz + u * sz
        vx = vx + u * tx
        vy = vy + u * ty
        vz = vz + u * tz
        m, mx, my, mz, xx, yy, zz, xy, xz, yz = bodies[i]
        lx = m * vx + wy * mz - wz * my
        ly = m * vy + wz * mx - wx * mz
        lz = m * vz + wx * my - wy * mx
        hx = xx * wx + xy * wy + xz * wz + my * vz - mz * vy
        hy = xy * wx + yy * wy + yz * wz + mz * vx - mx * vz
        hz = xz * wx + yz * wy + zz * wz + mx * vy - my * vx
        forces.append(
            (
                xx * ax + xy * ay + xz * az + my * bz - mz * by
                + wy * hz - wz * hy + vy * lz - vz * ly,
                xy * ax + yy * ay + yz * az + mz * bx - mx * bz
                + wz * hx - wx * hz + vz * lx - vx * lz,
                xz * ax + yz * ay + zz * az + mx * by - my * bx
                + wx * hy - wy * hx + vx * ly - vy * lx,
                m * bx + ay * mz - az * my + wy * lz - wz * ly,
                m * by + az * mx - ax * mz + wz * lx - wx * lz,
                m * bz + ax * my - ay * mx + wx * ly - wy * lx,
            )
        )  # fmt: skip
        i = i + 1
    hx = 0.0
    hy = 0.0
    hz = 0.0
    lx = 0.0
    ly = 0.0
    lz = 0.0
    while i > 0:
        i = i - 1
        f0, f1, f2, f3, f4, f5 = forces[i]
        hx = hx + f0
        hy = hy + f1
        hz = hz + f2
        lx = lx + f3
        ly = ly + f4
        lz = lz + f5
        wx, wy, wz, vx, vy, vz = screws[i]
        out[i] = wx * hx + wy * hy + wz * hz + vx * lx + vy * ly + vz * lz
