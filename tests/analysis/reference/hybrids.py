"""Continuous two-ports of whole rigs: four couplings, and scattering.

    [F_m; -v_s] = H [v_m; F_s]    F_m: hand on master, F_s: environment on slave, v_s into it

None of this sees the hold. With m, b, K, B >= 0 the poles of these rigs never lie to the right:
the slave hangs on a passive coupler with the master held. A rig is passive if in wave variables no
more leaves than came, |S| <= 1: a stronger demand than absolute stability.

Sources: Hannaford, IEEE T-RA 5, 1989 (hybrid form); Lawrence, IEEE T-RA 9, 1993 (four channels);
Niemeyer & Slotine 1991 (waves). SI of the master throughout.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.two_port import Hybrid

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class Rig(NamedTuple):
    """Two devices, a coupler and the delays between them; SI.

    Attributes
    ----------
    master_mass, master_damping, slave_mass, slave_damping : float
        Devices with all damping that acts on them, that of damping injection too.
    stiffness, damping : float
        K and B of the position coupling, or of the coupler between a wave line and the slave;
        K = inf for waves: the slave is the line's own end.
    to_slave_s, to_master_s : float
        One-way delays [s].
    impedance : float
        Wave impedance b; of waves only.
    """

    master_mass: float
    master_damping: float
    slave_mass: float
    slave_damping: float
    stiffness: float
    damping: float = 0.0
    to_slave_s: float = 0.0
    to_master_s: float = 0.0
    impedance: float = 0.0


class Channels(NamedTuple):
    """Filters of a four-channel rig at the points s (Lawrence): local and crossing."""

    master_local: Complexes
    slave_local: Complexes
    c1: Complexes
    c2: Complexes
    c3: Complexes
    c4: Complexes
    c5: Complexes
    c6: Complexes


def position_position(rig: Rig, s: Complexes) -> Hybrid:
    """Return H of a position-position coupling; finite at s = 0."""
    zm, zs, c, e1, e2, both = _parts(rig, s)
    below = s * zs + c
    h11 = zm + c * (zs + c * both) / below
    return Hybrid(h11, c * e2 / below, -c * e1 / below, s / below)


def position_force(
    rig: Rig, s: Complexes, *, force_scale: float = 1.0, measured: bool = True
) -> Hybrid:
    """Return H of position there, force back.

    Parameters
    ----------
    rig : Rig
        K and B are those of the slave's position controller.
    force_scale : float
        k_f, force at the master per force at the slave.
    measured : bool
        Whether the environment's force is sent (a sensor), else the controller's.
    """
    zm, zs, c, e1, e2, _ = _parts(rig, s)
    below = s * zs + c
    h21, h22 = -c * e1 / below, s / below
    if measured:
        return Hybrid(zm, force_scale * e2, h21, h22)
    return Hybrid(
        zm + force_scale * e2 * e1 * c * zs / below, force_scale * e2 * c / below, h21, h22
    )


def four_channel(rig: Rig, s: Complexes, channels: Channels) -> Hybrid:
    """Return H of Lawrence's four channels; `channels` at the same points.

    F_m + F of the controllers: Z_m v_m = F_h - C_m v_m + C6 F_h - C4 v_s e2 - C2 F_e e2 and
    Z_s v_s = -F_e - C_s v_s - C5 F_e + C1 v_m e1 + C3 F_h e1.
    """
    zm, zs, _, e1, e2, _ = _parts(rig._replace(stiffness=1.0), s)
    k = channels
    zcm, zcs = zm + k.master_local, zs + k.slave_local
    # (1 + C6) F_h = Zcm v_m + C4 e2 v_s + C2 e2 F_e; Zcs v_s = C1 e1 v_m + C3 e1 F_h - (1 + C5) F_e
    below = (1.0 + k.c6) * zcs - k.c4 * k.c3 * e1 * e2
    h11 = (zcm * zcs + k.c1 * k.c4 * e1 * e2) / below
    h12 = e2 * (k.c2 * zcs - k.c4 * (1.0 + k.c5)) / below
    h21 = -(k.c1 * e1 + k.c3 * e1 * h11) / zcs
    h22 = ((1.0 + k.c5) - k.c3 * e1 * h12) / zcs
    return Hybrid(h11, h12, h21, h22)


def wave_line(rig: Rig, s: Complexes, *, matched: bool = False) -> Hybrid:
    """Return H of a wave line between master and slave, by its linear equations at each point.

    With finite K and B a coupler joins the line to the slave (velocity out of the wave); with
    K = inf the slave is a port like the master. `matched` puts a damper b in series at the master.

    At s = 0 itself with a finite K the value is the limit.
    """
    s = np.asarray(s, np.complex128)
    flat = s.ravel()
    zm = rig.master_mass * flat + rig.master_damping
    zs = rig.slave_mass * flat + rig.slave_damping
    e1, e2 = np.exp(-flat * rig.to_slave_s), np.exp(-flat * rig.to_master_s)
    b = rig.impedance
    root = math.sqrt(2.0 * b)
    # Unknowns: 0 v_m wave, 1 u_m, 2 u_s, 3 v_s wave, 4 F_sd, 5 xd_sd, 6 v_s, 7 F_m.
    a = np.zeros((len(flat), 8, 8), np.complex128)
    r = np.zeros((len(flat), 8, 2), np.complex128)  # for v_m = 1, then for F_s = 1
    a[:, 0, 1] = 1.0  # wave into the line
    if matched:
        r[:, 0, 0] = root / 2.0
        a[:, 1, 0], a[:, 1, 7] = root / 2.0, 1.0
        r[:, 1, 0] = zm + b / 2.0
    else:
        a[:, 0, 0] = 1.0
        r[:, 0, 0] = root
        a[:, 1, 0], a[:, 1, 7] = root, 1.0
        r[:, 1, 0] = zm + b
    a[:, 2, 2], a[:, 2, 1] = 1.0, -e1
    a[:, 3, 0], a[:, 3, 3] = 1.0, -e2
    a[:, 4, 5], a[:, 4, 2], a[:, 4, 4] = b, -root, 1.0
    a[:, 5, 3], a[:, 5, 2], a[:, 5, 4] = 1.0, -1.0, 2.0 / root
    if math.isinf(rig.stiffness):
        a[:, 6, 5], a[:, 6, 6] = 1.0, -1.0
    else:  # s F_sd = (B s + K) (xd_sd - v_s)
        c = rig.damping * flat + rig.stiffness
        a[:, 6, 4], a[:, 6, 5], a[:, 6, 6] = flat, -c, c
    a[:, 7, 6], a[:, 7, 4] = zs, -1.0
    r[:, 7, 1] = -1.0
    found: Complexes = np.linalg.solve(a, r).astype(np.complex128).reshape(*s.shape, 8, 2)
    return Hybrid(found[..., 7, 0], found[..., 7, 1], -found[..., 6, 0], -found[..., 6, 1])


def _parts(rig: Rig, s: Complexes) -> tuple[Complexes, ...]:
    """Return Z_m, Z_s, s C, both delays, and (1 - e1 e2) / s without its singularity."""
    s = np.asarray(s, np.complex128)
    lag = rig.to_slave_s + rig.to_master_s
    safe = np.where(s == 0.0, 1.0, s)
    both = np.where(s == 0.0, lag, -np.expm1(-safe * lag) / safe)
    return (
        rig.master_mass * s + rig.master_damping,
        rig.slave_mass * s + rig.slave_damping,
        rig.damping * s + rig.stiffness,
        np.exp(-s * rig.to_slave_s),
        np.exp(-s * rig.to_master_s),
        both,
    )


def scattering_matrix(h: Hybrid, impedance: float) -> Complexes:
    """Return S with waves (F -+ b v) / sqrt(2 b) at both ports; shape (..., 2, 2)."""
    one = np.stack(
        [
            np.stack([h.h11 / impedance, h.h12], axis=-1),
            np.stack([h.h21, h.h22 * impedance], axis=-1),
        ],
        axis=-2,
    )
    eye = np.eye(2)
    return np.asarray(np.diag([1.0, -1.0]) @ (one - eye) @ np.linalg.inv(one + eye))


def scattering_norm(h: Hybrid, impedance: float) -> Floats:
    """Return the greatest singular value of S at each point [1]; passive up to 1."""
    return np.asarray(np.linalg.norm(scattering_matrix(h, impedance), 2, axis=(-2, -1)))
