"""Efforts of a serial chain as a linear function of its bodies' parameters, over many samples.

Ten parameters a body, in its joint's frame: mass, first moments x y z, inertia about the frame's
origin xx yy zz xy xz yz (as in `models.chain.params.JointParams`). What no motion tells apart is
regrouped into base parameters: the least number of sums that the efforts depend on (Gautier and
Khalil, 1990). SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tautwave.analysis.identification.regression import Array
from tautwave.models.chain.params import ChainParams

PARAMETERS = ("m", "mx", "my", "mz", "ixx", "iyy", "izz", "ixy", "ixz", "iyz")
FIRST = (1, 2, 6, 8, 9, 7, 4, 5, 3, 0)
"""Parameters of a body in the order in which they are taken as a base: what Khalil's rules regroup
into the body before, yy, z and the mass, comes last."""
POSTURES = 60
INDEPENDENT = 1e-9
"""Share of a column that others must leave of it, for it to be a parameter of its own, and of the
largest column that it must have."""


class Bodies(NamedTuple):
    """Every body's motion, seen in its joint's frame; arrays over samples, lists over joints.

    `turn` (n, 3, 3) has the frame's axes in base axes as columns; `place` (n, 3) is its origin
    [m]; `along` (n, 3) the joint's axis in base axes.
    """

    turn: list[Array]
    place: list[Array]
    along: list[Array]
    push: list[Array]
    twist: list[Array]


def efforts_by_body(chain: ChainParams, q: Array, v: Array, a: Array) -> list[Array]:
    """Return the efforts on all joints per unit of each parameter, body by body.

    Parameters
    ----------
    chain : ChainParams
        Its geometry and gravity; its bodies do not matter.
    q, v, a : array, (n, joints)
        Positions, velocities, accelerations [rad or m, and per s, s^2].

    Returns
    -------
    list of array, (n, joints, 10)
        Of body i; 0 for the joints behind it.
    """
    bodies = _bodies(chain, q, v, a)
    count = len(chain.joints)
    regressors = []
    for i in range(count):
        block = np.zeros((len(q), count, len(PARAMETERS)))
        back = np.swapaxes(bodies.turn[i], 1, 2)
        for j in range(i + 1):
            axis = _turned(back, bodies.along[j])
            if chain.joints[j].turns:
                arm = np.cross(axis, _turned(back, bodies.place[i] - bodies.place[j]))
                block[:, j] = _dot(axis, bodies.twist[i]) + _dot(arm, bodies.push[i])
            else:
                block[:, j] = _dot(axis, bodies.push[i])
        regressors.append(block)
    return regressors


def _bodies(chain: ChainParams, q: Array, v: Array, a: Array) -> Bodies:
    """Return how every body moves, with force and moment per unit of its parameters."""
    n = len(q)
    turn = np.broadcast_to(
        np.array([[chain.cb, -chain.sb, 0.0], [chain.sb, chain.cb, 0.0], [0.0, 0.0, 1.0]]),
        (n, 3, 3),
    )
    place, spin, change = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    pull = np.broadcast_to(-np.array([chain.gx, chain.gy, chain.gz]), (n, 3))
    bodies = Bodies([], [], [], [], [])
    for i, joint in enumerate(chain.joints):
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, joint.ca, -joint.sa], [0.0, joint.sa, joint.ca]])
        shift = turn @ np.array([joint.x, joint.y, joint.z])
        turn = turn @ tilt
        along = turn[:, :, 2]
        angle = joint.offset + (q[:, i] if joint.turns else 0.0 * q[:, i])
        if not joint.turns:
            shift = shift + along * q[:, i : i + 1]
        rate, gain = along * v[:, i : i + 1], along * a[:, i : i + 1]
        pull = pull + np.cross(change, shift) + np.cross(spin, np.cross(spin, shift))
        if joint.turns:
            change = change + gain + np.cross(spin, rate)
            spin = spin + rate
        else:
            pull = pull + gain + 2.0 * np.cross(spin, rate)
        place = place + shift
        c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros(n), np.ones(n)
        about = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=1).reshape(n, 3, 3)
        turn = turn @ about
        back = np.swapaxes(turn, 1, 2)
        push, twist = _of_body(_turned(back, pull), _turned(back, spin), _turned(back, change))
        for one_of, value in zip(bodies, (turn, place, along, push, twist), strict=True):
            one_of.append(value)
    return bodies


def _of_body(pull: Array, spin: Array, change: Array) -> tuple[Array, Array]:
    """Return force and moment about the frame's origin per unit of ten parameters, (n, 3, 10)."""
    n = len(pull)
    push, twist = np.zeros((n, 3, len(PARAMETERS))), np.zeros((n, 3, len(PARAMETERS)))
    swung = _crossing(spin)
    push[:, :, 0] = pull
    push[:, :, 1:4] = _crossing(change) + swung @ swung
    twist[:, :, 1:4] = -_crossing(pull)
    twist[:, :, 4:] = _inertia(change) + swung @ _inertia(spin)
    return push, twist


