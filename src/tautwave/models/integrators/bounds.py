"""What a scheme can hold at a step: linear stability, and steps per contact.

A scheme that steps across the edge of a contact needs more than linear stability: within two or
three steps per contact an explicit one throws the mass out faster than it came (280 times at 0.3
steps), and implicit midpoint too (1.6 times). SI of the axis; t is the sub-step [s].
"""

from __future__ import annotations

import math

from tautwave.models.foam import FoamParams
from tautwave.models.integrators.schemes import RK4, SYMPLECTIC_EULER
from tautwave.models.plant_params import PlantParams

CONTACT_RATE = 0.5
"""Greatest w t at which a stepping scheme may meet a one-sided contact: 6.3 steps in one. Exit
speed is then within 5 % at every phase (`tests/models/test_schemes_choice.py`)."""


def greatest_depth(plant: PlantParams, foam: FoamParams, speed: float, effort: float) -> float:
    """Return how deep a contact is pressed by an impact at `speed` or by `effort` [m or rad]."""
    if not foam.stiffness > 0.0:
        return 0.0
    a = foam.exponent
    energy = 0.5 * plant.mass * speed * speed
    depth = math.pow((a + 1.0) * energy / foam.stiffness, 1.0 / (a + 1.0))
    pressed = math.pow(math.fabs(effort) / foam.stiffness, 1.0 / a)
    if pressed > depth:
        depth = pressed
    return depth


def contact_slope(foam: FoamParams, depth: float) -> float:
    """Return the stiffness of a contact at a depth [N/m or N m/rad]."""
    if foam.exponent == 1.0:
        return foam.stiffness
    if not depth > 0.0:
        return 0.0
    return foam.stiffness * foam.exponent * math.pow(depth, foam.exponent - 1.0)


def step_growth(scheme: int, stiffness: float, damping: float, mass: float, t: float) -> float:
    """Return the spectral radius of one step of a linear oscillator: above 1 it explodes [1].

    Schemes that are exact or controlled by their error, and the implicit ones, never exceed 1.
    """
    square = stiffness / mass * t * t
    drag = damping / mass * t
    if scheme == SYMPLECTIC_EULER:
        # z**2 - (2 - drag - square) z + (1 - drag) = 0
        half = 0.5 * (2.0 - drag - square)
        product = 1.0 - drag
        left = half * half - product
        if left <= 0.0:
            return math.sqrt(product)
        return math.fabs(half) + math.sqrt(left)
    if scheme == RK4:
        middle = -0.5 * drag
        left = middle * middle - square
        if left <= 0.0:
            return _rk4_gain(middle, math.sqrt(-left))
        one = _rk4_gain(middle + math.sqrt(left), 0.0)
        two = _rk4_gain(middle - math.sqrt(left), 0.0)
        if one > two:
            return one
        return two
    return 1.0


def _rk4_gain(re: float, im: float) -> float:
    """Modulus of 1 + z + z**2/2 + z**3/6 + z**4/24."""
    p = 1.0
    q = 0.0
    for i in range(4):
        n = 4.0 - i
        a = (re * p - im * q) / n
        b = (re * q + im * p) / n
        p = 1.0 + a
        q = b
    return math.sqrt(p * p + q * q)


def greatest_stiffness(scheme: int, damping: float, mass: float, t: float) -> float:
    """Return the greatest spring that a scheme holds on a linear oscillator [N/m or N m/rad]."""
    if scheme == SYMPLECTIC_EULER:
        left = 4.0 - 2.0 * damping * t / mass
        if left < 0.0:
            return 0.0
        return left * mass / (t * t)
    if scheme != RK4:
        return math.inf
    high = 16.0 * mass / (t * t)
    low = 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if step_growth(scheme, middle, damping, mass, t) <= 1.0:
            low = middle
        else:
            high = middle
    return low


def contact_stiffness_limit(scheme: int, damping: float, mass: float, t: float) -> float:
    """Return the greatest stiffness of a one-sided contact that a scheme holds [N/m or N m/rad].

    Infinite for schemes that keep the energy or locate the contact.
    """
    if scheme < SYMPLECTIC_EULER or scheme > RK4:
        return math.inf
    rate = CONTACT_RATE / t
    limit = mass * rate * rate
    smooth = greatest_stiffness(scheme, damping, mass, t)
    if smooth < limit:
        return smooth
    return limit
