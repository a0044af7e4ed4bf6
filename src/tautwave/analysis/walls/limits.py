"""How far a wall may be turned up on a given device, and what would let it go further.

At one frequency the set of passive (K, B) is convex, so along K or B the needed damping is a
convex function. Newton's method from above therefore reaches the greatest passive value without
stepping over it, and every value is judged by the proved bound of
`tautwave.analysis.walls.passivity`, not by a grid.

Sources: Colgate & Schenkel 1997; Newton on a convex function (Dinkelbach 1967).
"""

from __future__ import annotations

import math

import numpy as np

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import (
    SampledWall,
    check_wall,
    split_delay,
    velocity_gain,
)
from tautwave.errors import ConfigError

TIGHT = 1e-9
"""Relative excess of needed over present damping that still counts as passive: rounding."""

LONGEST = 400.0
"""Delay in periods beyond which a faster loop is not looked for."""


def is_passive(wall: SampledWall, device_damping: float) -> bool:
    """Return whether the wall is passive on a device of so much viscous damping."""
    return wall_leak(wall).damping <= device_damping * (1.0 + TIGHT)


def greatest_stiffness(wall: SampledWall, device_damping: float) -> float:
    """Return the greatest passive K [N/m or N m/rad] with the wall's B, delay and filter.

    0 if not even the least spring passes: the wall's damping or the delay is too much.
    """
    _check_damping(device_damping)
    stiffness = _greatest(
        wall._replace(stiffness=0.0), wall._replace(stiffness=1.0), device_damping
    )
    return stiffness if stiffness > 0.0 else 0.0


def greatest_damping(wall: SampledWall, device_damping: float) -> float:
    """Return the greatest passive B [N s/m or N m s/rad] with the wall's K; -inf if none is."""
    _check_damping(device_damping)
    return _greatest(wall._replace(damping=0.0), wall._replace(damping=1.0), device_damping)


def least_rate(wall: SampledWall, device_damping: float, *, delay_s: float | None = None) -> float:
    """Return the lowest rate [Hz], from the present one up, at which the wall is passive.

    Parameters
    ----------
    wall : SampledWall
        K, B, delay, filter and the present period.
    device_damping : float
        Viscous damping of the device [N s/m or N m s/rad].
    delay_s : float, optional
        Delay that stays as it is [s]. If not given, the wall's delay is one in periods, as that
        of a computation, and shrinks with them.

    Returns
    -------
    float
        Rate [Hz]; it is one that passes, to 1e-6. inf if no rate helps: the damping is too
        much, or a fixed delay, or it would be beyond 400 periods.
    """
    check_wall(wall)
    _check_damping(device_damping)

    def at(period: float) -> SampledWall:
        delay = wall.delay if delay_s is None else delay_s / period
        return wall._replace(period=period, delay=delay)

    if is_passive(at(wall.period), device_damping):
        return 1.0 / wall.period
    fixed = 0.0 if delay_s is None else delay_s
    if wall.stiffness * fixed + max(-wall.damping, 0.0) >= device_damping:
        return math.inf
    if wall.filter_s == 0.0 and wall.damping >= device_damping:
        return math.inf
    slow, fast = wall.period, wall.period
    while True:
        slow, fast = fast, 0.5 * fast
        if at(fast).delay > LONGEST or fast < 1e-9 * wall.period:
            return math.inf
        if is_passive(at(fast), device_damping):
            break
    while slow - fast > 1e-6 * slow:
        middle = math.sqrt(slow * fast)
        if is_passive(at(middle), device_damping):
            fast = middle
        else:
            slow = middle
    return 1.0 / fast


def _check_damping(device_damping: float) -> None:
    if not (math.isfinite(device_damping) and device_damping >= 0.0):
        raise ConfigError(f"device damping: must be finite, not negative (got {device_damping})")


