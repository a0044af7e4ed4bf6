"""Exact loop of a sampled law, force = law(z) position, and a mass on a spring and a damper.

The force comes `delay` seconds late (whole periods and a remainder) and is held; between samples
the user moves exactly. Unlike the baseband equivalent this knows every alias. SI units.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.rational import Complexes, Sampled
from tautwave.models.linear import flow_rows

Floats = npt.NDArray[np.float64]
_ROUNDING = 1e-12  # of a pole on the unit circle


def user_step(
    period: float, late: float, mass: float, damping: float, stiffness: float
) -> tuple[Floats, Floats, Floats]:
    """Return F, g_old, g_new of (x, v)' = F (x, v) + g_old force[k-1] + g_new force[k].

    Parameters
    ----------
    period, late : float
        Period, and how late in it the new force begins to act [s].
    mass, damping, stiffness : float
        SI, linear or rotary.

    Returns
    -------
    tuple of arrays
        Shapes (2, 2), (2,), (2,).
    """
    first, old = _flow(late, mass, damping, stiffness)
    second, new = _flow(period - late, mass, damping, stiffness)
    return second @ first, second @ old, new


def sampled_user_poles(
    controller: Sampled, mass: float, damping: float, stiffness: float
) -> Complexes:
    """Return the poles in z of the loop; |z| > 1 grows."""
    # A device inside the controller is part of the user.
    extra = controller.device
    mass, damping, stiffness = mass + extra[0], damping + extra[1], stiffness + extra[2]
    whole = math.floor(controller.delay / controller.period + 1e-9)
    late = max(0.0, controller.delay - whole * controller.period)
    f, old, new = user_step(controller.period, late, mass, damping, stiffness)
    den = np.array([1.0, -f[0, 0] - f[1, 1], f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]])
    move = np.array([0.0, *_position(f, new), 0.0]) + np.array([0.0, 0.0, *_position(f, old)])
    num = np.array([float(c) for c in controller.law.num] or [0.0])
    bottom = np.array([float(c) for c in controller.law.den])
    loop = np.concatenate([np.polymul(den, bottom), np.zeros(1 + whole)])
    return np.asarray(np.roots(np.polyadd(loop, np.polymul(move, num))), np.complex128)


def sampled_root(
    controller: Sampled, mass: float, damping: float, stiffness: float
) -> complex | None:
    """Return the fastest growing root s = ln(z)/T [rad/s], or None if none grows."""
    poles = sampled_user_poles(controller, mass, damping, stiffness)
    pole = complex(poles[np.argmax(np.abs(poles))])
    if abs(pole) <= 1.0 + _ROUNDING:
        return None
    root = complex(np.log(pole)) / controller.period
    return complex(root.real, abs(root.imag))


def _flow(t: float, mass: float, damping: float, stiffness: float) -> tuple[Floats, Floats]:
    """Return the map of (x, v) and of a held force over t [s]."""
    xv, xn, _, vv, vn, _ = flow_rows(stiffness, damping, mass, t)[:6]
    move = np.array(
        [
            [1.0 - stiffness * xn, xv - damping * xn],
            [-stiffness * vn, 1.0 + vv - damping * vn],
        ]
    )
    return move, np.array([xn, vn])


def _position(f: Floats, b: Floats) -> list[float]:
    """Return the numerator of C (zI - F)^-1 b for the position: z b0 + (f01 b1 - f11 b0)."""
    return [float(b[0]), float(f[0, 1] * b[1] - f[1, 1] * b[0])]