def _inertia(w: Array) -> Array:
    """Return what an inertia's xx yy zz xy xz yz make of a vector, (n, 3, 6)."""
    x, y, z = w.T
    out = np.zeros((len(w), 3, 6))
    out[:, 0, 0], out[:, 0, 3], out[:, 0, 4] = x, y, z
    out[:, 1, 1], out[:, 1, 3], out[:, 1, 5] = y, x, z
    out[:, 2, 2], out[:, 2, 4], out[:, 2, 5] = z, x, y
    return out


def _crossing(w: Array) -> Array:
    x, y, z = w.T
    zero = np.zeros(len(w))
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _turned(turn: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", turn, vector))


def _dot(vector: Array, columns: Array) -> Array:
    return np.asarray(np.einsum("ni,nik->nk", vector, columns))


class Base(NamedTuple):
    """Base parameters: `kept` are numbers of parameters, of all bodies one after the other.

    `share` (kept, parameters) has what each base parameter is: 1 for its own, and its share of
    those that are regrouped into it.
    """

    kept: tuple[int, ...]
    share: Array

    def of(self, parameters: Array) -> Array:
        """Return the base parameters of all parameters."""
        return np.asarray(self.share @ parameters)

    def name(self, number: int, joints: Sequence[str]) -> str:
        """Return what a base parameter is a sum of, such as `mx2 + 0.3 m3`."""
        words: list[str] = []
        for at in [self.kept[number], *range(self.share.shape[1])]:
            factor = float(self.share[number, at])
            if abs(factor) < 1e-9 or (words and at == self.kept[number]):
                continue
            body, which = divmod(at, len(PARAMETERS))
            size = "" if abs(abs(factor) - 1.0) < 1e-9 else f"{abs(factor):.3g} "
            sign = ("- " if factor < 0.0 else "+ ") if words else ("-" if factor < 0.0 else "")
            words.append(f"{sign}{size}{PARAMETERS[which]}({joints[body]})")
        return " ".join(words)


def base_of(chain: ChainParams, seed: int = 1) -> Base:
    """Return the base parameters of a chain, by the efforts of random motion.

    They are what any motion could tell apart, whatever a recording does.
    """
    rng = np.random.default_rng(seed)
    count = len(chain.joints)
    spread = np.array([np.pi if joint.turns else 0.5 for joint in chain.joints])
    q = rng.uniform(-1.0, 1.0, (POSTURES, count)) * spread
    v, a = rng.normal(size=(2, POSTURES, count)) * 3.0
    whole = np.concatenate(efforts_by_body(chain, q, v, a), axis=2)
    columns = whole.reshape(-1, count * len(PARAMETERS))
    order = [len(PARAMETERS) * body + at for at in FIRST for body in range(count)]
    order.sort(key=lambda at: at % len(PARAMETERS) in FIRST[-3:])
    greatest = float(np.max(np.linalg.norm(columns, axis=0)))
    kept: list[int] = []
    basis = np.zeros((len(columns), 0))
    for at in order:
        column = columns[:, at]
        size = float(np.linalg.norm(column))
        rest = column
        for _ in range(2):  # once more: the first leaves digits
            rest = rest - basis @ (basis.T @ rest)
        if size > INDEPENDENT * greatest and float(np.linalg.norm(rest)) > INDEPENDENT * size:
            kept.append(at)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    share = np.linalg.lstsq(columns[:, kept], columns, rcond=None)[0]
    share[np.abs(share) < 1e-9] = 0.0
    return Base(tuple(kept), np.asarray(share, dtype=np.float64))


def parameters_of(chain: ChainParams) -> Array:
    """Return the parameters of a chain's bodies, (10 joints,)."""
    return np.array([value for joint in chain.joints for value in joint[7:]])
