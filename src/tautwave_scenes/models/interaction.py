"""Laws of the links of a mass-interaction network: tension over stretch and over its rate.

A link between nodes a and b has the stretch d = x_a - x_b - rest and the rate w = v_a - v_b. Its
tension t pulls a by -t and b by +t. Elastic links have a potential V with t = V'(d); a contact
acts only while d < 0, so a lies above b. `mean_tension` is the discrete gradient
(V(d') - V(d))/(d' - d): a scheme that holds it over a step keeps the energy at any stiffness.

Sources: Cadoz, Luciani & Florens 1993 (the elements of CORDIS-ANIMA); Hunt & Crossley 1975;
Chatziioannou & van Walstijn 2015 (the discrete gradient of a power law). Units: m, N, s, or rotary.
"""

from __future__ import annotations

import math

SPRING = 0
POWER = 1
CONTACT = 2
PLASTIC = 3
FRICTION = 4
BOW = 5
NEGATIVE = 6
SOURCE = 7

_NEAR = 0.02  # of the stretch: below this step a series has more digits than a difference


def elastic_tension(kind: int, k: float, e: float, d: float) -> float:
    """Tension of an elastic link at stretch `d`; stiffness `k` [N/m**e], exponent `e`."""
    if kind == CONTACT:
        if d >= 0.0:
            return 0.0
        if e == 1.0:
            return k * d
        if e == 2.0:
            return -k * d * d
        return -k * math.pow(-d, e)
    if kind == POWER:
        if d < 0.0:
            return -k * math.pow(-d, e)
        return k * math.pow(d, e)
    return k * d


def elastic_energy(kind: int, k: float, e: float, d: float) -> float:
    """Energy stored in an elastic link at stretch `d` [J]."""
    if kind == CONTACT:
        if d >= 0.0:
            return 0.0
        if e == 1.0:
            return 0.5 * k * d * d
        if e == 2.0:
            return -k * d * d * d / 3.0
        return k * math.pow(-d, e + 1.0) / (e + 1.0)
    if kind == POWER:
        return k * math.pow(math.fabs(d), e + 1.0) / (e + 1.0)
    return 0.5 * k * d * d


def mean_tension(kind: int, k: float, e: float, d: float, moved: float) -> tuple[float, float]:
    """Discrete gradient of an elastic link that is stretched from `d` to `d + moved`.

    Returns
    -------
    tuple of float
        Mean tension [N], and its derivative by `moved` [N/m], never negative.
    """
    end = d + moved
    if kind in (SPRING, PLASTIC):
        return k * (d + 0.5 * moved), 0.5 * k
    if kind == CONTACT:
        if d >= 0.0 and end >= 0.0:
            return 0.0, 0.0
        if d < 0.0 and end < 0.0:
            if e == 1.0:
                return k * (d + 0.5 * moved), 0.5 * k
            if e == 2.0:
                return -k * (d * d + d * end + end * end) / 3.0, -k * (d + 2.0 * end) / 3.0
    if math.fabs(moved) <= _NEAR * math.fabs(d):
        middle = d + 0.5 * moved
        if middle == 0.0:
            return 0.0, 0.0
        tension = elastic_tension(kind, k, e, middle)
        share = moved / middle
        square = share * share
        second = e * (e - 1.0) / 24.0
        fourth = second * (e - 2.0) * (e - 3.0) / 80.0
        mean = tension * (1.0 + square * (second + square * fourth))
        return mean, tension / middle * (0.5 * e + 2.0 * second * share)
    gained = elastic_energy(kind, k, e, end) - elastic_energy(kind, k, e, d)
    mean = gained / moved
    slope = (elastic_tension(kind, k, e, end) - mean) / moved
    if slope < 0.0:
        slope = 0.0
    return mean, slope


def lossy_contact(
    mean: float, slope: float, loss: float, rate: float, inverse: float
) -> tuple[float, float]:
    """Hunt and Crossley's loss on a contact's tension, which never pulls.

    Parameters
    ----------
    mean, slope : float
        Elastic tension (<= 0) and its derivative by the movement.
    loss : float
        [s/m] The tension grows by the factor 1 + loss * speed of approach.
    rate : float
        w of the link [m/s]; negative while it is pressed together.
    inverse : float
        dw/d(movement) [1/s]: 1/T where the rate is that of the step, 0 where it is given.
    """
    factor = 1.0 - loss * rate
    if factor <= 0.0:
        return 0.0, 0.0
    return mean * factor, slope * factor - mean * loss * inverse


def rate_tension(kind: int, z: float, f: float, scale: float, w: float) -> tuple[float, float]:
    """Tension that depends on the rate `w` [m/s] only, and its derivative by `w`.

    SPRING and every other elastic link: damping `z` [N s/m]. FRICTION: f r / sqrt(1 + r**2) with
    r = w/scale, dry friction rounded off below `scale`. BOW: 2 f r / (1 + r**2), which falls above
    `scale`. NEGATIVE: -z w. SOURCE: gives the power f [W] away, less below the speed `scale`.
    """
    if kind == FRICTION:
        r = w / scale
        root = math.sqrt(1.0 + r * r)
        return f * r / root, f / (scale * root * root * root)
    if kind == BOW:
        r = w / scale
        one = 1.0 + r * r
        return 2.0 * f * r / one, 2.0 * f * (1.0 - r * r) / (scale * one * one)
    if kind == NEGATIVE:
        return -z * w, -z
    if kind == SOURCE:
        bottom = w * w + scale * scale
        return -f * w / bottom, f * (w * w - scale * scale) / (bottom * bottom)
    return z * w, z


def yielded(k: float, f: float, d: float, set_in: float) -> float:
    """Plastic set of a link at stretch `d`: its spring `k` never bears more than `f` [N]."""
    strain = d - set_in
    if k * strain > f:
        return d - f / k
    if k * strain < -f:
        return d + f / k
    return set_in
