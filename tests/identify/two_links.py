"""A planar arm of two links under gravity: its efforts in closed form, and a recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
G = 9.81


class TwoLinks(NamedTuple):
    """Lengths [m], masses [kg], centres along the links [m], inertias about them [kg m^2]."""

    l1: float = 0.4
    m1: float = 1.2
    c1: float = 0.18
    i1: float = 0.02
    m2: float = 0.7
    c2: float = 0.15
    i2: float = 0.011

    def efforts(self, q: Array, v: Array, a: Array) -> Array:
        """Return the efforts of both motors; angles from the horizontal, gravity down. (n, 2)."""
        l1, m1, c1, i1, m2, c2, i2 = self
        q1, q2 = q.T
        h = m2 * l1 * c2
        m11 = i1 + m1 * c1**2 + i2 + m2 * (l1**2 + c2**2) + 2.0 * h * np.cos(q2)
        m12 = i2 + m2 * c2**2 + h * np.cos(q2)
        m22 = i2 + m2 * c2**2
        g1 = (m1 * c1 + m2 * l1) * G * np.cos(q1) + m2 * c2 * G * np.cos(q1 + q2)
        g2 = m2 * c2 * G * np.cos(q1 + q2)
        t1 = m11 * a[:, 0] + m12 * a[:, 1] - h * np.sin(q2) * (2.0 * v[:, 0] + v[:, 1]) * v[:, 1]
        t2 = m12 * a[:, 0] + m22 * a[:, 1] + h * np.sin(q2) * v[:, 0] ** 2
        return np.stack([t1 + g1, t2 + g2], axis=1)

    @property
    def base(self) -> dict[str, float]:
        """Return its base parameters: m2 c2 and m1 c1 + m2 l1, and the inertias regrouped."""
        l1, m1, c1, i1, m2, c2, i2 = self
        return {
            "mx1": m1 * c1 + m2 * l1,
            "izz1": i1 + m1 * c1**2 + m2 * l1**2,
            "mx2": m2 * c2,
            "izz2": i2 + m2 * c2**2,
        }

    @property
    def urdf(self) -> str:
        """Return its URDF: turning about -y, from x upwards; in x and z everything is planar."""

        def body(mass: float, centre: float, inertia: float) -> str:
            return (
                f'<inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
                f'<inertia ixx="{inertia / 2}" iyy="{inertia}" izz="{inertia / 2}" ixy="0" '
                'ixz="0" iyz="0"/></inertial>'
            )

        joint = (
            '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
            '<origin xyz="{3} 0 0"/><axis xyz="0 -1 0"/>'
            '<limit lower="-3" upper="3" effort="50" velocity="10"/></joint>'
        )
        return (
            '<robot name="two"><link name="base"/>'
            f'<link name="upper">{body(self.m1, self.c1, self.i1)}</link>'
            f'<link name="lower">{body(self.m2, self.c2, self.i2)}</link>'
            + joint.format("shoulder", "base", "upper", 0)
            + joint.format("elbow", "upper", "lower", self.l1)
            + "</robot>"
        )


RATE = 250.0


def recorded(
    arm: TwoLinks, seconds: float = 30.0, noise: float = 1e-5, friction: float = 0.2, seed: int = 3
) -> tuple[Array, Array, Array]:
    """Return times (n,), positions and efforts (n, 2): sines, friction, noise of both sensors."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = (np.zeros((len(t), 2)) for _ in range(3))
    for joint, waves in enumerate((((0.21, 0.8), (0.47, 0.4)), ((0.33, 0.9), (0.71, 0.4)))):
        for hz, size in waves:
            w, phase = 2 * np.pi * hz, rng.uniform(0, 6)
            q[:, joint] += size * np.sin(w * t + phase)
            v[:, joint] += size * w * np.cos(w * t + phase)
            a[:, joint] -= size * w * w * np.sin(w * t + phase)
    efforts = arm.efforts(q, v, a) + friction * np.sign(v) + 0.1 * v
    efforts += rng.normal(scale=0.02, size=efforts.shape)
    return t, q + rng.normal(scale=noise, size=q.shape), efforts