def _greatest(base: SampledWall, full: SampledWall, device_damping: float) -> float:
    """Return the greatest s for which base + s (full - base) is passive; -inf if none is."""
    check_wall(full)
    limit = min(_cut(base, full, device_damping, t) for t in np.linspace(0.0, math.pi, 65).tolist())
    for _ in range(100):
        if limit == -math.inf:
            break
        # A spring must not be negative; a damper may.
        if full.stiffness != base.stiffness and limit <= 0.0:
            break
        leak = wall_leak(_between(base, full, limit))
        if leak.damping <= device_damping * (1.0 + 0.5 * TIGHT):
            break
        lower = _cut(base, full, device_damping, leak.theta)
        if lower > limit + 1e-6 * abs(limit):
            return -math.inf  # this angle requires more, the ones before less
        if not lower < limit:
            lower = limit - 1e-12 * abs(limit)  # rounding holds it up
        limit = lower
    return limit


def _between(base: SampledWall, full: SampledWall, s: float) -> SampledWall:
    return base._replace(
        stiffness=base.stiffness + s * (full.stiffness - base.stiffness),
        damping=base.damping + s * (full.damping - base.damping),
    )


def _cut(base: SampledWall, full: SampledWall, device_damping: float, theta: float) -> float:
    """Return the greatest s that the condition at one angle allows, inf or -inf included.

    With y = 2 b / T and e = f (1 - f) the condition is y^2 - y (p0 + s p1) - e |E0 + s E1|^2 >= 0.
    """
    y = 2.0 * device_damping / base.period
    _, rest = split_delay(base.delay)
    share = rest * (1.0 - rest)
    spring, spring_value = _spring_term(base, theta)
    damper, damper_value = _damper_term(base, theta)
    p0 = base.stiffness * spring + base.damping * damper
    e0 = base.stiffness * spring_value + base.damping * damper_value
    p1 = (full.stiffness - base.stiffness) * spring + (full.damping - base.damping) * damper
    e1 = (full.stiffness - base.stiffness) * spring_value
    e1 += (full.damping - base.damping) * damper_value
    a = share * abs(e1) ** 2
    half = 0.5 * (y * p1 + 2.0 * share * (e0 * e1.conjugate()).real)
    c = y * y - y * p0 - share * abs(e0) ** 2
    if y == 0.0:
        a, half, c = 0.0, 0.5 * p1, -p0
    if a == 0.0:
        if half == 0.0:
            return math.inf if c >= 0.0 else -math.inf
        return c / (2.0 * half) if half > 0.0 else math.inf
    square = half * half + a * c
    if square < 0.0:
        return -math.inf
    root = math.sqrt(square)
    # Of (-half + root) / a the form without cancellation.
    return c / (half + root) if half > 0.0 else (root - half) / a


def _spring_term(wall: SampledWall, theta: float) -> tuple[float, complex]:
    """Return what K = 1 adds to y at an angle, delay included, and E there."""
    whole, rest = split_delay(wall.delay)
    here = _dirichlet(whole, theta)
    return (1.0 - rest) * here + rest * _dirichlet(whole + 1, theta), 1.0 + 0.0j


def _damper_term(wall: SampledWall, theta: float) -> tuple[float, complex]:
    """Return what B = 1 adds to y at an angle, delay included, and E there."""
    whole, rest = split_delay(wall.delay)
    gain = velocity_gain(wall)
    step = complex(-2.0 * math.sin(0.5 * theta) ** 2, math.sin(theta))  # z - 1
    value = gain * step / (wall.period * (step + gain))
    # y = Re{(1 - 1/z) E z^-d} / (1 - cos): with z - 1 taken out of E nothing is left to cancel.
    outer = (gain / (wall.period * (step + gain))) * step * step / (step + 1.0)
    total = 0.0
    for later, part in ((whole, 1.0 - rest), (whole + 1, rest)):
        if theta == 0.0:
            total += part * (-2.0 / wall.period)
            continue
        turned = outer * complex(math.cos(later * theta), -math.sin(later * theta))
        total += part * turned.real / (2.0 * math.sin(0.5 * theta) ** 2)
    return total, value


def _dirichlet(order: int, theta: float) -> float:
    """Return 1 + 2 cos theta + ... + 2 cos(order theta)."""
    below = math.sin(0.5 * theta)
    if below == 0.0:
        return 2.0 * order + 1.0
    return math.sin((order + 0.5) * theta) / below
