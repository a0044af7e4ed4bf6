"""A tetrahedron that turns with its motion: its energy, and the discrete gradient of that energy.

With the deformation gradient f = r u (r a rotation, u symmetric) and the strain e = u - I, an
element holds W(e) = mu e:e + lam tr(e)^2/2 per volume, the energy of linear elasticity in axes that
turn with it. Over a step from f to f',

    p = (f + f') (u + u')^-1 (s - 2 [w]),    s = stress of the mean strain (e + e')/2,

does exactly the work p : (f' - f) = s : (e' - e) = W(e') - W(e), whatever the step: f'^T f' - f^T f
is a d + d a with a = (u + u')/2 and d = u' - u, and p is (f + f') times the symmetric x that solves
a x + x a = s. Its solution needs [w] only where s and a do not commute: for viscous parts. Since x
is symmetric, p exerts no torque either. So energy, momentum and angular momentum are kept together.
Where an element is squeezed nearly flat (determinant of a below `FLAT`) or inverted, x has no
bound: there the mean rotation and the smallest change of it that does the work are taken (Gonzalez
1996), which keep energy but not angular momentum. An inverted element pushes back: r stays a
rotation, and u has a negative eigenvalue.

Relaxation: each branch j is a spring of `share` times the element's moduli in series with a damper,
e_j its elastic strain: e_j' - e_j = (e' - e) - (T/tau) (e_j + e_j')/2 (Kelvin and Boltzmann's solid
for one branch, a Prony series for more). Its stress of the mean strain gives out no more than it
holds, and burns (T/tau) s_j : (e_j + e_j')/2. Damping beside: theta C (e' - e)/T.

Sources: McAdams et al. 2011 (the potential), Gonzalez 1996, Simo & Tarnow 1992; the form above is
derived here.
"""

from __future__ import annotations

from tautwave_scenes.models.tissue.algebra import (
    Matrix,
    Symmetric,
    applied,
    full,
    halfway,
    inner,
    inverse,
    product,
    turning,
)

FLAT = 0.05
"""Determinant of the mean stretch below which an element counts as flat."""


def stress(mu: float, lam: float, e: Symmetric) -> Symmetric:
    """Return 2 mu e + lam tr(e) I [Pa]: Hooke's law with Lame's moduli [Pa]."""
    trace = lam * (e[0] + e[1] + e[2])
    two = 2.0 * mu
    return (
        two * e[0] + trace,
        two * e[1] + trace,
        two * e[2] + trace,
        two * e[3],
        two * e[4],
        two * e[5],
    )


def strain_energy(mu: float, lam: float, e: Symmetric) -> float:
    """Return mu e:e + lam tr(e)^2/2 [J/m^3]."""
    trace = e[0] + e[1] + e[2]
    return mu * inner(e, e) + 0.5 * lam * trace * trace


def mean_pull(
    f: Matrix, f_new: Matrix, r: Matrix, r_new: Matrix, e: Symmetric, e_new: Symmetric, s: Symmetric
) -> Matrix:
    """Return the discrete gradient p [Pa] with p : (f_new - f) = s : (e_new - e), see above.

    Parameters
    ----------
    f, f_new, r, r_new : Matrix
        Deformation gradient and rotation, before and after the step.
    e, e_new : Symmetric
        Strain before and after.
    s : Symmetric
        Mean stress in the axes that turn with the element [Pa].
    """
    a = (
        1.0 + 0.5 * (e[0] + e_new[0]),
        1.0 + 0.5 * (e[1] + e_new[1]),
        1.0 + 0.5 * (e[2] + e_new[2]),
        0.5 * (e[3] + e_new[3]),
        0.5 * (e[4] + e_new[4]),
        0.5 * (e[5] + e_new[5]),
    )
    back, size = inverse(a)
    whole = full(s)
    if size > FLAT:
        m = product(whole, full(a))
        half = inverse(turning(a))[0]
        w = applied(half, (0.5 * (m[7] - m[5]), 0.5 * (m[2] - m[6]), 0.5 * (m[3] - m[1])))
        turned = (
            whole[0],
            whole[1] + 2.0 * w[2],
            whole[2] - 2.0 * w[1],
            whole[3] - 2.0 * w[2],
            whole[4],
            whole[5] + 2.0 * w[0],
            whole[6] + 2.0 * w[1],
            whole[7] - 2.0 * w[0],
            whole[8],
        )
        mean = halfway(f, f_new)
        return product(mean, product(full(back), turned))
    mean = halfway(r, r_new)
    p = product(mean, whole)
    given = 0.0
    moved = 0.0
    for c in range(9):
        given += p[c] * (f_new[c] - f[c])
        moved += (f_new[c] - f[c]) * (f_new[c] - f[c])
    if not moved > 0.0:
        return p
    due = (
        s[0] * (e_new[0] - e[0])
        + s[1] * (e_new[1] - e[1])
        + s[2] * (e_new[2] - e[2])
        + 2.0 * s[3] * (e_new[3] - e[3])
        + 2.0 * s[4] * (e_new[4] - e[4])
        + 2.0 * s[5] * (e_new[5] - e[5])
    )
    k = (due - given) / moved
    return (
        p[0] + k * (f_new[0] - f[0]),
        p[1] + k * (f_new[1] - f[1]),
        p[2] + k * (f_new[2] - f[2]),
        p[3] + k * (f_new[3] - f[3]),
        p[4] + k * (f_new[4] - f[4]),
        p[5] + k * (f_new[5] - f[5]),
        p[6] + k * (f_new[6] - f[6]),
        p[7] + k * (f_new[7] - f[7]),
        p[8] + k * (f_new[8] - f[8]),
    )
