"""The string is the wave coupling's line: same waves, same energy, the pitch of its length."""

from __future__ import annotations

import math
import random

import pytest

from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Network, String
from tautwave_scenes.networks.strings import DelayLine

PERIOD = 1.0 / 44_100.0
APART = Link("apart", "contact", "string", "hand", stiffness=1.0, rest=-9.0)  # never touches


def string_scene(*links: Link, near: int = 40, far: int = 60, **more: float) -> SceneModel:
    string = String("string", 0.5, near, far, **more)
    network = Network((), links or (APART,), ("hand",), strings=(string,))
    return SceneModel(network, "discrete_gradient", PERIOD)


def test_a_wave_comes_back_when_the_length_says_so():
    model = string_scene()
    model.strings[0]._ends[0].arriving = 1.0
    seen = []
    for k in range(700):
        model.advance([0.0])
        seen.append((k, model.arrays.v[0]))
    pulses = [k for k, v in seen if abs(v) > 1e-12]
    assert pulses == [0, 122, 204, 326, 408, 530, 612]  # 2 * 60 + 2 and 2 * 40 + 2, by turns
    assert [round(v, 12) for _, v in seen if abs(v) > 1e-12] == [1, -1, 1, -1, 1, -1, 1]


def test_the_string_equals_two_lines_of_the_wave_coupling_to_the_bit():
    """A mass struck against the string, with the same ends made of bare DelayLines."""
    spring = Link("pick", "plastic", "hand", "string", stiffness=2000.0, limit=1.0)
    model = string_scene(spring, near=7, far=11, reflection=0.9)
    lines = (DelayLine(7, PERIOD), DelayLine(11, PERIOD))
    arriving, back = [0.0, 0.0], [0.0, 0.0]
    for k in range(3000):
        want_push = math.sqrt(2.0 * 0.5) * (arriving[0] + arriving[1])
        model.advance([0.004 * math.sin(0.005 * k)])
        assert model.arrays.pushed[0] == want_push
        motion = math.sqrt(2.0 * 0.5) * model.arrays.v[0]
        for at, line in enumerate(lines):
            arriving[at], end = line.exchange(motion - arriving[at], back[at])
            back[at] = -0.9 * end
    assert abs(model.arrays.v[0]) > 0.0
    on_line = sum(line.stored for line in lines)
    assert on_line <= model.strings[0].stored


def test_the_strings_account_closes_and_every_joule_is_on_its_lines():
    spring = Link("pick", "plastic", "hand", "string", stiffness=2000.0, limit=1.0)
    model = string_scene(spring, reflection=0.99, smoothing=0.8)
    for k in range(6000):
        model.advance([min(0.005, 1e-5 * k) if k < 1000 else 0.0])
        assert abs(model.residual()) < 1e-14
    string = model.strings[0]
    assert string.absorbed(model.arrays) == pytest.approx(string.stored + string.lost, rel=1e-9)
    assert string.lost > 1e-4


def test_a_bow_keeps_the_string_going():
    """Falling friction feeds the swing: it lasts while the bow moves, and dies when it stops."""
    bow = Link("hair", "bow", "hand", "string", limit=0.4, scale=0.05)
    model = string_scene(bow, reflection=0.99, smoothing=0.8)
    place, loud, quiet = 0.0, 0.0, 0.0
    for k in range(12_000):
        if k < 8000:
            place += 0.2 * PERIOD
        model.advance([place])
        if 6000 < k < 8000:
            loud = max(loud, model.arrays.v[0]) if k > 6001 else model.arrays.v[0]
            quiet = min(quiet, model.arrays.v[0]) if k > 6001 else model.arrays.v[0]
    assert loud - quiet > 0.05
    assert abs(model.residual()) < 1e-12


@pytest.mark.sparse(2)
@pytest.mark.parametrize("shaking", [0.1, 0.2])
def test_a_trembling_bow_leaves_no_step_unsolved(shaking):
    """Newton alone goes to and fro between two pieces of the friction curve, one step in 5000."""
    rng = random.Random(1)
    bow = Link("hair", "bow", "hand", "string", limit=0.5, scale=0.04)
    model = string_scene(bow, smoothing=0.8)
    place = before = 0.0
    for _ in range(10_000):
        place += shaking * rng.gauss(0.0, 1.0) * PERIOD
        model.advance([place])
        assert abs(model.residual() - before) < 1e-14
        before = model.residual()
