"""Law mediated in a mirror: what is above a device is treated as what is below it."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from tautwave.controller.records import AxisState
from tautwave.couplings.mediated.estimate import Surface
from tautwave.couplings.mediated.law import (
    MediatedEnd,
    begin,
    cover,
    effort,
    end_constants,
    held,
    keep,
    shown,
    whole,
)
from tests.parts.test_mediated_model import AXIS, PAIR


class Constants:
    """Of an axis, those that the steps read."""

    def __init__(self, side: str) -> None:
        self.end = end_constants(PAIR, side, AXIS)


def played(side: str, sign: float, *, account: bool) -> list[list[float]]:
    """Return what an end shows, asks for and holds, sample by sample, of random contacts."""
    chance = random.Random(7)
    s, p = AxisState(end=MediatedEnd()), Constants(side)
    params: Any = p
    begin(s)
    rows = []
    x, far = 0.0, [0.0, 0.0, 0.0]
    for number in range(400):
        if number % 40 == 0:
            far = [chance.uniform(-0.1, 0.1), chance.uniform(0.0, 0.02), chance.choice((-9.0, 9.0))]
        step = 0.006 * math.cos(0.09 * number) + chance.gauss(0.0, 1e-5)
        push = 12.0 * max(0.0, x - 0.02) - 7.0 * max(0.0, -0.03 - x)
        x += step
        s.position, s.velocity = sign * x, sign * step / AXIS.period
        s.effort_sum = sign * push
        s.outside = -sign * push
        e = s.end
        e.far_position, e.far_velocity, e.far_effort = sign * far[0], -far[1], sign * far[2]
        if side == "slave":
            e.far_velocity = sign * far[1]
        keep(s, params, sign * step, 1.0, AXIS.period, 0.0)
        if account:
            cover(s, params, 1e-3)
        asked = effort(s, params, 0.0)
        place, speed = shown(s)
        rows.append([sign * place, speed, sign * e.effort, sign * asked, held(s), e.paid,
                     sign * whole(s, params, asked), sign * e.contact.side])  # fmt: skip
    return rows


@pytest.mark.parametrize("account", [False, True])
@pytest.mark.parametrize("side", ["master", "slave"])
def test_a_mirrored_contact_is_rendered_and_learned_mirrored(side: str, account: bool) -> None:
    here, there = played(side, 1.0, account=account), played(side, -1.0, account=account)
    touched = {one[7] for one in here}
    for one, other in zip(here, there, strict=True):
        if other[1] == -one[1]:  # its own velocity turns, a surface's damping does not
            other[1] = one[1]
        assert other == pytest.approx(one, rel=1e-12, abs=1e-15)
    if side == "slave":
        assert touched == {-1.0, 0.0, 1.0}
        assert {math.copysign(1.0, one[2]) for one in here if one[2]} == {-1.0, 1.0}
    else:
        assert min(one[3] for one in here) < 0.0 < max(one[3] for one in here)


def test_a_slave_shows_the_surface_that_it_found_last() -> None:
    s = AxisState(end=MediatedEnd())
    s.position, s.end.smooth = 0.25, -0.5
    s.end.contact.above = Surface(9.0, 0.1, 1.0)
    s.end.contact.below = Surface(7.0, 0.2, -1.0)
    for reported, expected in ((1.0, (1.0, 0.1)), (-1.0, (-1.0, 0.2)), (0.0, (0.25, -0.5))):
        s.end.contact.reported = reported
        assert shown(s) == expected
