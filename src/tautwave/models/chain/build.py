"""From links as files describe them to the constants of a serial chain; SI units, rows first."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.models.chain.params import ChainParams, JointParams, TipParams

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
UNIT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN: Vector = (0.0, 0.0, 0.0)


class Body(NamedTuple):
    """Mass [kg], centre [m] and inertia about that centre [kg m^2], in some frame."""

    mass: float = 0.0
    centre: Vector = ORIGIN
    inertia: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Link(NamedTuple):
    """A joint and the body behind it, each in the frame of the link before.

    The body's frame is at `place` [m], turned by `turn`, and moves about or along `axis` (a unit
    vector in that frame): `kind` is `turns`, `slides` or `fixed`.
    """

    name: str
    kind: str
    place: Vector = ORIGIN
    turn: Matrix = UNIT
    axis: Vector = (0.0, 0.0, 1.0)
    body: Body = Body()


def times(a: Matrix, b: Matrix) -> Matrix:
    """Return the product of two matrices [1]."""
    r0, r1, r2 = (_row(row, b) for row in a)
    return r0, r1, r2


def _row(row: Vector, b: Matrix) -> Vector:
    x, y, z = row
    return (
        x * b[0][0] + y * b[1][0] + z * b[2][0],
        x * b[0][1] + y * b[1][1] + z * b[2][1],
        x * b[0][2] + y * b[1][2] + z * b[2][2],
    )


def transposed(a: Matrix) -> Matrix:
    """Return the transpose, of a rotation the inverse [1]."""
    return (
        (a[0][0], a[1][0], a[2][0]),
        (a[0][1], a[1][1], a[2][1]),
        (a[0][2], a[1][2], a[2][2]),
    )


def turned(a: Matrix, v: Vector) -> Vector:
    """Return a vector turned by a rotation, in its own unit."""
    x, y, z = v
    return (
        a[0][0] * x + a[0][1] * y + a[0][2] * z,
        a[1][0] * x + a[1][1] * y + a[1][2] * z,
        a[2][0] * x + a[2][1] * y + a[2][2] * z,
    )


def moved(a: Matrix, v: Vector, place: Vector) -> Vector:
    """Return a point given in a frame at `place` that is turned by `a` [m]."""
    x, y, z = turned(a, v)
    return x + place[0], y + place[1], z + place[2]


def about_z(angle: float) -> Matrix:
    """Return the rotation about z by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return (c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Matrix:
    """Return the rotation by angles about the fixed x, then y, then z [rad], as URDF has it."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    rolled: Matrix = ((1.0, 0.0, 0.0), (0.0, cr, -sr), (0.0, sr, cr))
    pitched: Matrix = ((cp, 0.0, sp), (0.0, 1.0, 0.0), (-sp, 0.0, cp))
    return times(about_z(yaw), times(pitched, rolled))


def z_along(axis: Vector) -> Matrix:
    """Return a rotation that turns z into a unit vector [1]."""
    x, y, z = axis
    if z < 0.0:
        # Half a turn about x first: the formula below loses digits near -z.
        near = z_along((x, -y, -z))
        return near[0], _minus(near[1]), _minus(near[2])
    a = 1.0 / (1.0 + z)
    return (1.0 - a * x * x, -a * x * y, x), (-a * x * y, 1.0 - a * y * y, y), (-x, -y, z)


def _minus(v: Vector) -> Vector:
    return -v[0], -v[1], -v[2]


def joined(a: Body, b: Body) -> Body:
    """Return two bodies in one frame as one."""
    mass = a.mass + b.mass
    if a.mass == 0.0 or b.mass == 0.0:
        centre = b.centre if a.mass == 0.0 else a.centre
        return Body(mass, centre, _sum(a.inertia, b.inertia))
    x, y, z = ((a.mass * p + b.mass * q) / mass for p, q in zip(a.centre, b.centre, strict=True))
    total = _sum(
        _shifted(a, (a.centre[0] - x, a.centre[1] - y, a.centre[2] - z)),
        _shifted(b, (b.centre[0] - x, b.centre[1] - y, b.centre[2] - z)),
    )
    return Body(mass, (x, y, z), total)


def _sum(a: Matrix, b: Matrix) -> Matrix:
    r0, r1, r2 = ((p[0] + q[0], p[1] + q[1], p[2] + q[2]) for p, q in zip(a, b, strict=True))
    return r0, r1, r2


def _shifted(body: Body, d: Vector) -> Matrix:
    x, y, z = d
    m = body.mass
    return _sum(
        body.inertia,
        (
            (m * (y * y + z * z), -m * x * y, -m * x * z),
            (-m * x * y, m * (x * x + z * z), -m * y * z),
            (-m * x * z, -m * y * z, m * (x * x + y * y)),
        ),
    )


def placed(body: Body, turn: Matrix, place: Vector) -> Body:
    """Return a body in the frame in which its own is at `place`, turned by `turn`."""
    inertia = times(turn, times(body.inertia, transposed(turn)))
    return Body(body.mass, moved(turn, body.centre, place), inertia)


def is_inertia(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> bool:
    """Return whether a matrix [kg m^2] is positive semi-definite, up to rounding."""
    size = max(abs(xx), abs(yy), abs(zz), abs(xy), abs(xz), abs(yz))
    slack = 1e-9 * size
    whole = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return (
        min(xx, yy, zz) >= -slack
        and min(xx * yy - xy * xy, xx * zz - xz * xz, yy * zz - yz * yz) >= -slack * size
        and whole >= -slack * size * size
    )


def build_chain(
    links: tuple[Link, ...],
    gravity: Vector,
    tip: Body = Body(),  # noqa: B008  a constant
) -> ChainParams:
    """Return the constants of a chain of links from base to tip; what is fixed is joined.

    Parameters
    ----------
    links : tuple of Link
        At least one of them moves.
    gravity : tuple of float
        In the base's axes [m/s^2].
    tip : Body
        Held at the last link's frame: a tool or a load.
    """
    turns: list[Matrix] = []  # from the moving frame before, as the file has it
    places: list[Vector] = []
    axes: list[Vector] = []
    kinds: list[bool] = []
    bodies: list[Body] = []
    turn, place = UNIT, ORIGIN
    for link in links:
        place = moved(turn, link.place, place)
        turn = times(turn, link.turn)
        if link.kind == "fixed":
            if bodies:
                bodies[-1] = joined(bodies[-1], placed(link.body, turn, place))
            continue
        turns.append(turn)
        places.append(place)
        axes.append(link.axis)
        kinds.append(link.kind == "turns")
        bodies.append(link.body)
        turn, place = UNIT, ORIGIN
    bodies[-1] = joined(bodies[-1], placed(tip, turn, place))
    # `own` turns the frame with z along the axis into the file's; what is left of the way to the
    # next axis is a turn about z, which joins the joint's own, one about x, and one about z.
    own = UNIT
    steps = []
    for t, p, axis in zip([*turns, turn], [*places, place], [*axes, (0.0, 0.0, 1.0)], strict=True):
        ahead = z_along(axis)
        beta, ca, sa, gamma = _about_zxz(times(transposed(own), times(t, ahead)))
        back = transposed(times(own, about_z(beta)))
        steps.append((beta, ca, sa, gamma, turned(back, p)))
        own = ahead
    betas = [step[0] for step in steps]
    joints = []
    for i, body in enumerate(bodies):
        _, ca, sa, gamma, shift = steps[i]
        seen = placed(body, transposed(times(z_along(axes[i]), about_z(betas[i + 1]))), ORIGIN)
        m, (x, y, z) = seen.mass, seen.centre
        (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = _shifted(seen, seen.centre)
        joints.append(
            JointParams(
                ca, sa, *shift, gamma + betas[i + 1], kinds[i],
                m, m * x, m * y, m * z, ixx, iyy, izz, ixy, ixz, iyz,
            )
        )  # fmt: skip
    carried: list[tuple[float, ...]] = []
    beyond, ahead_at = 0.0, ORIGIN  # mass of all that follows, and where the next joint is
    for joint in reversed(joints):
        carried.insert(0, _carried(joint, beyond, ahead_at))
        beyond, ahead_at = carried[0][0], (joint.x, joint.y, joint.z)
    _, ca, sa, gamma, shift = steps[-1]
    return ChainParams(
        math.cos(betas[0]),
        math.sin(betas[0]),
        *gravity,
        tuple(joints),
        tuple(carried),
        TipParams(ca, sa, *shift, math.cos(gamma), math.sin(gamma)),
    )


def _carried(joint: JointParams, beyond: float, place: Vector) -> tuple[float, ...]:
    """Return a joint's body with a mass [kg] at a place [m], see `ChainParams.carried`."""
    x, y, z = place
    return (
        joint.mass + beyond,
        joint.mx + beyond * x,
        joint.my + beyond * y,
        joint.mz + beyond * z,
        joint.ixx + beyond * (y * y + z * z),
        joint.iyy + beyond * (x * x + z * z),
        joint.izz + beyond * (x * x + y * y),
        joint.ixy - beyond * x * y,
        joint.ixz - beyond * x * z,
        joint.iyz - beyond * y * z,
    )


def _about_zxz(a: Matrix) -> tuple[float, float, float, float]:
    """Return beta, cosine and sine of alpha, gamma of Rz(beta) Rx(alpha) Rz(gamma) [rad].

    Gamma is read from what beta leaves: near alpha = 0 both are uncertain, their sum is not.
    """
    sine = math.hypot(a[0][2], a[1][2])
    beta = math.atan2(a[0][2], -a[1][2]) if sine > 0.0 else 0.0
    first, second, third = times(transposed(about_z(beta)), a)
    size = math.hypot(second[2], third[2])
    return beta, third[2] / size, -second[2] / size, math.atan2(-first[1], first[0])
